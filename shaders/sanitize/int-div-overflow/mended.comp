#version 460
//@ flags: -g

// Edges of a software rasterizer: how far x moves from one line to the next, in 16.16 fixed point.

layout(local_size_x = 4) in;

struct Edge {
    int width; // 16.16; the least integer where the edge is clipped at the left
    int lines; // negative if the edge runs upwards
};

layout(set = 0, binding = 1, std430) writeonly buffer Slopes { int slopes[]; };
layout(set = 0, binding = 2, std430) readonly buffer Edges { Edge edges[]; };

const int CLIPPED = -2147483647 - 1;

void main() {
    uint index = gl_GlobalInvocationID.x;
    Edge edge = edges[index];
    int slope = 0;
    if (edge.lines != 0 && edge.width != CLIPPED) {
        slope = edge.width / edge.lines;
    }
    slopes[index] = slope;
}
