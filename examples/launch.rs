//! A launch: ray generation over a grid, and the buffer and the image that it filled.
//!
//! `cargo run --example launch`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use anyhit::{Format, Image, Instance, Module, Pipeline, Program, Result, Scene, assert_near};

/// Compiled once, then taken from the cache; a file would do as well: `Module::open("a.wgsl")`.
const SOURCE: &str = "
enable wgpu_ray_tracing_pipeline;
enable primitive_index;

struct Payload { t: f32, primitive: i32 }

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read_write> hits: array<Payload>;
@group(0) @binding(2) var picture: texture_storage_2d<rgba32float, write>;

var<ray_payload> payload: Payload;
var<incoming_ray_payload> incoming: Payload;

// Parallel rays over the square from -1 to 1.
@ray_generation
fn look(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {
    let at = (vec2f(id.xy) + 0.5) / vec2f(size.xy) * 2.0 - 1.0;
    payload = Payload(-1.0, -1);
    traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 100.0, vec3f(at, 4.0), vec3f(0.0, 0.0, -1.0)), &payload);
    hits[id.y * size.x + id.x] = payload;
    let near = select(0.0, 1.0 / payload.t, payload.primitive >= 0);
    textureStore(picture, id.xy, vec4f(near, near, near, 1.0));
}

@closest_hit @incoming_payload(incoming)
fn met(@builtin(primitive_index) primitive: u32, @builtin(ray_t_current_max) t: f32) {
    incoming = Payload(t, i32(primitive));
}

@miss @incoming_payload(incoming)
fn nothing() {}
";

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Met {
    t: f32,
    primitive: i32,
}

fn main() -> Result<()> {
    let module = Module::from_source("launch.wgsl", SOURCE)?;
    let shader = |name| Program::of(&module, name);
    let pipeline = Pipeline::builder()
        .ray_generation(shader("look")?)?
        .hit([shader("met")?])?
        .miss(shader("nothing")?)?
        .build()?;

    // Two triangles: the left half at z = 0, the right upper quarter's at z = 2.
    let left = [[-1.0, -3.0, 0.0], [0.0, -3.0, 0.0], [-0.5, 9.0, 0.0]];
    let right = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.5, 9.0, 2.0]];
    let scene = Scene::new([Instance::triangles([left, right].concat())])?
        .bind(0, 0)
        .buffer(0, 1, &[Met { t: 0.0, primitive: 0 }; 4])
        .image(0, 2, Image::plane(Format::RGBA32F, 2, 2)?);
    let launched = pipeline.launch(&scene, [2, 2, 1])?;

    // As a Rust type, or by name.
    let met: Vec<Met> = launched.read_buffer(0, 1)?;
    let (near, far, none) =
        (Met { t: 2.0, primitive: 1 }, Met { t: 4.0, primitive: 0 }, Met { t: -1.0, primitive: -1 });
    assert_eq!(met, [far, none, far, near]);
    let hits = launched.buffer(0, 1)?;
    println!("{hits:?}");
    assert_eq!(launched.image(0, 2)?.at(1, 1), [0.5, 0.5, 0.5, 1.0]);
    assert_near!(launched.image(0, 2)?.at(0, 0), [0.25, 0.25, 0.25, 1.0], absolute = 0.0);
    assert_eq!(launched.stats.rays, 4);
    Ok(())
}

#[test]
fn the_example_runs() {
    main().expect("the example's own assertions hold");
}
