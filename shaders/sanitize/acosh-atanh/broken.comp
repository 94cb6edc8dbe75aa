#version 460
//@ flags: -g

// Directions on a map of the sky in Mercator's projection, cut off at 85 degrees.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Places { vec2 places[]; };
layout(set = 0, binding = 2, std430) readonly buffer Directions { vec4 directions[]; };

const float PI = 3.14159265;
const float LIMIT = 3.1313; // atanh(sin(85 degrees))

vec2 mercator(vec3 direction) {
    float longitude = direction.xz == vec2(0.0) ? 0.0 : atan(direction.z, direction.x);
    float height = atanh(direction.y);
    return vec2(longitude / PI, clamp(height, -LIMIT, LIMIT) / LIMIT);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    places[index] = mercator(directions[index].xyz);
}
