#version 460
//@ flags: -g

// Whether a lamp sees a point: the depth in its map is not less than that of the point.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Colors { vec4 colors[]; };
layout(set = 0, binding = 2, std430) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 3) uniform sampler2D shadow_map;

float lit(vec3 point) {
    return textureLod(shadow_map, point.xy, 0.0).r >= point.z ? 1.0 : 0.0;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    colors[index] = vec4(lit(points[index].xyz));
}
