use anyhit::{Hit, Module, Ray, Result, ShaderTest, assert_ulps};

pub fn a_cone_leans_towards_its_thin_end() -> Result<()> {
    let module = Module::open("tests/rust/first_tests/shaders/lss.slang")?;
    let hit = Hit::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0.5, 0.25])
        .ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let outcome = ShaderTest::new(&module, "shade")?.hit(hit).run()?;
    // The side of a cone: the sine of its slope is (1/2 - 1/4) / 2, its cosine sqrt(63/64).
    assert_ulps!(outcome.payload["normal"], [0.125, 0.0, 0.9921567], 4);
    Ok(())
}
