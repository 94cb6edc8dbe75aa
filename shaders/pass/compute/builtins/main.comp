#version 460
#extension GL_KHR_shader_subgroup_basic : require
//@ also O0: -O0

// Every compute builtin, a record of 20 words for each invocation.
layout(local_size_x_id = 0, local_size_y = 2, local_size_z = 1) in;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[]; };

void main() {
    uvec3 size = gl_NumWorkGroups * gl_WorkGroupSize;
    uint global = (gl_GlobalInvocationID.z * size.y + gl_GlobalInvocationID.y) * size.x + gl_GlobalInvocationID.x;
    uint at = global * 20;
    for (uint axis = 0; axis < 3; ++axis) {
        outputs[at + axis] = gl_NumWorkGroups[axis];
        outputs[at + 3 + axis] = gl_WorkGroupSize[axis];
        outputs[at + 6 + axis] = gl_WorkGroupID[axis];
        outputs[at + 9 + axis] = gl_LocalInvocationID[axis];
        outputs[at + 12 + axis] = gl_GlobalInvocationID[axis];
    }
    outputs[at + 15] = gl_LocalInvocationIndex;
    outputs[at + 16] = gl_NumSubgroups;
    outputs[at + 17] = gl_SubgroupID;
    outputs[at + 18] = gl_SubgroupSize;
    outputs[at + 19] = gl_SubgroupInvocationID;
}
