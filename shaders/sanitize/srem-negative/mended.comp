#version 460
//@ flags: -g

// Cells of the world in a cache of 8 x 4 tiles that repeats in both directions.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Slots { uint slots[]; };
layout(set = 0, binding = 2, std430) readonly buffer Cells { ivec2 cells[]; };

const ivec2 TILES = ivec2(8, 4);

uint slot_of(ivec2 cell) {
    ivec2 tile = cell & (TILES - 1);
    return uint(tile.y * TILES.x + tile.x);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    slots[index] = slot_of(cells[index]);
}
