//! The unit test that the README shows.

use anyhit::accel::{RayFlags, TraceRay};
use anyhit::geometry::Ray;
use anyhit::pipeline::RayOperands;
use anyhit::scene::{DiskFiles, Options, assemble, load};

#[test]
fn the_normal_of_a_sphere_points_at_the_viewer() -> anyhit::Result<()> {
    let path = "shaders/pass/sphere/closest-hit/scene.toml".as_ref();
    let scene = load(path, &DiskFiles, &Options::default())?;
    let assembled = assemble(&scene)?;
    let trace =
        TraceRay { ray: Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -2.0]), flags: RayFlags(0), cull_mask: 0xFF };
    let payload = vec![0; 5]; // vec3 normal; float t; uint hits
    let ray = RayOperands { trace, sbt_offset: 0, sbt_stride: 1, miss_index: 0, payload };
    let outcome = assembled.launch().trace(&scene.tlas[0].1, ray, &mut ())?;
    let payload: Vec<f32> = outcome.payload.iter().map(|&word| f32::from_bits(word)).collect();
    // The sphere's surface is at z = 1/2, and t counts lengths of the direction: (4 - 1/2) / 2.
    assert_eq!(payload[..4], [0.0, 0.0, 1.0, 1.75]);
    assert_eq!(outcome.payload[4], 1);
    Ok(())
}
