#version 460
#extension GL_EXT_ray_query : require
//@ flags: -gVS

layout(local_size_x = 4) in;

layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(set = 0, binding = 1, std430) buffer Outputs { float nearest[]; };

// The distance to the nearest box whose middle is not above a height.
void main() {
    uint index = gl_GlobalInvocationID.x;
    vec3 origin = vec3(float(index), 0.0, 5.0);
    float t = 100.0;
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, gl_RayFlagsNoneEXT, 0xFF, origin, 0.0, vec3(0.0, 0.0, -1.0), 100.0);
    while (rayQueryProceedEXT(query)) {
        int box = rayQueryGetIntersectionPrimitiveIndexEXT(query, false);
        float entry = box == 0 ? 2.0 : 4.0;
        if (box == 0) {
            continue;
        }
        t = min(t, entry);
        rayQueryGenerateIntersectionEXT(query, entry);
    }
    nearest[index] = t;
}
