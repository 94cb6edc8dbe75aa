#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The miss shader of shadow rays: nothing is in the way of the light.

struct Shadow {
    float light;
    float blocker; // how far away what throws the shadow is; 0 without
};

layout(location = 0) rayPayloadInEXT Shadow shadow;

void main() {
    shadow.light = 1.0;
}
