#version 460
#extension GL_KHR_shader_subgroup_quad : require
//@ flags: -g

// The slope of a height field in x, from the two lanes of a quad's row. Lakes are flat.

layout(local_size_x = 8) in;
layout(set = 0, binding = 1, std430) writeonly buffer Slopes { float slopes[]; };
layout(set = 0, binding = 2, std430) readonly buffer Heights { float heights[]; };

void main() {
    uint index = gl_GlobalInvocationID.x;
    float height = heights[index];
    float slope = 0.0;
    float beside = subgroupQuadSwapHorizontal(height);
    if (height > 0.0) {
        slope = (index & 1u) == 0u ? beside - height : height - beside;
    }
    slopes[index] = slope;
}
