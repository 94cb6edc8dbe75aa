#version 460
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_clustered : require
#extension GL_KHR_shader_subgroup_quad : require
#extension GL_KHR_shader_subgroup_rotate : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_NV_shader_subgroup_partitioned : require

// A record of twelve words for each of 160 invocations: subgroups of 64 or 128 and a part of one.
layout(local_size_x = 160) in;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[160][12]; };

void main() {
    uint at = gl_LocalInvocationIndex;
    outputs[at][0] = subgroupAdd(at);
    outputs[at][1] = subgroupInclusiveAdd(1u);
    outputs[at][2] = subgroupBallotBitCount(subgroupBallot(at % 3 == 0));
    outputs[at][3] = subgroupShuffleXor(at, 32);
    outputs[at][4] = subgroupBroadcast(at, 20);
    outputs[at][5] = subgroupClusteredMax(at, 16);
    outputs[at][6] = subgroupQuadSwapDiagonal(at);
    outputs[at][7] = subgroupQuadBroadcast(at, 2);
    outputs[at][8] = subgroupPartitionedAddNV(at, subgroupPartitionNV(at % 5));
    outputs[at][9] = subgroupBallotFindMSB(subgroupBallot(true));
    uvec4 bits = uvec4(bitCount(gl_SubgroupLtMask));
    outputs[at][10] = bits.x + bits.y + bits.z + bits.w;
    outputs[at][11] = subgroupRotate(at, 1);
}
