#version 460
//@ flags: -g

// Normal maps of two channels: z is what is left of the length 1, and the normal is turned to the
// tangent frame of a wall.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Normals { vec4 normals[]; };
layout(set = 0, binding = 2, std430) readonly buffer Texels { vec2 texels[]; };

const vec3 TANGENT = vec3(0.0, 0.0, -1.0);
const vec3 BITANGENT = vec3(0.0, 1.0, 0.0);
const vec3 NORMAL = vec3(1.0, 0.0, 0.0);

vec3 decode(vec2 texel) {
    vec2 xy = texel * 2.0 - 1.0;
    return vec3(xy, sqrt(1.0 - dot(xy, xy)));
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 local = decode(texels[index]);
    normals[index] = vec4(local.x * TANGENT + local.y * BITANGENT + local.z * NORMAL, 0.0);
}
