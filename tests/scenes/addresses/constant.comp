#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
layout(local_size_x = 1) in;
layout(constant_id = 3) const uint64_t MATERIALS = 0;
const uint COUNT = uint(MATERIALS >> 32) + 1;
layout(buffer_reference, std430, buffer_reference_align = 4) buffer Material { uint value; };
layout(set = 0, binding = 0, std430) buffer Outputs { uint found; uint lengths[COUNT]; } outputs;
layout(set = 0, binding = 1, std430) buffer Plain { uint found; } plain;
void main() {
    plain.found = Material(MATERIALS).value;
    outputs.lengths[COUNT - 1] = COUNT;
}
