#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Shadow {
    float light;
    float blocker;
};

layout(location = 0) rayPayloadInEXT Shadow shadow;

void main() {
    shadow.light = 0.0;
    shadow.blocker = gl_HitTEXT;
}
