#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_ray_query : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
layout(local_size_x = 1) in;
layout(buffer_reference) buffer Node;
layout(buffer_reference, std430, buffer_reference_align = 8) buffer Node { uint value; uint pad; Node next; };
layout(set = 0, binding = 0, std430) buffer Outputs { uint found[]; } outputs;
layout(push_constant) uniform Push { Node first; uint64_t tlas; } push;
void main() {
    Node node = push.first;
    for (uint i = 0; i < 5; ++i) {
        outputs.found[i] = node.value;
        node = node.next;
    }
    node.value = 77;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(push.tlas), gl_RayFlagsOpaqueEXT, 0xff, vec3(0.25, 0.25, 1), 0.0, vec3(0, 0, -1), 10.0);
    rayQueryProceedEXT(query);
    outputs.found[5] = rayQueryGetIntersectionTypeEXT(query, true);
}
