use anyhit::{Hit, Module, Ray, Result, ShaderTest};

pub fn seen_from_above_the_normal_points_up() -> Result<()> {
    let module = Module::open("tests/rust/first_tests/shaders/lss.rchit")?;
    // A rod along x of radius 1/2, and a ray down at its middle.
    let hit = Hit::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0.5, 0.5])
        .ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let outcome = ShaderTest::new(&module, "main")?.hit(hit).run()?;
    assert_eq!(outcome.payload["t"].f32(), 3.5);
    assert_eq!(outcome.payload["normal"].vec3(), [0.0, 0.0, 1.0]);
    Ok(())
}
