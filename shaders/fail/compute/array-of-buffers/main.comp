#version 460
#extension GL_EXT_nonuniform_qualifier : require
//@ flags: -g

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[]; } buffers[];

void main() {
    uint at = gl_GlobalInvocationID.x;
    buffers[nonuniformEXT(at / 2)].outputs[at] = at;
}
