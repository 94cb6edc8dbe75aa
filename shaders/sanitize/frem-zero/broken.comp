#version 460
//@ flags: -g

// Clips of an animation: where in its clip each one stands, and which frame that is.

layout(local_size_x = 4) in;

struct Clip {
    float seconds; // 0 for a still
    float rate; // frames a second
    float start;
    float speed;
};

layout(set = 0, binding = 1, std430) writeonly buffer Frames { float frames[]; };
layout(set = 0, binding = 2, std430) readonly buffer Clips { float time; float padding[3]; Clip clips[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    Clip clip = clips[index];
    float played = max(time - clip.start, 0.0) * clip.speed;
    float phase = mod(played, clip.seconds);
    frames[index] = floor(phase * clip.rate);
}
