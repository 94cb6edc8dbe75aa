#version 460
#extension GL_EXT_null_initializer : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
//@ also O0: -O0

// Variables of many types in workgroup memory, written by one invocation, read by another.
layout(local_size_x = 40) in;
layout(set = 0, binding = 1, std430) buffer Outputs { double outputs[40][8]; };

struct Mixed {
    bool flag;
    uint8_t byte;
    i16vec3 shorts;
    double wide;
    mat2x3 matrix;
    uint64_t big;
};
shared Mixed mixed[40];
shared uint zeros[40] = {};
shared float16_t halves[2][40];
shared vec3 unwritten;

void main() {
    uint own = gl_LocalInvocationIndex;
    uint other = 39 - own;
    mixed[own].flag = (own & 1) == 1;
    mixed[own].byte = uint8_t(own + 250);
    mixed[own].shorts = i16vec3(-int(own), own, 3);
    mixed[own].wide = double(own) / 3.0LF;
    mixed[own].matrix = mat2x3(own, 1, 2, 3, 4, own * 2);
    mixed[own].big = uint64_t(own) << 40;
    halves[own & 1][own] = float16_t(own) * float16_t(0.5);
    barrier();
    mixed[other].matrix[1].z += 0.25;
    barrier();
    outputs[own][0] = mixed[other].flag ? 1.0 : 0.0;
    outputs[own][1] = double(uint(mixed[other].byte));
    outputs[own][2] = double(int(mixed[other].shorts.x));
    outputs[own][3] = mixed[other].wide;
    outputs[own][4] = mixed[other].matrix[1].z;
    outputs[own][5] = double(mixed[other].big);
    outputs[own][6] = double(float(halves[other & 1][other]));
    outputs[own][7] = double(zeros[other]) + double(unwritten.y);
}
