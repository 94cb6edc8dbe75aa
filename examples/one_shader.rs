//! One shader by itself: the normal of a linear swept sphere, without a scene.
//!
//! `cargo run --example one_shader`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use anyhit::{Exit, Hit, Module, Ray, Result, ShaderTest};

/// The payload `{ vec3 exact; float u; vec3 projected; float t; ... }` in Rust: its scalars follow
/// each other without gaps.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Payload {
    exact: [f32; 3],
    u: f32,
    projected: [f32; 3],
    t: f32,
    angle: f32,
    expected: f32,
    off_sphere: f32,
    hits: f32,
}

fn main() -> Result<()> {
    let fixtures = concat!(env!("CARGO_MANIFEST_DIR"), "/spirv-fixtures/pass");
    let module = Module::open(format!("{fixtures}/lss/normal-angle/main.rchit.spv"))?;

    // A segment from radius 1/2 to 1/4, met at right angles to its axis. The ray is really
    // intersected: t, u, positions and radii are those that a pipeline would give.
    let hit = Hit::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0.5, 0.25])
        .ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let test = ShaderTest::new(&module, "main")?.hit(hit);
    let outcome = test.run()?;

    // By the names in the shader, or as a Rust type.
    println!("u = {}, t = {}", outcome.payload["u"].f32(), outcome.payload["t"].f32());
    let payload: Payload = outcome.payload()?;
    println!("exact {:?}, projected {:?}", payload.exact, payload.projected);
    // The two normals stand apart by asin(|r0 - r1| / L), here asin(1/8).
    assert!((f64::from(payload.angle) - (0.25f64 / 2.0).asin()).abs() < 1e-6);
    assert_eq!(outcome.exit, Exit::Returned);

    // Any builtin takes any value, whether it fits the rest or not.
    let cylinder = test.builtin("HitLSSRadiiNV", [0.5f32, 0.5]).run()?;
    assert_eq!(cylinder.payload["expected"].f32(), 0.0);
    Ok(())
}

#[test]
fn the_example_runs() {
    main().expect("the example's own assertions hold");
}
