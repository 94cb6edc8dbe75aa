#version 460
//@ flags: -gVS

layout(local_size_x = 1) in;
layout(set = 0, binding = 0, std430) readonly buffer Rows { uvec2 rows[]; };
layout(set = 0, binding = 1, std430) writeonly buffer Result { float mean; float scale; };

// Means of three rows, of which two are empty.
void main() {
    uint total = 0u;
    for (uint row = 0u; row < 3u; row++) {
        uint sum = rows[row].x;
        uint count = rows[row].y;
        total += sum / count;
    }
    float weight;
    if (weight > 0.5) {
        total += 1u;
    }
    mean = float(rows[0].x) / float(rows[2].y);
    scale = log(float(rows[2].x) - 1.0) * float(total);
}
