use anyhit::{Hit, Module, Ray, Result, ShaderTest};

const CORNERS: [[f32; 3]; 3] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];

pub fn the_normal_faces_the_viewer_from_both_sides() -> Result<()> {
    let module = Module::open("tests/rust/first_tests/shaders/triangle.wgsl")?;
    // A vec4f each, as the shader declares them.
    let corners = CORNERS.map(|[x, y, z]| [x, y, z, 0.0]);
    for side in [1.0, -1.0] {
        let hit = Hit::triangle(CORNERS).ray(Ray::new([0.0, 0.0, 4.0 * side], [0.0, 0.0, -side]));
        let outcome = ShaderTest::new(&module, "shade")?.hit(hit).buffer(0, 0, &[corners]).run()?;
        assert_eq!(outcome.payload["t"].f32(), 4.0);
        assert_eq!(outcome.payload["normal"].vec3(), [0.0, 0.0, side]);
    }
    Ok(())
}
