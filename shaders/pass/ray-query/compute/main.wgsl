enable wgpu_ray_query;

// A ray for each invocation; the hits of a workgroup are counted together.

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read_write> hits: array<u32>;

var<workgroup> total: atomic<u32>;

@compute @workgroup_size(16, 4)
fn main(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3u,
) {
    if (local == 0u) {
        atomicStore(&total, 0u);
    }
    workgroupBarrier();
    var query: ray_query;
    let origin = vec3f(vec2f(id.xy) + 0.5, 4.0);
    rayQueryInitialize(&query, scene, RayDesc(RAY_FLAG_FORCE_OPAQUE, 0xFFu, 0.0, 100.0, origin, vec3f(0.0, 0.0, -1.0)));
    while (rayQueryProceed(&query)) {}
    let hit = rayQueryGetCommittedIntersection(&query);
    if (hit.kind == RAY_QUERY_INTERSECTION_TRIANGLE && hit.t == 4.0) {
        atomicAdd(&total, 1u);
    }
    workgroupBarrier();
    if (local == 0u) {
        hits[2u + group.y] = atomicLoad(&total);
    }
}
