#version 460
#extension GL_EXT_ray_tracing : require

// One shader in several records: each answers with its record's data.

layout(shaderRecordEXT, std430) buffer Record {
    vec4 colour;
    uint tag;
    float table[2];
};
layout(push_constant, std430) uniform Constants {
    layout(offset = 48) float values[3];
};
layout(location = 0) rayPayloadInEXT vec4 answer;

void main() {
    answer = vec4(colour.xy, float(tag), table[gl_GeometryIndexEXT] + values[1]);
}
