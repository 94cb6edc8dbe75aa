#version 460
//@ flags: -g

// Culling of boxes by the ray through the middle of a light's beam: the test by slabs.

layout(local_size_x = 4) in;

struct Box {
    vec4 least;
    vec4 most;
};

layout(set = 0, binding = 1, std430) writeonly buffer Lit { uint lit[]; };
layout(set = 0, binding = 2, std430) readonly buffer Beam { vec4 origin; vec4 direction; Box boxes[]; };

bool meets(Box box) {
    // Finite, as 0 times infinity is no number.
    vec3 inverse = 1.0 / mix(direction.xyz, vec3(1e-30), equal(direction.xyz, vec3(0.0)));
    vec3 a = (box.least.xyz - origin.xyz) * inverse;
    vec3 b = (box.most.xyz - origin.xyz) * inverse;
    vec3 entry = min(a, b);
    vec3 exit = max(a, b);
    float first = max(max(entry.x, entry.y), max(entry.z, 0.0));
    return first <= min(exit.x, min(exit.y, exit.z));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    lit[index] = meets(boxes[index]) ? 1u : 0u;
}
