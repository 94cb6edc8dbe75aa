#version 460
//@ flags: -g

// Stream compaction: the pixels whose paths go on. The next pass runs over `count` of them.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) buffer Queue { uint count; uint pixels[]; };
layout(set = 0, binding = 2, std430) readonly buffer Paths { float throughput[]; };

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    if (throughput[pixel] > 0.125) {
        uint slot = atomicAdd(count, 1u);
        if (slot < pixels.length()) {
            pixels[slot] = pixel;
        }
    }
}
