#version 460
//@ also O0: -O0

// Hillis and Steele's prefix sum of 0, 1, 2, ... over a workgroup larger than any batch.
layout(local_size_x = 256) in;
layout(set = 0, binding = 1, std430) buffer Outputs { uint sums[]; };

shared uint values[256];

void main() {
    uint at = gl_LocalInvocationIndex;
    values[at] = at + gl_WorkGroupID.x;
    barrier();
    for (uint reach = 1; reach < 256; reach *= 2) {
        uint below = at >= reach ? values[at - reach] : 0;
        barrier();
        values[at] += below;
        barrier();
    }
    sums[gl_GlobalInvocationID.x] = values[at];
}
