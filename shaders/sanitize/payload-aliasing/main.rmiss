#version 460
#extension GL_EXT_ray_tracing : require
//@ flags: -g

// The sky, also behind shadow rays: their visibility is the alpha.

layout(location = 0) rayPayloadInEXT vec4 radiance;

void main() {
    radiance = vec4(0.5, 0.75, 1.0, 1.0);
}
