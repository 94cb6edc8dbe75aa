#version 460
//@ flags: -g

// Dither before a picture is rounded to 8 bits: words of a noise table, as offsets of 0 to 1/2.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Levels { uint levels[]; };
layout(set = 0, binding = 2, std430) readonly buffer Noise { int noise[]; };
layout(set = 0, binding = 3, std430) readonly buffer Colors { float colors[]; };

float offset_of(int word) {
    return float(uint(word) & 0x7FFFFFFFu) * (0.5 / 2147483648.0);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    float level = colors[index] * 255.0 + offset_of(noise[index]);
    levels[index] = uint(clamp(level, 0.0, 255.0));
}
