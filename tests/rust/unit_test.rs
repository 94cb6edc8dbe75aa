//! The unit test that the README shows, and one of a whole pipeline.

use anyhit::{Hit, Module, Ray, Result, ShaderTest};

#[test]
fn the_normal_of_a_sphere_points_at_the_viewer() -> Result<()> {
    let module = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
    let hit = Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -2.0]));
    let outcome = ShaderTest::new(&module, "main")?.hit(hit).run()?;
    assert_eq!(outcome.payload["t"].f32(), 1.75); // (4 - 1/2) / 2: t counts ray lengths
    assert_eq!(outcome.payload["normal"].vec3(), [0.0, 0.0, 1.0]);
    Ok(())
}

#[test]
fn a_ray_beside_the_sphere_runs_the_miss_shader() -> Result<()> {
    use anyhit::{Instance, Pipeline, Program, Scene};

    let folder = "spirv-fixtures/pass/sphere/closest-hit";
    let shader = |file| Program::of(&Module::open(format!("{folder}/{file}"))?, "main");
    let pipeline =
        Pipeline::builder().hit([shader("main.rchit.spv")?])?.miss(shader("main.rmiss.spv")?)?.build()?;
    let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)])?;
    let traced = pipeline.trace(&scene, Ray::new([0.75, 0.0, 4.0], [0.0, 0.0, -1.0]))?;
    assert_eq!(traced.payload["t"].f32(), -1.0);
    Ok(())
}
