enable wgpu_ray_tracing_pipeline;
enable wgpu_ray_query;

// A triangle and a box through WGSL's ray queries: what is shown first, and what is committed.

struct Seen {
    kind: u32,
    t: f32,
    instance_custom_data: u32,
    instance_index: u32,
    sbt_record_offset: u32,
    geometry_index: u32,
    primitive_index: u32,
    front_face: u32,
    barycentrics: vec2f,
    origin: vec2f,
}

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read_write> outputs: array<Seen>;

fn record(seen: RayIntersection) -> Seen {
    let origin = seen.world_to_object * vec4f(0.0, 0.0, 0.0, 1.0);
    return Seen(
        seen.kind, seen.t, seen.instance_custom_data, seen.instance_index, seen.sbt_record_offset, seen.geometry_index,
        seen.primitive_index, u32(seen.front_face), seen.barycentrics, origin.xy,
    );
}

@ray_generation
fn raygen(@builtin(ray_invocation_id) id: vec3u) {
    var query: ray_query;
    let origin = vec3f(0.25 + 4.0 * f32(id.x), 0.125, 4.0);
    rayQueryInitialize(&query, scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 100.0, origin, vec3f(0.0, 0.0, -1.0)));
    var first = true;
    while (rayQueryProceed(&query)) {
        let candidate = rayQueryGetCandidateIntersection(&query);
        if (first) {
            outputs[2 * id.x] = record(candidate);
        }
        first = false;
        if (candidate.kind == RAY_QUERY_INTERSECTION_AABB) {
            rayQueryGenerateIntersection(&query, 4.5);
        } else {
            rayQueryConfirmIntersection(&query);
        }
    }
    outputs[2 * id.x + 1] = record(rayQueryGetCommittedIntersection(&query));
}
