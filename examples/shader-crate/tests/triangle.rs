//! The triangle's shader in WGSL: by itself, and one ray through a scene.

use anyhit::{Hit, Instance, Module, Pipeline, Program, Ray, Result, Scene, ShaderTest, assert_payload_eq};

const CORNERS: [[f32; 3]; 3] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Payload {
    normal: [f32; 3],
    t: f32,
}

/// The corners as WGSL lays them out.
fn padded() -> [[f32; 4]; 3] {
    CORNERS.map(|[x, y, z]| [x, y, z, 0.0])
}

#[test]
fn the_normal_faces_the_viewer_from_both_sides() -> Result<()> {
    let module = Module::open("shaders/triangle.wgsl")?;
    for side in [1.0, -1.0] {
        let hit = Hit::triangle(CORNERS).ray(Ray::new([0.0, 0.0, 4.0 * side], [0.0, 0.0, -2.0 * side]));
        let outcome = ShaderTest::new(&module, "shade")?.hit(hit).buffer(0, 2, &padded()).run()?;
        assert_payload_eq!(outcome, Payload { normal: [0.0, 0.0, side], t: 2.0 });
    }
    Ok(())
}

#[test]
fn a_ray_beside_it_sees_the_sky() -> Result<()> {
    let module = Module::open("shaders/triangle.wgsl")?;
    let pipeline = Pipeline::builder().hit([Program::of(&module, "shade")?])?.miss(Program::of(&module, "sky")?)?.build()?;
    let scene = Scene::new([Instance::triangle(CORNERS)])?.buffer(0, 2, &padded());
    let traced = pipeline.trace(&scene, Ray::new([2.0, 0.0, 4.0], [0.0, 0.0, -1.0]))?;
    assert!(traced.missed());
    assert_payload_eq!(traced, { "t": -1.0f32 });
    Ok(())
}
