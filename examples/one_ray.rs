//! One ray through a scene: hit groups, a miss shader, and the payload that comes back.
//!
//! `cargo run --example one_ray`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use anyhit::{Explain, Instance, Module, Pipeline, Program, Ray, Result, Scene};

fn main() -> Result<()> {
    let fixtures = concat!(env!("CARGO_MANIFEST_DIR"), "/spirv-fixtures/pass/slang/hit");
    let module = Module::open(format!("{fixtures}/hit.slang.spv"))?;
    let shader = |name| Program::of(&module, name);

    let pipeline = Pipeline::builder()
        .hit([shader("round")?, shader("every_second")?])?
        .miss(shader("sky")?)?
        .build()?;

    // Three spheres in a row and a swept sphere beside them. The any-hit shader ignores primitives
    // of odd number.
    let row = [([0.0, 0.0, -2.0], 0.5), ([0.0, 0.0, 0.0], 0.5), ([9.0, 0.0, 0.0], 0.5)];
    let scene = Scene::new([
        Instance::spheres(row),
        Instance::lss([[2.0, -1.0, 0.0], [2.0, 1.0, 0.0]], [0.5, 0.5]).custom_index(7),
    ])?;

    let through = |x: f32| pipeline.trace(&scene, Ray::new([x, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let spheres = through(0.0)?;
    // The second sphere is ignored, the first is not.
    assert_eq!((spheres.hit().primitive, spheres.hit().t), (0, 5.5));
    assert_eq!(spheres.payload["any_hits"].u32(), 2);

    let swept = through(2.0)?;
    println!("{:#?}", swept.payload);
    assert_eq!((swept.hit().instance, swept.hit().custom_index), (1, 7));
    assert_eq!(swept.payload["normal"].vec3(), [0.0, 0.0, 1.0]);
    // What `anyhit trace-one-ray` would tell of it.
    println!("{}", swept.explain());

    let missed = through(4.0)?;
    assert!(missed.missed());
    assert_eq!(missed.payload["primitive"].i32(), -1);
    Ok(())
}

#[test]
fn the_example_runs() {
    main().expect("the example's own assertions hold");
}
