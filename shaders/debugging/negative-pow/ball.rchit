#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -gVS

layout(location = 0) rayPayloadInEXT vec3 colour;

const vec3 LAMP = vec3(0.0, 3.0, -3.0);
const float SHININESS = 3.5;

float highlight(vec3 normal, vec3 to_lamp) {
    vec3 mirrored = reflect(gl_WorldRayDirectionEXT, normal);
    return pow(dot(mirrored, to_lamp), SHININESS);
}

void main() {
    vec3 hit = gl_WorldRayOriginEXT + gl_HitTEXT * gl_WorldRayDirectionEXT;
    vec3 normal = normalize(hit);
    vec3 to_lamp = normalize(LAMP - hit);
    vec3 lit = vec3(1.0, 0.5, 0.25) * max(dot(normal, to_lamp), 0.0);
    colour = lit + highlight(normal, to_lamp);
}
