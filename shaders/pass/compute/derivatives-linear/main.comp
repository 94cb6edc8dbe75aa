#version 460
#extension GL_NV_compute_shader_derivatives : require

// Quads of four invocations that follow each other.
layout(local_size_x = 8) in;
layout(derivative_group_linearNV) in;
layout(set = 0, binding = 1, std430) buffer Outputs { vec4 outputs[8][2]; };

void main() {
    uint i = gl_LocalInvocationIndex;
    float square = float(i * i);
    float plane = float(3 * (i & 1) + 5 * (i >> 1 & 1));
    outputs[i][0] = vec4(dFdx(square), dFdy(square), dFdyFine(square), dFdxFine(square));
    outputs[i][1] = vec4(dFdxCoarse(plane), dFdyCoarse(plane), fwidthCoarse(-plane), fwidthFine(plane));
}
