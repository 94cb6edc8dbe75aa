enable wgpu_ray_tracing_pipeline;
enable primitive_index;

// Triangles whose corners stand in a buffer: naga's WGSL gives hit shaders no positions.

struct Payload {
    normal: vec3f,
    t: f32,
}

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read_write> outputs: array<Payload>;
@group(0) @binding(2) var<storage, read> corners: array<array<vec4f, 3>>;

var<ray_payload> payload: Payload;
var<incoming_ray_payload> incoming: Payload;

@ray_generation
fn look(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {
    let at = (vec2f(id.xy) + 0.5) / vec2f(size.xy) * 2.0 - 1.0;
    payload = Payload(vec3f(0.0), 0.0);
    traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 100.0, vec3f(at, 4.0), vec3f(0.0, 0.0, -1.0)), &payload);
    outputs[id.y * size.x + id.x] = payload;
}

@closest_hit @incoming_payload(incoming)
fn shade(
    @builtin(primitive_index) primitive: u32,
    @builtin(world_to_object) to_object: mat4x3f,
    @builtin(world_ray_direction) direction: vec3f,
    @builtin(ray_t_current_max) t: f32,
) {
    let a = corners[primitive][0].xyz;
    let across = cross(corners[primitive][1].xyz - a, corners[primitive][2].xyz - a);
    let normal = normalize((across * to_object).xyz);
    // Towards the viewer, whichever side is met.
    incoming.normal = select(normal, -normal, dot(normal, direction) > 0.0);
    incoming.t = t;
}

@miss @incoming_payload(incoming)
fn sky() {
    incoming.t = -1.0;
}
