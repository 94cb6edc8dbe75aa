#version 460
//@ flags: -g

// The cell of a grid of probes that is nearest to a point.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Cells { int cells[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { float points[]; };

int nearest_cell(float point) {
    return int(round(point));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    cells[index] = nearest_cell(points[index]);
}
