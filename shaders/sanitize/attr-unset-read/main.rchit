#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Wheel {
    vec2 place;
    float angle; // 0 in the hub
};

layout(location = 0) rayPayloadInEXT float shade;
hitAttributeEXT Wheel wheel;

void main() {
    shade = 0.5 + 0.125 * cos(wheel.angle) + 0.25 * wheel.place.y;
}
