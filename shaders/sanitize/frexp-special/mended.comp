#version 460
//@ flags: -g

// Radiance to 32 bits: three mantissas of 8 bits with one exponent (RGBE).

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Texels { uint texels[]; };
layout(set = 0, binding = 2, std430) readonly buffer Radiance { vec4 radiance[]; };

uint encode(vec3 color) {
    float largest = max(color.r, max(color.g, color.b));
    if (largest < 1e-32) {
        return 0u;
    }
    int exponent;
    float mantissa = frexp(largest, exponent);
    vec3 scaled = color * (mantissa * 256.0 / largest);
    uvec3 bytes = uvec3(clamp(scaled, 0.0, 255.0));
    return bytes.r | bytes.g << 8 | bytes.b << 16 | uint(clamp(exponent + 128, 0, 255)) << 24;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    texels[index] = encode(min(radiance[index].rgb, vec3(1e30)));
}
