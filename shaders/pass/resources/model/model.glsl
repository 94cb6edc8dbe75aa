#extension GL_EXT_ray_tracing : require

struct Payload {
    vec3 colour;
    uint feature;
};
