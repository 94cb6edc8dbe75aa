//! Laws that shaders keep for all rays and primitives, drawn by proptest.

use std::sync::OnceLock;

use anyhit::strategies::{self, direction, lss_hit, sphere_hit};
use anyhit::{Hit, Module, Ray, ShaderTest};
use proptest::prelude::*;

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn length(a: [f32; 3]) -> f32 {
    dot(a, a).sqrt()
}

fn normals() -> ShaderTest {
    static TEST: OnceLock<ShaderTest> = OnceLock::new();
    let open = || {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/spirv-fixtures/pass/lss/normal-angle");
        ShaderTest::new(&Module::open(format!("{folder}/main.rchit.spv"))?, "main")
    };
    TEST.get_or_init(|| open().expect("a fixture")).clone()
}

/// A diffuse and a mirror-like lobe that share the light between them; the shader traces one ray
/// for each.
const FURNACE: &str = "
enable wgpu_ray_tracing_pipeline;

struct Payload { radiance: vec3f, weight: f32 }

@group(0) @binding(0) var scene: acceleration_structure;
@group(0) @binding(1) var<storage, read> material: vec4f; // albedo, mirror

var<ray_payload> next: Payload;
var<incoming_ray_payload> incoming: Payload;

@closest_hit @incoming_payload(incoming)
fn shade(
    @builtin(world_ray_origin) origin: vec3f,
    @builtin(world_ray_direction) direction: vec3f,
    @builtin(ray_t_current_max) t: f32,
) {
    let at = origin + t * direction;
    let normal = normalize(at); // of a sphere around the origin
    let mirrored = reflect(direction, normal);
    next = Payload(vec3f(0.0), 0.0);
    traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.001, 100.0, at, mirrored), &next);
    let shiny = next.radiance * material.w;
    next = Payload(vec3f(0.0), 0.0);
    traceRay(scene, RayDesc(RAY_FLAG_NONE, 0xFFu, 0.001, 100.0, at, normal), &next);
    let dull = next.radiance * material.xyz * (1.0 - material.w);
    incoming.radiance = shiny + dull;
}
";

fn furnace() -> ShaderTest {
    static TEST: OnceLock<ShaderTest> = OnceLock::new();
    let open = || ShaderTest::new(&Module::from_source("furnace.wgsl", FURNACE)?, "shade");
    TEST.get_or_init(|| open().expect("it compiles")).clone()
}

proptest! {
    /// The exact normal of `shaders/demo/swept-spheres/normals.glsl`. A ray aimed at the axis
    /// enters the surface, so it goes against the outward normal: by at most rounding it may seem
    /// not to.
    #[test]
    fn a_swept_spheres_normal_is_unit_and_faces_the_ray(aimed in lss_hit()) {
        let outcome = normals().hit(aimed.hit()).run()?;
        let normal = outcome.payload["exact"].vec3();
        prop_assert!((length(normal) - 1.0).abs() < 1e-5, "of length {}\n{:#?}", length(normal), outcome.payload);
        let across = dot(normal, aimed.ray.direction) / length(aimed.ray.direction);
        prop_assert!(across < 1e-3, "{across} along the ray\n{:#?}", outcome.payload);
    }

    /// Where the side meets a cap the surface has one tangent plane, and its curvature is at most
    /// that of the cap: over a step of d the normal turns by about d / r, more where the ray
    /// grazes.
    #[test]
    fn shading_is_continuous_where_the_side_meets_the_cap(
        radii in [0.25f32..=0.5, 0.25f32..=0.5],
        length_of_axis in 1.0f32..=3.0,
        turn in -0.5f32..=0.5,
    ) {
        let step = 1.0 / 1024.0;
        // The cap's sphere touches the side in a circle at this distance from its centre along the
        // axis, of this radius (similar triangles).
        let lean = (radii[0] - radii[1]) / length_of_axis;
        let (along, around) = (length_of_axis + radii[1] * lean, radii[1] * (1.0 - lean * lean).sqrt());
        let normal = |x: f32| {
            let hit = Hit::lss([[0.0; 3], [length_of_axis, 0.0, 0.0]], radii)
                .ray(Ray::new([x, around * turn, 4.0], [0.0, 0.0, -1.0]));
            normals().hit(hit).run().map(|outcome| outcome.payload["exact"].vec3())
        };
        let (side, cap) = (normal(along - step)?, normal(along + step)?);
        let change = length(std::array::from_fn(|axis| side[axis] - cap[axis]));
        // |turn| is at most 1/2 of the radius: the ray meets the surface at 30 degrees or less from
        // its normal around the axis, and lean is at most 1/4.
        prop_assert!(change < 4.0 * 2.0 * step / radii[1], "the normal jumps by {change}: {side:?}, {cap:?}");
    }

    /// In surroundings that send the same light from everywhere, nothing sends back more.
    #[test]
    fn no_surface_gives_more_light_than_it_gets(
        albedo in [0.0f32..=1.0, 0.0f32..=1.0, 0.0f32..=1.0],
        mirror in 0.0f32..=1.0,
        direction in direction(),
    ) {
        let outcome = furnace()
            .hit(Hit::sphere([0.0; 3], 1.0).ray(Ray::new(direction.map(|x| -8.0 * x), direction)))
            .buffer(0, 1, &[[albedo[0], albedo[1], albedo[2], mirror]])
            .on_trace(|trace| trace.payload.set("radiance", [1.0f32; 3]))
            .run()?;
        prop_assert_eq!(outcome.traces.len(), 2);
        for channel in outcome.payload["radiance"].vec3() {
            prop_assert!((0.0..=1.000_001).contains(&channel), "{channel}");
        }
    }

    /// A mirrored ray leaves on the side that the ray came from.
    #[test]
    fn a_mirrored_ray_leaves_the_surface(aimed in sphere_hit()) {
        let aimed: strategies::Aimed = aimed;
        // The shader takes its normal from a sphere around the origin.
        let ray = aimed.ray;
        let outcome = furnace()
            .hit(Hit::sphere([0.0; 3], 0.5).ray(Ray::new(ray.direction.map(|x| -16.0 * x), ray.direction)))
            .buffer(0, 1, &[[1.0f32; 4]])
            .on_trace(|_| Ok(()))
            .run()?;
        let mirrored = outcome.traces[0].trace.ray;
        prop_assert!(dot(mirrored.origin, mirrored.direction) > 0.0);
    }
}
