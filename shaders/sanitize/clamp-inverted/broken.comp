#version 460
//@ flags: -g

// Which tiles of a screen of 40 x 24 a light touches, inside the scissor rectangle of its view.

layout(local_size_x = 4) in;

struct Light {
    ivec2 tile;  // the tile of its centre
    ivec2 first; // of the scissor rectangle
    ivec2 end;   // behind its last tile
    ivec2 reach;
};

layout(set = 0, binding = 1, std430) writeonly buffer Ranges { ivec4 ranges[]; };
layout(set = 0, binding = 2, std430) readonly buffer Lights { Light lights[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    Light light = lights[index];
    ivec2 last = light.end - 1;
    ivec2 low = clamp(light.tile - light.reach, light.first, last);
    ivec2 high = clamp(light.tile + light.reach, light.first, last);
    ranges[index] = ivec4(low, high);
}
