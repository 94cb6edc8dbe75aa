#version 460
#extension GL_KHR_shader_subgroup_ballot : require
//@ flags: -g

// Each tile has a mask of the lanes that shade it; a lane asks whether it is among those of its
// own tile.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) writeonly buffer Shaded { uint shaded[]; };
layout(set = 0, binding = 2, std430) readonly buffer Tiles { uvec4 masks[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    uvec4 mask = masks[index / 4u];
    bool own = subgroupBallotBitExtract(mask, gl_SubgroupInvocationID);
    shaded[index] = own ? 1u : 0u;
}
