#version 460
//@ flags: -g

// The highlight of a lamp: by the angle between the normal and the half vector.

layout(local_size_x = 8) in;

layout(set = 0, binding = 1, std430) readonly buffer Cosines { float cosines[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Highlights { float highlights[]; };

const float SHININESS = 3.0;

void main() {
    float cosine = cosines[gl_GlobalInvocationID.x];
    float highlight = pow(cosine, SHININESS);
    highlights[gl_GlobalInvocationID.x] = clamp(highlight, 0.0, 1.0);
}
