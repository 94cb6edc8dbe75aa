//! `anyhit test`: cases beside large resources, and many cases.

use std::path::Path;

use anyhit_cases::case::Case;
use anyhit_cases::run::{RayMeasurements, rays as rays_of};

use crate::curve::Curve;
use crate::fit::Growth;
use crate::measure::Work;
use crate::scene_text::{SceneText, each, sides};

const RAYS: usize = 100;
const BYTES: [usize; 4] = [1 << 18, 1 << 20, 1 << 22, 1 << 24];
const PIXELS: [usize; 4] = [1 << 12, 1 << 14, 1 << 16, 1 << 18];

/// The curves of tests.
pub fn curves() -> Vec<Curve> {
    vec![
        Curve::linear("test: 100 rays, bytes of an unused buffer", BYTES, |folder, n| {
            let buffer = format!("type = \"storage_buffer\"\nbinding = 9\nsize = {n}\n\n");
            run_rays(folder, &SceneText::with(format!("[resources.unused]\n{buffer}{}", rays(RAYS))))
        })
        .time(Growth::Constant)
        .memory(Growth::Constant),
        Curve::linear("test: 100 rays, unused textures", [16, 64, 256, 1024], |folder, n| {
            test(folder, &SceneText::with(format!("{}{}", textures(n), rays(RAYS))))
        }),
        Curve::linear("test: rays of a file", [64, 256, 1024, 4096], |folder, n| {
            test(folder, &SceneText::with(rays(n)))
        }),
        Curve::linear("test: 16 pixel rays, pixels of the picture", PIXELS, |folder, n| {
            let expect = "expect = { t = 1, because = \"the wall\" }";
            let ray = |at| format!("[[ray]]\npixel = [{at}, 0]\n{expect}\n\n");
            run_rays(folder, &SceneText { launch: sides(n), ..SceneText::with(each(16, ray)) })
        })
        .time(Growth::Constant),
        Curve::linear("test: launched pixels", PIXELS, |folder, n| {
            let more = format!("[expect.stats]\nrays = {n}\nbecause = \"one for each pixel\"\n");
            SceneText { more, ..SceneText::picture(n) }.write(folder);
            Work::command(["test", "scene.toml"])
        }),
        Curve::linear("test: variants of a file", [16, 64, 256, 1024], |folder, n| {
            let variant = |at| format!("[[variant]]\nname = \"v{at}\"\nshaders.miss = \"miss.spv\"\n\n");
            let stats = "[expect.stats]\nrays = 1\nbecause = \"one pixel\"\n\n";
            SceneText::with(format!("{}{stats}", each(n, variant))).write(folder);
            Work::command(["test", "scene.toml"])
        }),
    ]
}

fn test(folder: &Path, scene: &SceneText) -> Work {
    scene.write_as(folder, "rays.test.toml");
    Work::command(["test", "rays.test.toml"])
}

/// Runs the rays of a case that is loaded.
fn run_rays(folder: &Path, scene: &SceneText) -> Work {
    scene.write_as(folder, "rays.test.toml");
    let cases = Case::of(&folder.join("rays.test.toml")).expect("a case");
    let loaded = cases[0].load().expect("a valid case");
    Work::call(move || {
        let rays = rays_of(&loaded.scene, &loaded.assembled, &mut RayMeasurements::default());
        assert!(rays.iter().all(|(_, ray)| ray.is_ok()), "a ray that does not run");
    })
}

/// Rays that hit the wall at t = 1, in places of their own.
fn rays(n: usize) -> String {
    each(n, |at| {
        let x = at as f64 / n as f64;
        format!(
            "[[ray]]\norigin = [{x:?}, 0, 1]\ndirection = [0, 0, -1]\n\
             expect = {{ t = 1, because = \"the wall is at z = 0\" }}\n\n"
        )
    })
}

/// Textures of 64 x 64 texels that no shader declares.
pub fn textures(n: usize) -> String {
    each(n, |at| {
        format!(
            "[resources.t{at}]\ntype = \"combined_image_sampler\"\nbinding = {}\nsize = [64, 64]\n\
             fill = [1, 0.5, 0, 1]\nformat = \"rgba8\"\nsampler = {{ filter = \"nearest\" }}\n\n",
            at + 100
        )
    })
}
