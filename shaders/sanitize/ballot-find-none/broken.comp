#version 460
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_vote : require
//@ flags: -g

// The first lane of a subgroup whose ray has hit an emitter is noted for the next frame.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) writeonly buffer Leaders { uint leaders[]; };
layout(set = 0, binding = 2, std430) readonly buffer Hits { float emission[]; };

const uint NOBODY = 0xFFFFFFFFu;

void main() {
    uint index = gl_GlobalInvocationID.x;
    bool hit = emission[index] > 0.0;
    uvec4 ballot = subgroupBallot(hit);
    uint leader = NOBODY;
    leader = subgroupBallotFindLSB(ballot);
    leaders[index] = leader;
}
