#version 460
#extension GL_EXT_nonuniform_qualifier : require

// An array of images with one sampler for each, as renderers have them.
layout(local_size_x = 64) in;
layout(set = 0, binding = 1, std430) buffer Outputs { vec4 outputs[]; };
layout(set = 0, binding = 6) uniform sampler2D textures[];
layout(set = 0, binding = 7) uniform texture2D images[2];
layout(set = 0, binding = 8) uniform sampler samplers[2];

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at < 3) {
        // Two texels beside each other, at a quarter and at the border between them.
        outputs[2 * at] = textureLod(textures[nonuniformEXT(at)], vec2(0.25, 0.5), 0.0);
        outputs[2 * at + 1] = textureLod(textures[nonuniformEXT(at)], vec2(0.5, 0.5), 0.0);
    } else if (at < 5) {
        uint own = at - 3;
        outputs[2 * at] = textureLod(
            sampler2D(images[nonuniformEXT(own)], samplers[nonuniformEXT(1 - own)]), vec2(1.25, 0.5), 0.0);
    }
}
