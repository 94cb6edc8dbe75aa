#version 460
#extension GL_KHR_shader_subgroup_rotate : require
//@ flags: -g

// Each of four samples of a pixel compares its radiance with that of the next one. A sample
// without a hit has none.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) writeonly buffer Contrasts { float contrasts[]; };
layout(set = 0, binding = 2, std430) readonly buffer Samples { float radiances[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    float radiance = radiances[index];
    float contrast = 0.0;
    float next = subgroupClusteredRotate(radiance, 1u, 4u);
    if (radiance >= 0.0) {
        contrast = abs(radiance - max(next, 0.0));
    }
    contrasts[index] = contrast;
}
