#version 460
//@ flags: -g

// Collects the instances whose bounding sphere is in front of the camera.

layout(local_size_x = 8) in;

layout(set = 0, binding = 1, std430) buffer Count { uint visible_count; };
layout(set = 0, binding = 2, std430) writeonly buffer Visible { uint visible[]; };
layout(set = 0, binding = 3, std430) readonly buffer Spheres { vec4 spheres[]; };

void main() {
    uint instance = gl_GlobalInvocationID.x;
    vec4 sphere = spheres[instance];
    if (sphere.z - sphere.w < 0.0) {
        uint slot = atomicAdd(visible_count, 1u);
        visible[slot] = instance;
    }
}
