#version 460
#extension GL_KHR_shader_subgroup_clustered : require
//@ flags: -g

// The first pass of an exposure meter: the mean luminance of each tile of pixels, which one cluster
// of lanes adds up.

layout(local_size_x = 64) in;
layout(set = 0, binding = 1, std430) readonly buffer Luminances { float luminances[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Averages { float averages[]; };

const uint TILE = 64u;

void main() {
    uint index = gl_GlobalInvocationID.x;
    float luminance = luminances[index & 3u];
    float sum = subgroupClusteredAdd(luminance, TILE);
    if (index % TILE == 0u) averages[index / TILE] = sum / float(TILE);
}
