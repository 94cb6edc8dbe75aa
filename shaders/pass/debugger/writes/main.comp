#version 460
//@ flags: -gVS

// Writes of parts: through an index that only the run knows, of whole vectors, of copies.

layout(local_size_x = 1) in;

layout(set = 0, binding = 0, std430) buffer Outputs {
    uint begin;
    float outputs[4];
};

struct Sample {
    vec3 colour;
    float weight;
    float depth;
};

void main() {
    float array[3];
    vec4 vector = vec4(0.0);
    mat2 matrix = mat2(0.0);
    uint i = begin + 1;
    array[i] = 5.0;
    vector[i] = 6.0;
    matrix[i][0] = 7.0;
    vec3 sum;
    sum = vec3(1.0, 2.0, 3.0) + array[i];
    Sample half_written;
    half_written.colour = sum;
    half_written.depth = 4.0;
    Sample copy = half_written;
    outputs[0] = array[1] + vector.y + matrix[1][0];
    outputs[1] = sum.x; outputs[2] = sum.z;
    outputs[3] = copy.depth;
}
