#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

struct Landing {
    float t;
};

layout(location = 0) rayPayloadInEXT Landing landing;

void main() {
    landing.t = 0.0;
}
