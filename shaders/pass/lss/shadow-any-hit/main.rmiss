#version 460
#extension GL_EXT_ray_tracing : require

struct Light {
    float through;
    uint runs;
    float last_t;
    float missed;
};

layout(location = 0) rayPayloadInEXT Light light;

void main() {
    light.missed = 1.0;
}
