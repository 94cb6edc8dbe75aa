#version 460
//@ flags: -g

// Exposures of a bracketed series, four frames side by side in one launch, which lists them as they
// come.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) writeonly buffer Exposed { float exposed[]; };
layout(set = 0, binding = 2, std430) readonly buffer Radiances { float radiances[]; };
layout(set = 0, binding = 3, std430) buffer Count { uint count; };
layout(push_constant) uniform Frames { float exposures[4]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    uint frame = index / 2u;
    float exposure = exposures[frame];
    exposed[atomicAdd(count, 1u)] = radiances[index] * exposure;
}
