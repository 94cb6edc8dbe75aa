#version 460
//@ flags: -g

// Brightens a picture of 8 bits a channel.

layout(local_size_x = 4, local_size_y = 2) in;

layout(set = 0, binding = 1, rgba8) readonly uniform image2D picture;
layout(set = 0, binding = 2, rgba8) writeonly uniform image2D brightened;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    vec4 color = imageLoad(picture, pixel);
    imageStore(brightened, pixel, vec4(color.rgb * 1.5, 1.0));
}
