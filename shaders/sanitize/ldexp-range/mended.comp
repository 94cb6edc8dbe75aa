#version 460
//@ flags: -g

// Exposure in whole stops: the colour of each camera's test patch times a power of two.

layout(local_size_x = 4) in;

struct Patch {
    vec3 color;
    int stops;
};

layout(set = 0, binding = 1, std430) writeonly buffer Exposed { vec4 exposed[]; };
layout(set = 0, binding = 2, std430) readonly buffer Patches { Patch patches[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    Patch one = patches[index];
    vec3 color = ldexp(one.color, ivec3(clamp(one.stops, -126, 127)));
    exposed[index] = vec4(min(color, vec3(65504.0)), 1.0);
}
