#version 460
//@ flags: -g

// Half of the workgroup waits at one barrier, half at another.
layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[]; };

void main() {
    uint at = gl_LocalInvocationIndex;
    if (at >= 5) {
        outputs[at] = 1;
        barrier();
    } else {
        outputs[at] = 2;
        barrier();
    }
    outputs[at] = 3;
}
