#version 460
//@ flags: -g

// Clears a picture whose sides are no multiples of those of a workgroup.

layout(local_size_x = 4, local_size_y = 2) in;

layout(set = 0, binding = 1, rgba8) writeonly uniform image2D picture;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(picture)))) return;
    imageStore(picture, pixel, vec4(0.0, 0.25, 0.5, 1.0));
}
