//@ also g: -g
enable wgpu_ray_tracing_pipeline;
enable primitive_index;

// Triangles shaded in WGSL. naga gives hit shaders no attributes: the barycentrics come from the
// hit point and the corners, which stand in a buffer. Nor can an any-hit shader ignore a hit: it
// leaves its mark in the payload.

struct Payload {
    barycentrics: vec2f,
    t: f32,
    any_hits: u32,
    normal: vec3f,
    primitive: i32,
    position: vec3f,
    kind: u32,
}

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read_write> outputs: array<Payload>;
@group(0) @binding(2) var<storage, read> corners: array<array<vec4f, 3>>;

var<ray_payload> payload: Payload;
var<incoming_ray_payload> incoming: Payload;

@ray_generation
fn raygen(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {
    let at = (vec2f(id.xy) + 0.5) / vec2f(size.xy) * 2.0 - 1.0;
    payload = Payload();
    payload.primitive = -2;
    let ray = RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 100.0, vec3f(at, 4.0), vec3f(0.0, 0.0, -1.0));
    traceRay(scene, ray, &payload);
    outputs[id.y * size.x + id.x] = payload;
}

@any_hit @incoming_payload(incoming)
fn count() {
    incoming.any_hits += 1u;
}

@closest_hit @incoming_payload(incoming)
fn shade(
    @builtin(primitive_index) primitive: u32,
    @builtin(object_ray_origin) origin: vec3f,
    @builtin(object_ray_direction) direction: vec3f,
    @builtin(ray_t_current_max) t: f32,
    @builtin(object_to_world) to_world: mat4x3f,
    @builtin(world_to_object) to_object: mat4x3f,
    @builtin(hit_kind) kind: u32,
) {
    let a = corners[primitive][0].xyz;
    let edge1 = corners[primitive][1].xyz - a;
    let edge2 = corners[primitive][2].xyz - a;
    let across = cross(edge1, edge2);
    let hit = origin + t * direction;
    let inside = hit - a;
    // Cramer's rule in the triangle's plane.
    let area = dot(across, across);
    let u = dot(cross(inside, edge2), across) / area;
    let v = dot(cross(edge1, inside), across) / area;
    incoming.barycentrics = vec2f(u, v);
    incoming.t = t;
    incoming.normal = normalize((across * to_object).xyz);
    incoming.primitive = i32(primitive);
    incoming.position = to_world * vec4f(hit, 1.0);
    incoming.kind = kind;
}

@miss @incoming_payload(incoming)
fn sky(@builtin(ray_t_current_max) t_max: f32) {
    incoming.primitive = -1;
    incoming.t = t_max;
}
