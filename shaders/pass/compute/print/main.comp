#version 460
#extension GL_EXT_debug_printf : require

// Two of four invocations print, the others do not.
layout(local_size_x = 2) in;
layout(set = 0, binding = 1, std430) buffer Outputs { vec2 halves[]; };
layout(push_constant) uniform Constants { float scale; };

void main() {
    uint at = gl_GlobalInvocationID.x;
    halves[at] = vec2(at, scale) / 2.0;
    if ((at & 1u) == 1u) {
        debugPrintfEXT("invocation %u of %v2u: %v2f", at, gl_WorkGroupID.xy, halves[at]);
    }
}
