#version 460
//@ flags: -g

// Layers of a picture with premultiplied alpha: back to plain colours, for a paint program.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Plain { vec4 plain[]; };
layout(set = 0, binding = 2, std430) readonly buffer Layer { vec4 layer[]; };

vec4 divided(vec4 pixel) {
    float scale = pixel.a > 0.0 ? 1.0 / pixel.a : 0.0;
    return vec4(pixel.rgb * scale, pixel.a);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec4 color = divided(layer[index]);
    plain[index] = color;
}
