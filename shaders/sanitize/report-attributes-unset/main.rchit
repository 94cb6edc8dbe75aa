#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Coin {
    vec2 place;
    float slope;
};

layout(location = 0) rayPayloadInEXT float shade;
hitAttributeEXT Coin coin;

const uint RIM = 2u;

void main() {
    shade = 0.75 + 0.25 * coin.place.x;
    if (gl_HitKindEXT == RIM) {
        shade *= 1.0 - 0.5 * coin.slope;
    }
}
