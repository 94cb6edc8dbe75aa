//! The swept-spheres scene, drawn from GLSL and from Slang.

use std::path::Path;

use anyhit_engine::machine::image::Image;
use anyhit_engine::pipeline::{BatchWidth, RunOptions};
use anyhit_scene::{DiskFiles, LoadOptions};

/// The picture of a scene as 8-bit channels, as they are saved.
fn picture(name: &str, width: BatchWidth) -> Vec<[u8; 3]> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let options = LoadOptions { size: Some([192, 108]), ..LoadOptions::default() };
    let resolved = anyhit_scene::load(&path, &DiskFiles, &options).expect("a valid scene");
    let output = resolved.output().expect("an output image");
    let (set, binding) = (output.set, output.binding);
    let assembled = anyhit_scene::assemble(&resolved).expect("supported shaders");
    assembled.launch().run(assembled.size, RunOptions::of(width)).expect("no trap");
    let image: &Image = assembled.resources.image(set, binding).expect("the output is bound");
    let bytes = image.level_bytes(0);
    let texels = bytes.chunks_exact(16).map(|texel| {
        [0, 4, 8].map(|at| f32::from_le_bytes(texel[at..at + 4].try_into().expect("four bytes")))
    });
    let eight_bits = |channel: f32| (channel.clamp(0.0, 1.0) * 255.0).round() as u8;
    let pixels: Vec<_> = texels.map(|texel| texel.map(eight_bits)).collect();
    assert_eq!(pixels.len(), 192 * 108);
    pixels
}

#[test]
fn glsl_and_slang_draw_the_same_picture() {
    let glsl = picture("swept-spheres.toml", BatchWidth::Of64);
    let slang = picture("swept-spheres-slang.toml", BatchWidth::Of64);
    // Not a flat picture: sky, grass, spheres and ground differ.
    let mut colours = glsl.clone();
    colours.sort_unstable();
    colours.dedup();
    assert!(colours.len() > 1000, "only {} colours", colours.len());
    for (at, (a, b)) in glsl.iter().zip(&slang).enumerate() {
        for (a, b) in a.iter().zip(b) {
            assert!(a.abs_diff(*b) <= 1, "pixel ({}, {}): {a} and {b}", at % 192, at / 192);
        }
    }
}

#[test]
fn one_lane_draws_the_same_bits() {
    assert!(
        picture("swept-spheres.toml", BatchWidth::One) == picture("swept-spheres.toml", BatchWidth::Of64)
    );
    assert!(
        picture("swept-spheres-slang.toml", BatchWidth::One)
            == picture("swept-spheres-slang.toml", BatchWidth::Of64)
    );
}
