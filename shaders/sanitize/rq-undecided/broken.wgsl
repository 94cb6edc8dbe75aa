enable wgpu_ray_query;

// How deep the water is under each boat: the bed is opaque, the weeds on it are not.

@group(0) @binding(0) var bed: acceleration_structure;
@group(0) @binding(1) var<storage, read_write> depths: array<f32>;

@compute @workgroup_size(4)
fn main(@builtin(global_invocation_id) id: vec3u) {
    var query: ray_query;
    let boat = vec3f(f32(id.x), 0.0, 0.0);
    rayQueryInitialize(&query, bed, RayDesc(0u, 0xffu, 0.0, 99.0, boat, vec3f(0.0, 0.0, -1.0)));
    while (rayQueryProceed(&query)) {
    }
    let hit = rayQueryGetCommittedIntersection(&query);
    var depth = -1.0;
    if (hit.kind != RAY_QUERY_INTERSECTION_NONE) {
        depth = hit.t;
    }
    depths[id.x] = depth;
}
