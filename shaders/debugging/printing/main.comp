#version 460
#extension GL_EXT_debug_printf : require
//@ flags: -gVS

// Each invocation of a workgroup prints.
layout(local_size_x = 4) in;
layout(set = 0, binding = 0, std430) buffer Outputs { uint results[]; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    results[at] = at * at;
    debugPrintfEXT("the square of %u is %u", at, results[at]);
}
