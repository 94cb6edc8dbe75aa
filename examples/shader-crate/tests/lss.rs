//! The normal of a linear swept sphere, in GLSL and in Slang.

use anyhit::strategies::lss_hit;
use anyhit::{Hit, Instance, Module, Ray, Result, ShaderTest};
use anyhit::{assert_near, assert_payload_eq, assert_ulps};
use proptest::prelude::*;

/// The shader that the application ships.
fn glsl() -> Result<ShaderTest> {
    let module = Module::from_spirv(shader_crate::LSS_CLOSEST_HIT)?;
    ShaderTest::new(&module, "main")
}

/// The closest-hit shader in Slang.
fn slang() -> Result<ShaderTest> {
    let module = Module::from_spirv(shader_crate::LSS_SLANG)?;
    ShaderTest::new(&module, "lss")
}

/// From above onto the middle of a segment along x.
fn from_above(radii: [f32; 2]) -> Hit {
    Hit::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], radii).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]))
}

#[test]
fn of_equal_radii_it_is_a_cylinders() -> Result<()> {
    for test in [glsl()?, slang()?] {
        let outcome = test.hit(from_above([0.5, 0.5])).run()?;
        assert_payload_eq!(outcome, { "normal": [0.0f32, 0.0, 1.0], "u": 0.5f32, "t": 3.5f32 });
    }
    Ok(())
}

#[test]
fn of_unequal_radii_it_leans_towards_the_thin_end() -> Result<()> {
    for test in [glsl()?, slang()?] {
        let outcome = test.hit(from_above([0.5, 0.25])).run()?;
        // The side of a cone: the sine of its slope is (r0 - r1) / length = 1/8.
        let (sine, cosine) = (0.125f64, (1.0f64 - 0.125 * 0.125).sqrt());
        assert_near!(outcome.payload["normal"], [sine, 0.0, cosine], absolute = 1e-6);
    }
    Ok(())
}

#[test]
fn an_instance_turns_it_with_its_surface() -> Result<()> {
    // Twice as long along x, a quarter turn about z: x becomes y.
    let instance = Instance::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0.5, 0.5]).transform([
        [0.0, -1.0, 0.0, 0.0],
        [2.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]);
    // At x = 0.3 the circle of radius 0.5 has z = 0.4 and the normal (0.6, 0, 0.8).
    let hit = Hit::of(instance).ray(Ray::new([0.3, 0.5, 4.0], [0.0, 0.0, -1.0]));
    let outcome = glsl()?.hit(hit).run()?;
    assert_ulps!(outcome.payload["normal"], [0.6, 0.0, 0.8], 4);
    Ok(())
}

#[test]
fn both_languages_agree() -> Result<()> {
    let (glsl, slang) = (glsl()?, slang()?);
    for x in [-1.25f32, -0.5, 0.0, 0.75, 1.125] {
        let hit = Hit::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0.5, 0.25])
            .ray(Ray::new([x, 0.0, 4.0], [0.0, 0.0, -1.0]));
        let expected = glsl.clone().hit(hit.clone()).run()?.payload["normal"].vec3();
        assert_ulps!(slang.clone().hit(hit).run()?.payload["normal"], expected, 4);
    }
    Ok(())
}

proptest! {
    #[test]
    fn it_is_unit_and_faces_the_ray(aimed in lss_hit()) {
        let outcome = glsl()?.hit(aimed.hit()).run()?;
        let normal = outcome.payload["normal"].vec3();
        let dot = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        prop_assert!((dot(normal, normal) - 1.0).abs() < 1e-5);
        prop_assert!(dot(normal, aimed.ray.direction) < 1e-3);
    }
}
