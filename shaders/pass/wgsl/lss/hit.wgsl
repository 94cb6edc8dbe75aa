enable wgpu_ray_tracing_pipeline;
enable primitive_index;

// Linear swept spheres in WGSL. naga knows neither their builtins nor their hit attribute: the
// segments stand in a buffer, and u is computed from the hit point.

struct Segment {
    position0: vec3f,
    radius0: f32,
    position1: vec3f,
    radius1: f32,
}

struct Payload {
    normal: vec3f,
    u: f32,
    t: f32,
    primitive: i32,
    any_hits: u32,
    last_any_hit_t: f32,
}

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read_write> outputs: array<Payload>;
@group(0) @binding(2) var<storage, read> segments: array<Segment>;

var<ray_payload> payload: Payload;
var<incoming_ray_payload> incoming: Payload;

@ray_generation
fn raygen(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {
    let at = (vec2f(id.xy) + 0.5) / vec2f(size.xy) * 2.0 - 1.0;
    payload = Payload(vec3f(0.0), 0.0, 0.0, -2, 0u, 0.0);
    traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 100.0, vec3f(at, 4.0), vec3f(0.0, 0.0, -1.0)), &payload);
    outputs[id.y * size.x + id.x] = payload;
}

// The parameter of the sphere that touches the surface at a point of it: where the axis distance,
// moved by how much the radii lean the surface, falls into [0, 1].
fn generating_parameter(segment: Segment, hit: vec3f) -> f32 {
    let axis = segment.position1 - segment.position0;
    let shrinking = segment.radius1 - segment.radius0;
    let along = dot(hit - segment.position0, axis) + segment.radius0 * shrinking;
    return clamp(along / (dot(axis, axis) - shrinking * shrinking), 0.0, 1.0);
}

@any_hit @incoming_payload(incoming)
fn count(@builtin(ray_t_current_max) t: f32) {
    incoming.any_hits += 1u;
    incoming.last_any_hit_t = t;
}

@closest_hit @incoming_payload(incoming)
fn shade(
    @builtin(primitive_index) primitive: u32,
    @builtin(object_ray_origin) origin: vec3f,
    @builtin(object_ray_direction) direction: vec3f,
    @builtin(ray_t_current_max) t: f32,
) {
    let segment = segments[primitive];
    let hit = origin + t * direction;
    let u = generating_parameter(segment, hit);
    let centre = mix(segment.position0, segment.position1, u);
    incoming.normal = normalize(hit - centre);
    incoming.u = u;
    incoming.t = t;
    incoming.primitive = i32(primitive);
}

@miss @incoming_payload(incoming)
fn sky() {
    incoming.primitive = -1;
}
