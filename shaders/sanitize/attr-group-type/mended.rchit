#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// Metal balls: the sky in the direction of the mirrored ray.

layout(location = 0) rayPayloadInEXT vec3 color;
hitAttributeEXT vec4 normal_and_depth;

vec3 sky(vec3 direction) {
    return mix(vec3(0.5), vec3(0.25, 0.5, 1.0), 0.5 + 0.5 * direction.y);
}

void main() {
    vec3 mirrored = reflect(gl_WorldRayDirectionEXT, normal_and_depth.xyz);
    color = 0.75 * sky(mirrored);
}
