#version 460
//@ flags: -g

// The row of a sprite in an atlas: its number divided by how many stand in a row.

layout(local_size_x = 4) in;

layout(set = 0, binding = 1, std430) readonly buffer Sprites { uint sprites[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Rows { uint rows[]; };

const uint COLUMNS = 41u;

void main() {
    uint sprite = sprites[gl_GlobalInvocationID.x];
    rows[gl_GlobalInvocationID.x] = uint(float(sprite) / float(COLUMNS));
}
