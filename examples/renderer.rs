//! The frame of a renderer, from its scene: as it is, and changed until a pixel can be calculated
//! by hand. docs/renderer.md tells how the scene came from the renderer.
//!
//! `cargo run --release --example renderer`

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use anyhit::{LoadedScene, Result, assert_near};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/renderer/scene.toml");

/// `struct Material` of scene_info.slangh.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Material {
    base_color: [f32; 4],
    emissive: [f32; 3],
    emissive_strength: f32,
    metallic: f32,
    roughness: f32,
    alpha_cutoff: f32,
    alpha_mode: u32,
    base_color_texture: i32,
    padding: [u32; 3],
}

/// `struct Light` of scene_info.slangh.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Light {
    ty: u32,
    range: f32,
    cosines: [f32; 2],
    position: [f32; 3],
    direction: [f32; 3],
    color: [f32; 3],
}

fn main() -> Result<()> {
    let mut scene = LoadedScene::open(SCENE)?;
    scene.set_launch_size([48, 27])?;
    let frame = scene.launch()?;
    println!("{} rays for a picture of 48 x 27", frame.stats.rays);
    // The floor in front is lit, and its colours are those of a screen.
    let [red, green, blue, alpha] = frame.image("screen")?.at(24, 25);
    assert!(red > 0.1 && green > 0.1 && blue > 0.05 && alpha == 1.0, "{red} {green} {blue}");

    // One rough material without textures for everything, and no light but the sky's.
    let plain = Material {
        base_color: [0.5, 0.25, 0.125, 1.0],
        roughness: 1.0,
        base_color_texture: -1,
        ..bytemuck::Zeroable::zeroed()
    };
    let dark: Light = bytemuck::Zeroable::zeroed();
    scene.set_buffer("materials", &[plain; 8])?.set_buffer("lights", &[dark; 11])?;
    let frame = scene.launch()?;
    let color = |ambient: [f32; 3]| {
        let [red, green, blue] = ambient;
        [0.5 * red * 0.4, 0.25 * green * 0.4, 0.125 * blue * 0.4, 1.0]
    };
    // The floor looks up to the zenith, a wall as much to it as to the horizon.
    let (zenith, horizon) = ([0.035, 0.055, 0.15], [0.22, 0.17, 0.22]);
    let between = [0, 1, 2].map(|i| (zenith[i] + horizon[i]) / 2.0);
    let image = frame.image("outImage")?;
    assert_near!(image.at(24, 25), color(zenith), relative = 1e-5);
    assert_near!(image.at(44, 3), color(between), relative = 1e-5);

    // What the second pass makes of it: Reinhard's curve with a white of 4, then sRGB.
    let [red, green, blue, _] = color(zenith);
    let luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
    let mapped = (1.0 + luminance / 16.0) / (1.0 + luminance);
    let encode = |linear: f32| 1.055 * (linear * mapped).powf(1.0 / 2.4) - 0.055;
    let screen = frame.image("screen")?.at(24, 25);
    assert_near!(screen, [encode(red), encode(green), encode(blue), 1.0], absolute = 0.5 / 255.0 + 1e-5);
    Ok(())
}

#[test]
fn the_example_runs() {
    main().expect("the example's own assertions hold");
}
