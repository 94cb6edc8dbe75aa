#version 460
//@ flags: -g

// Probes of indirect light: sums of radiance, with the number of samples, become means.

layout(local_size_x = 4) in;
layout(set = 0, binding = 1, std430) writeonly buffer Means { vec4 means[]; };
layout(set = 0, binding = 2, std430) readonly buffer Sums { vec4 sums[]; };

vec3 mean(vec3 sum, float samples) {
    return sum / max(samples, 1.0);
}

void main() {
    uint probe = gl_GlobalInvocationID.x;
    vec4 sum = sums[probe];
    vec3 irradiance = mean(sum.rgb, sum.w);
    means[probe] = vec4(irradiance, sum.w);
}
