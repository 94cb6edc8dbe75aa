#version 460
#extension GL_EXT_ray_query : require
//@ flags: -g

// Rays down at the edge of a floor, from an origin that cancels: far + near - far.

layout(local_size_x = 4) in;
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Outputs { uint hits[4]; float twice[4]; };
layout(set = 0, binding = 2, std430) readonly buffer Inputs { float far; float near[4]; };

const vec3 DOWN = vec3(0.0, 0.0, -1.0);

void main() {
    uint self = gl_LocalInvocationIndex;
    float x = (far + near[self]) - far;
    rayQueryEXT query;
    if (self < 2u) {
        rayQueryInitializeEXT(query, scene, gl_RayFlagsOpaqueEXT, 0xFFu, vec3(x, 0.0, 1.0), 0.0, DOWN, 2.0);
        rayQueryProceedEXT(query);
    } else {
        rayQueryInitializeEXT(query, scene, gl_RayFlagsNoOpaqueEXT, 0xFFu, vec3(x, 0.0, 1.0), 0.0, DOWN, 2.0);
        while (rayQueryProceedEXT(query)) {
            if (self == 2u) {
                rayQueryConfirmIntersectionEXT(query);
            }
        }
    }
    twice[self] = 2.0 * rayQueryGetWorldRayOriginEXT(query).x;
    hits[self] = rayQueryGetIntersectionTypeEXT(query, true);
}
