#version 460
#extension GL_EXT_ray_tracing : require

// Adds.

struct Sum { uint total; uint addend; };
layout(location = 0) rayPayloadInEXT Sum sum;

void main() {
    sum.total += sum.addend;
}
