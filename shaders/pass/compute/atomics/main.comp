#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require

// A histogram in workgroup memory whose sums go to a buffer, and a ticket that each takes.
layout(local_size_x = 48) in;
layout(set = 0, binding = 1, std430) buffer Outputs {
    uint64_t total;
    uint histogram[4];
    uint tickets[96];
};

shared uint bins[4];
shared uint64_t sum;
shared uint next;

void main() {
    uint at = gl_LocalInvocationIndex;
    atomicAdd(bins[at % 3], 1u);
    atomicAdd(sum, uint64_t(at) << 32);
    tickets[gl_GlobalInvocationID.x] = atomicAdd(next, 1u);
    barrier();
    if (at < 4) {
        atomicAdd(histogram[at], bins[at]);
    }
    if (at == 0) {
        atomicAdd(total, sum);
    }
}
