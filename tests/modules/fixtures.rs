//! The compiled shaders are those of the sources, and nobody has edited them; the demo's texture is
//! what its formula says.

use std::path::Path;

use anyhit_compile::fixtures;
use image::{Rgb, RgbImage};

#[test]
fn every_source_has_its_fixture_and_every_fixture_its_source() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let problems = fixtures::check(root).unwrap();
    assert!(
        problems.is_empty(),
        "out of step:\n  {}\nRun `cargo run --features glsl -- compile --fixtures` \
         (with slangc on the PATH where a Slang source has changed).",
        problems.join("\n  ")
    );
}

#[test]
fn no_module_names_a_folder_of_the_machine_that_made_it() {
    const OP_STRING: u32 = 7;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(fixtures::FIXTURES);
    let mut folders = vec![root];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let bytes = std::fs::read(&path).unwrap();
            let words: Vec<u32> =
                bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
            let mut at = 5;
            while path.extension().is_some_and(|extension| extension == "spv") && at < words.len() {
                if words[at] & 0xFFFF == OP_STRING {
                    let start = words[at + 2].to_le_bytes();
                    let absolute = start[0] == b'/' && start[1] != b'/' || start[1..3] == *b":\\";
                    assert!(!absolute, "{}: the string at word {at} is an absolute path", path.display());
                }
                at += (words[at] >> 16) as usize;
            }
        }
    }
}

#[test]
fn the_palette_is_drawn_by_its_formula() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/demo/swept-spheres/palette.png");
    let drawn = RgbImage::from_fn(64, 64, palette_pixel);
    // Not when it is right: tests that run meanwhile read it.
    let is_right = image::open(&path).is_ok_and(|stored| stored.into_rgb8() == drawn);
    if !is_right && std::env::var_os("BLESS").is_some() {
        drawn.save(&path).unwrap();
    }
    let stored = image::open(&path).unwrap().into_rgb8();
    assert_eq!(stored.dimensions(), (64, 64));
    for (x, y, pixel) in stored.enumerate_pixels() {
        assert_eq!(pixel, drawn.get_pixel(x, y), "at ({x}, {y})");
    }
}

/// Each band of 16 rows runs from one tint to another, in weave-like squares of 4 x 4 pixels that
/// are a little lighter and darker in turn. The spheres' band runs there and back: it wraps around.
fn palette_pixel(x: u32, y: u32) -> Rgb<u8> {
    let (from, to): ([u32; 3], [u32; 3]) = match y / 16 {
        0 => ([44, 92, 24], [190, 214, 78]),    // grass, root to tip
        1 => ([196, 60, 44], [244, 204, 92]),   // spheres
        2 => ([104, 116, 140], [222, 160, 92]), // chains
        _ => ([122, 104, 84], [186, 176, 158]), // ground
    };
    let at = if y / 16 != 1 { x } else { 63 - (2 * x).abs_diff(63) };
    let lift = if (x / 4 + y / 4).is_multiple_of(2) { 8 } else { 0 };
    Rgb([0, 1, 2].map(|c| {
        let mixed = (from[c] * (63 - at) + to[c] * at) / 63 + lift;
        u8::try_from(mixed).expect("the tints leave room for the lift")
    }))
}
