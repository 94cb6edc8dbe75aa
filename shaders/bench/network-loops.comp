#version 460
#extension GL_EXT_shader_explicit_arithmetic_types : require

// What network.comp computes, as loops over scalars.

layout(local_size_x = 64) in;
layout(binding = 1) writeonly buffer Outputs {
    float16_t outputs[];
};
layout(binding = 2) readonly buffer Weights {
    float16_t weights[];
};
layout(binding = 3) readonly buffer Inputs {
    float16_t inputs[];
};

const uint WIDTH = 64;
const uint MATRIX = WIDTH * WIDTH;

void main() {
    uint at = gl_GlobalInvocationID.x * WIDTH;
    float16_t x[WIDTH];
    for (uint component = 0; component < WIDTH; component++) {
        x[component] = inputs[at + component];
    }
    for (uint layer = 0; layer < 3; layer++) {
        float16_t y[WIDTH];
        for (uint row = 0; row < WIDTH; row++) {
            float sum = 0;
            for (uint column = 0; column < WIDTH; column++) {
                sum += float(weights[layer * MATRIX + row * WIDTH + column]) * float(x[column]);
            }
            y[row] = max(float16_t(sum + float(weights[3 * MATRIX + layer * WIDTH + row])), float16_t(0));
        }
        x = y;
    }
    for (uint component = 0; component < WIDTH; component++) {
        outputs[at + component] = x[component];
    }
}
