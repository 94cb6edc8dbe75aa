#version 460
//@ flags: -gVS
//@ also lines: -g

// Lines that begin with a call, a line that is nothing but a barrier, and parameters.

layout(local_size_x = 1) in;

layout(set = 0, binding = 0, std430) buffer Outputs {
    float outputs[3];
};

float total = 0.0;

float seven() {
    total += 1.0;
    return 7.0;
}

void bump() {
    total += 10.0;
}

float scaled(vec3 n, float by) {
    return n.y * by;
}

void main() {
    float a = 1.0;
    float b = seven();
    bump();
    memoryBarrierBuffer();
    outputs[0] = a + b + total;
    outputs[1] = scaled(vec3(1, 2, 3), 0.5);
    outputs[2] = scaled(vec3(4, 5, 6), 0.5);
}
