enable wgpu_ray_tracing_pipeline;
enable primitive_index;

struct Payload {
    normal: vec3f,
    t: f32,
}

@group(0) @binding(0) var<storage, read> corners: array<array<vec4f, 3>>;

var<incoming_ray_payload> payload: Payload;

@closest_hit @incoming_payload(payload)
fn shade(
    @builtin(primitive_index) primitive: u32,
    @builtin(world_ray_direction) direction: vec3f,
    @builtin(ray_t_current_max) t: f32,
) {
    let a = corners[primitive][0].xyz;
    let across = cross(corners[primitive][1].xyz - a, corners[primitive][2].xyz - a);
    // Towards the viewer, whichever side is met.
    payload.normal = normalize(across) * -sign(dot(across, direction));
    payload.t = t;
}
