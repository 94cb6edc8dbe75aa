// Every builtin of a hit, as a hit shader sees it. Booleans are 0 or 1.
struct Builtins {
    uvec3 launch_id;
    uint hit_kind;
    uvec3 launch_size;
    uint ray_flags;
    vec3 world_origin;
    float t_min;
    vec3 world_direction;
    float t;
    vec3 object_origin;
    int primitive_id;
    vec3 object_direction;
    int instance_id;
    int custom_index;
    int geometry_index;
    uint cull_mask;
    uint runs;
    mat4x3 object_to_world; // 4 columns, stride 16
    mat4x3 world_to_object;
    vec2 attributes;
    uint is_sphere;
    uint is_lss;
    vec4 sphere; // position, radius
    vec4 lss[2]; // position, radius
    vec4 triangle[3];
};

// The outputs are two: of the closest hit, then of the last any-hit run.
layout(set = 0, binding = 1, std430) buffer Outputs { Builtins outputs[][2]; };

uint slot() {
    return gl_LaunchIDEXT.y * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x;
}

void record(uint which) {
    uint ray = slot();
    outputs[ray][which].launch_id = gl_LaunchIDEXT;
    outputs[ray][which].launch_size = gl_LaunchSizeEXT;
    outputs[ray][which].hit_kind = gl_HitKindEXT;
    outputs[ray][which].ray_flags = gl_IncomingRayFlagsEXT;
    outputs[ray][which].world_origin = gl_WorldRayOriginEXT;
    outputs[ray][which].world_direction = gl_WorldRayDirectionEXT;
    outputs[ray][which].object_origin = gl_ObjectRayOriginEXT;
    outputs[ray][which].object_direction = gl_ObjectRayDirectionEXT;
    outputs[ray][which].t_min = gl_RayTminEXT;
    outputs[ray][which].t = gl_RayTmaxEXT;
    outputs[ray][which].primitive_id = gl_PrimitiveID;
    outputs[ray][which].instance_id = gl_InstanceID;
    outputs[ray][which].custom_index = gl_InstanceCustomIndexEXT;
    outputs[ray][which].geometry_index = gl_GeometryIndexEXT;
    outputs[ray][which].cull_mask = gl_CullMaskEXT;
    outputs[ray][which].runs += 1u;
    outputs[ray][which].object_to_world = gl_ObjectToWorldEXT;
    outputs[ray][which].world_to_object = gl_WorldToObjectEXT;
}

void record_sphere(uint which) {
    uint ray = slot();
    outputs[ray][which].is_sphere = gl_HitIsSphereNV ? 1u : 0u;
    outputs[ray][which].sphere = vec4(gl_HitSpherePositionNV, gl_HitSphereRadiusNV);
}

void record_lss(uint which) {
    uint ray = slot();
    outputs[ray][which].is_lss = gl_HitIsLSSNV ? 1u : 0u;
    for (int end = 0; end < 2; ++end) {
        outputs[ray][which].lss[end] = vec4(gl_HitLSSPositionsNV[end], gl_HitLSSRadiiNV[end]);
    }
}

void record_triangle(uint which) {
    uint ray = slot();
    outputs[ray][which].is_sphere = gl_HitIsSphereNV ? 1u : 0u;
    outputs[ray][which].is_lss = gl_HitIsLSSNV ? 1u : 0u;
    for (int corner = 0; corner < 3; ++corner) {
        outputs[ray][which].triangle[corner] = vec4(gl_HitTriangleVertexPositionsEXT[corner], 1.0);
    }
}
