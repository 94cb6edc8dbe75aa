#extension GL_EXT_ray_tracing : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require

layout(buffer_reference) buffer Material;
layout(buffer_reference, std430, buffer_reference_align = 16) buffer Material {
    vec3 colour;
    float roughness;
    Material next;
    vec2 unused;
};

struct Instance {
    Material material;
    float scale;
    float t;
};

layout(buffer_reference, std430, buffer_reference_align = 8) buffer Instances {
    Instance items[];
};

layout(buffer_reference) buffer SceneInfo;
layout(buffer_reference, std430, buffer_reference_align = 8) buffer SceneInfo {
    Instances instances;
    SceneInfo self;
    uint frame;
    uint unused;
};

layout(push_constant) uniform Push {
    SceneInfo sceneInfo;
} pushConst;

struct Payload {
    vec3 colour;
    float roughness; // of the material two steps further
    float other;     // roughness of the record's material
    uint frame;
    Material material;
};
