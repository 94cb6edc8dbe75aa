//! The unit test that the README shows.

use anyhit::{Hit, Instance, Module, Pipeline, Program, Ray, Result, Scene, ShaderTest};

const FOLDER: &str = "spirv-fixtures/pass/sphere/closest-hit";

#[test]
fn the_normal_of_a_sphere_points_at_the_viewer() -> Result<()> {
    let module = Module::open(format!("{FOLDER}/main.rchit.spv"))?;
    let hit = Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -2.0]));
    let outcome = ShaderTest::new(&module, "main")?.hit(hit).run()?;
    // t counts lengths of the direction: (4 - 1/2) / 2.
    assert_eq!(outcome.payload["t"].f32(), 1.75);
    assert_eq!(outcome.payload["normal"].vec3(), [0.0, 0.0, 1.0]);
    Ok(())
}

#[test]
fn a_ray_beside_the_sphere_runs_the_miss_shader() -> Result<()> {
    let shader = |file| Program::of(&Module::open(format!("{FOLDER}/{file}"))?, "main");
    let pipeline =
        Pipeline::builder().hit([shader("main.rchit.spv")?])?.miss(shader("main.rmiss.spv")?)?.build()?;
    let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)])?;
    let traced = pipeline.trace(&scene, Ray::new([0.75, 0.0, 4.0], [0.0, 0.0, -1.0]))?;
    assert_eq!(traced.payload["t"].f32(), -1.0);
    Ok(())
}
