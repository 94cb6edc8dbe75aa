#version 460
#extension GL_KHR_shader_subgroup_arithmetic : require
//@ flags: -g

// Noise is taken out of a row of samples: each pixel is the mean of the samples of its subgroup.

layout(local_size_x = 64) in;

layout(set = 0, binding = 1, std430) readonly buffer Samples { float samples[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Picture { float picture[]; };

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    picture[pixel] = subgroupAdd(samples[pixel]) / float(gl_SubgroupSize);
}
