#version 460
#extension GL_NV_compute_shader_derivatives : require

// Derivatives over quads of two by two invocations, and a texture whose level they choose.
layout(local_size_x = 4, local_size_y = 4) in;
layout(derivative_group_quadsNV) in;
layout(set = 0, binding = 1, std430) buffer Outputs { vec4 outputs[16][2]; };
layout(set = 0, binding = 2) uniform sampler2D levels;

void main() {
    uvec2 at = gl_LocalInvocationID.xy;
    float value = float(at.x * at.x + 10 * at.y * at.y);
    outputs[gl_LocalInvocationIndex][0] = vec4(dFdx(value), dFdy(value), fwidth(value), dFdxFine(-value));
    vec2 place = vec2(at) + 0.5;
    float scale = at.y < 2 ? 0.125 : 0.25;
    outputs[gl_LocalInvocationIndex][1] = vec4(texture(levels, place * scale).r, dFdy(place), 0);
}
