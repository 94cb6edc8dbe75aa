#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The light itself: it takes nothing away.

struct Shadow {
    uint leaves;
};

layout(location = 0) rayPayloadInEXT Shadow shadow;

void main() {}
