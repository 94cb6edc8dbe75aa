#version 460

// One texture, sampled with and without a comparison: glslang declares two image types for it, which
// differ in Depth alone.

layout(local_size_x = 1) in;

layout(set = 0, binding = 0) uniform texture2D depths;
layout(set = 0, binding = 1) uniform sampler plain;
layout(set = 0, binding = 2) uniform samplerShadow comparing;
layout(set = 0, binding = 3, std430) buffer Outputs { float outputs[2]; };

void main() {
    outputs[0] = textureLod(sampler2DShadow(depths, comparing), vec3(0.5, 0.5, 0.25), 0.0);
    outputs[1] = textureLod(sampler2D(depths, plain), vec2(0.5), 0.0).r;
}
