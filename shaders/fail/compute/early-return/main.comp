#version 460
//@ flags: -g

// The classic mistake: what is beyond the end of the data returns in front of the barrier.
layout(local_size_x = 64) in;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[]; };

shared uint values[64];

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= outputs.length()) {
        return;
    }
    values[gl_LocalInvocationIndex] = at;
    barrier();
    outputs[at] = values[gl_LocalInvocationIndex ^ 1];
}
