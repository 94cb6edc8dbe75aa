#version 460
#extension GL_KHR_shader_subgroup_ballot : require
//@ flags: -g

// Each lane tests one light of a cell against its shadow cache; then every lane asks whether the
// light that its pixel has drawn is lit.

layout(local_size_x = 32) in;
layout(set = 0, binding = 1, std430) writeonly buffer Shading { float shading[]; };
layout(set = 0, binding = 2, std430) readonly buffer Cache { float visibility[]; };
layout(set = 0, binding = 3, std430) readonly buffer Draws { uint draws[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    uvec4 lit = subgroupBallot(visibility[index & 3u] > 0.5);
    uint light = draws[index & 3u];
    bool visible = light < gl_SubgroupSize && subgroupBallotBitExtract(lit, light);
    shading[index] = visible ? 1.0 : 0.0;
}
