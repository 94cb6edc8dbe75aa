#version 460
#extension GL_EXT_buffer_reference : require
//@ flags: -g

// Moves particles by their velocity, and bounces those that have reached the floor.

struct Particle {
    vec2 position;
    vec2 velocity;
};

layout(local_size_x = 4) in;
layout(buffer_reference, std430) buffer Moved { Particle all[]; };
layout(push_constant) uniform Constants { Moved moved; };
layout(set = 0, binding = 1, std430) buffer Particles { Particle particles[]; };

const float STEP = 0.125;

void main() {
    uint id = gl_GlobalInvocationID.x;
    moved.all[id].velocity.y -= 9.8125 * STEP;
    Particle particle = particles[id];
    particle.position += particle.velocity * STEP;
    if (particle.position.y < 0.0) {
        particle.velocity.y = -particle.velocity.y;
    }
    moved.all[id] = particle;
}
