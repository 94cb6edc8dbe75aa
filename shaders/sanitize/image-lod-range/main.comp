#version 460
//@ flags: -g

// Light of the sky from some directions, blurred by the roughness of a surface.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 2, std430) readonly buffer Directions { vec2 directions[]; };
layout(set = 0, binding = 3) uniform sampler2D sky;

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec2 place = directions[index];
    colors[index] = textureLod(sky, place, 2.0 * place.x);
}
