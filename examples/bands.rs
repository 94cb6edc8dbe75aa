//! A launch whose picture is handed out in bands of rows while it is filled: as large as one likes,
//! in the memory of two bands.
//!
//! `cargo run --example bands`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use anyhit::{Band, Format, Instance, Module, Pipeline, Program, Result, Scene, StreamedImage};

const SOURCE: &str = "
enable wgpu_ray_tracing_pipeline;

struct Payload { t: f32 }

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var picture: texture_storage_2d<rgba32float, write>;

var<ray_payload> payload: Payload;
var<incoming_ray_payload> incoming: Payload;

// Parallel rays over the square from -1 to 1.
@ray_generation
fn look(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {
    let at = (vec2f(id.xy) + 0.5) / vec2f(size.xy) * 2.0 - 1.0;
    payload = Payload(0.0);
    traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.0, 100.0, vec3f(at, 4.0), vec3f(0.0, 0.0, -1.0)), &payload);
    // Only texels in the row of the launch index are stored to: so no other row need be there.
    textureStore(picture, id.xy, vec4f(payload.t));
}

@closest_hit @incoming_payload(incoming)
fn met(@builtin(ray_t_current_max) t: f32) {
    incoming = Payload(t);
}

@miss @incoming_payload(incoming)
fn nothing() {}
";

fn main() -> Result<()> {
    let module = Module::from_source("bands.wgsl", SOURCE)?;
    let shader = |name| Program::of(&module, name);
    let pipeline = Pipeline::builder()
        .ray_generation(shader("look")?)?
        .hit([shader("met")?])?
        .miss(shader("nothing")?)?
        .build()?;

    // The lower half of what is seen, as y goes up from row to row: a wall at z = 1.
    let wall = [[-9.0, 0.0, 1.0], [9.0, 0.0, 1.0], [0.0, 99.0, 1.0]];
    let scene = Scene::new([Instance::triangles(wall)])?.bind(0, 0);

    // 64 texels of 16 bytes a row: a band of 8 rows, the fewest that there are, has 8 KiB.
    let picture = StreamedImage { band_bytes: 8 << 10, ..StreamedImage::new(0, 1, Format::RGBA32F) };
    let (mut bands, mut met) = (Vec::new(), Vec::new());
    let launched = pipeline.launch_bands(&scene, [64, 20], &picture, |band: Band<'_>| {
        bands.push(band.rows());
        // Here they would go to a file.
        for y in band.rows() {
            met.push(band.at(32, y)?[0]);
        }
        Ok(())
    })?;
    assert_eq!(bands, [0..8, 8..16, 16..20]);
    // 4 - 1 from the middle on.
    assert_eq!(met, [[0.0; 10], [3.0; 10]].concat());
    assert_eq!(launched.stats.rays, 64 * 20);
    println!("{} rays in bands of rows {bands:?}", launched.stats.rays);
    Ok(())
}

#[test]
fn the_example_runs() {
    main().expect("the example's own assertions hold");
}
