#version 460
//@ flags: -g

// Frustum culling: which instances are drawn, and whether the pass has to run at all.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) buffer Visible { uint any_visible; uint visible[]; };
layout(set = 0, binding = 2, std430) readonly buffer Instances { vec4 spheres[]; };
layout(set = 0, binding = 3, std430) readonly buffer Frustum { vec4 planes[2]; };

void main() {
    uint instance = gl_GlobalInvocationID.x;
    vec4 sphere = spheres[instance];
    bool inside = true;
    for (uint side = 0; side < planes.length(); ++side) {
        inside = inside && dot(planes[side], vec4(sphere.xyz, 1.0)) > -sphere.w;
    }
    visible[instance] = uint(inside);
    if (inside) {
        any_visible = 1;
    }
}
