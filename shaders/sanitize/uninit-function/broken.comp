#version 460
//@ flags: -g

// The lamp that each cell of a light grid takes for its brightest: the nearest one that reaches it.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Chosen { uint chosen[]; };
layout(set = 0, binding = 2, std430) readonly buffer Cells { vec4 cells[]; };
layout(set = 0, binding = 3, std430) readonly buffer Lamps { vec4 lamps[]; }; // position, reach

uint nearest_lamp(vec3 cell) {
    uint found;
    float least = 1e30;
    for (uint lamp = 0u; lamp < uint(lamps.length()); ++lamp) {
        float range = distance(cell, lamps[lamp].xyz);
        if (range < lamps[lamp].w && range < least) {
            least = range;
            found = lamp;
        }
    }
    return found;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    chosen[index] = nearest_lamp(cells[index].xyz);
}
