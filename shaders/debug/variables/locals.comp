#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_shader_explicit_arithmetic_types : require
//@ also gVS: -gVS
//@ also g: -g

// Variables of each kind for the debugger's tests, which stop at the lines with a letter.

layout(local_size_x = 1) in;
layout(constant_id = 3) const int samples = 5;

struct Material {
    vec3 colour;
    float rough;
    mat2x3 frame;
    uint ids[3];
};

layout(buffer_reference, std430) buffer Node;
layout(buffer_reference, std430) buffer Node {
    vec4 value;
    Node next;
};

layout(binding = 0, std430) buffer Block {
    Material materials[2];
    float items[];
};

layout(push_constant) uniform Constants {
    Node head;
    uint count;
} constants;

shared vec2 kept[2];

float helper(float a, inout vec3 v) {
    float local = a * 2.0;
    {
        float local = v.x + 4.0;
        v.y += local; // A
    }
    return local + v.z; // B
}

void main() {
    uint index = gl_LocalInvocationIndex;
    vec3 normal = vec3(1.0, 2.0, 3.0);
    float16_t small = float16_t(0.5);
    int64_t large = -5000000000L;
    double wide = 0.25LF;
    Material material = materials[1];
    material.rough = 4.0;
    for (int i = 0; i < 3; ++i) {
        uint twice = uint(i) * 2u;
        material.ids[i] = twice; // C
    }
    float result = helper(normal.x, normal);
    Node second = constants.head.next;
    kept[1] = vec2(result, normal.y);
    items[index] = result + second.value.y + float(small) + float(large) + float(wide) + float(samples); // D
    float late = items[1];
    materials[0] = material; // E
    materials[0].rough = late;
}
