#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_EXT_shader_explicit_arithmetic_types : require

// A payload with scalars of every kind; traces on where a push constant asks for it.

struct Sample {
    uint n;
    float w;
};

struct Payload {
    vec3 c;
    uint hits;
    bool flag;
    float16_t h;
    double d;
    int64_t i;
    mat2x3 m;
    Sample s[2];
};

layout(location = 0) rayPayloadInEXT Payload p;
layout(location = 1) rayPayloadEXT Payload q;

hitAttributeEXT vec2 barycentrics;

layout(shaderRecordEXT, std430) buffer Record {
    uint id;
    float k;
} record;

layout(push_constant) uniform Constants {
    uint count;
    float scale;
} constants;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;

layout(set = 0, binding = 1, std430) buffer Outputs {
    uint o[8];
} outputs;

void main() {
    p.hits += constants.count + record.id;
    p.c = vec3(barycentrics, gl_HitTEXT);
    p.d = p.d * 2.0;
    p.i = p.i - 1L;
    outputs.o[0] += 1u;
    outputs.o[1] = p.hits;
    if (constants.scale > 0.5) {
        q.hits = 3u;
        traceRayEXT(scene, 0u, 0xffu, 0u, 0u, 0u, vec3(0.0), 0.0, vec3(0.0, 0.0, 1.0), 10.0, 1);
        p.hits += q.hits;
        p.c = q.c;
    }
}
