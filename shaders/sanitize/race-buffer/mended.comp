#version 460
//@ flags: -g

// Clustered shading: how many lights each of the clusters along the view direction has.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) buffer Clusters { uint light_count[]; };
layout(set = 0, binding = 2, std430) readonly buffer Lights { vec4 lights[]; }; // center, radius

const float NEAR = 1.0;
const float CLUSTERS_PER_OCTAVE = 1.0;

uint cluster_of(float depth) {
    return uint(log2(max(depth, NEAR) / NEAR) * CLUSTERS_PER_OCTAVE);
}

void main() {
    vec4 light = lights[gl_GlobalInvocationID.x];
    float depth = -light.z;
    uint last = cluster_of(depth + light.w);
    for (uint cluster = cluster_of(depth - light.w); cluster <= last; ++cluster) {
        atomicAdd(light_count[cluster], 1);
    }
}
