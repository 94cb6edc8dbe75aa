//! Loading scenes: textures, models, data, instances.

use std::path::Path;

use anyhit::LoadedScene;

use crate::cases::textures;
use crate::curve::Curve;
use crate::fit::Growth;
use crate::glb::glb;
use crate::measure::Work;
use crate::scene_text::{SceneText, each, sides, write};

/// The curves of loading.
pub fn curves() -> Vec<Curve> {
    vec![
        Curve::linear("load: unused textures", [16, 64, 256, 1024], |folder, n| {
            load(folder, &SceneText::with(textures(n)))
        }),
        Curve::linear("load: unused PNG files", [8, 32, 128, 512], |folder, n| {
            let pixels = image::RgbaImage::from_fn(32, 32, |x, y| image::Rgba([x as u8, y as u8, 3, 255]));
            let texture = |at: usize| {
                pixels.save(folder.join(format!("t{at}.png"))).expect("a temporary file");
                format!(
                    "[resources.t{at}]\ntype = \"sampled_image\"\nbinding = {}\nfile = \"t{at}.png\"\n\n",
                    at + 100
                )
            };
            load(folder, &SceneText::with(each(n, texture)))
        }),
        Curve::linear("load: triangles of an OBJ file", [1 << 11, 1 << 13, 1 << 15, 1 << 17], |folder, n| {
            write(folder, "wall.obj", obj(n));
            load(folder, &model_of("type = \"obj\"\nfile = \"wall.obj\"\n"))
        }),
        Curve::linear("load: triangles of a GLB file", [1 << 13, 1 << 15, 1 << 17, 1 << 19], |folder, n| {
            write(folder, "wall.glb", wall(n));
            load(folder, &model_of("type = \"gltf\"\nfile = \"wall.glb\"\n"))
        }),
        Curve::linear("load: bytes of a binary file", [1 << 22, 1 << 23, 1 << 24, 1 << 25], |folder, n| {
            write(folder, "table.bin", vec![7u8; n]);
            let data = "data = { file = \"table.bin\" }";
            SceneText::with(format!("{UNUSED_BUFFER}{data}\n")).write(folder);
            // In a process whose memory is new for every size.
            Work::command(["run", "scene.toml", "--read-all"])
        }),
        Curve::linear("load: numbers in TOML", [1 << 10, 1 << 12, 1 << 14, 1 << 16], |folder, n| {
            let numbers: Vec<f32> = (0..n).map(|at| at as f32 * 0.37).collect();
            load(folder, &SceneText::with(format!("{UNUSED_BUFFER}data = {{ f32 = {numbers:?} }}\n")))
        }),
        Curve::linear("load: buffers", [32, 128, 512, 2048], |folder, n| {
            let buffer = |at| {
                format!("[resources.b{at}]\ntype = \"storage_buffer\"\nbinding = {}\nsize = 64\n\n", at + 100)
            };
            load(folder, &SceneText::with(each(n, buffer)))
        }),
        Curve::linear("load: instances in TOML", [64, 256, 1024, 4096], |folder, n| {
            let instance = |at| format!("[[instance]]\ngeometry = \"wall\"\ntranslate = [{at}, 0, 0]\n\n");
            load(folder, &SceneText { instances: each(n, instance), ..SceneText::default() })
        }),
        Curve::linear("load: texels with all levels", [1 << 14, 1 << 16, 1 << 18, 1 << 20], |folder, n| {
            let image = "[resources.t]\ntype = \"sampled_image\"\nbinding = 9\nlevels = \"all\"\n";
            let ([width, height], n) = (sides(n), 4 * n);
            write(folder, "texels.bin", (0..n).map(|at| (at * 37) as u8).collect::<Vec<_>>());
            let data = format!(
                "size = [{width}, {height}]\nformat = \"rgba8\"\ndata = {{ file = \"texels.bin\" }}\n"
            );
            SceneText::with(format!("{image}{data}")).write(folder);
            Work::command(["run", "scene.toml", "--read-all"])
        }),
        Curve::linear("load: picture of a launch", [1 << 12, 1 << 14, 1 << 16, 1 << 18], |folder, n| {
            load(folder, &SceneText::picture(n))
        })
        .time(Growth::Constant),
    ]
}

const UNUSED_BUFFER: &str = "[resources.unused]\ntype = \"storage_buffer\"\nbinding = 9\n";

/// Loads a scene.
fn load(folder: &Path, scene: &SceneText) -> Work {
    scene.write(folder);
    let path = folder.join("scene.toml");
    Work::call(move || {
        let scene = LoadedScene::open(&path).expect("a valid scene");
        let _ = std::hint::black_box(scene);
    })
}

fn model_of(geometry: &str) -> SceneText {
    SceneText { geometry: geometry.to_owned(), ..SceneText::default() }
}

/// A strip of n triangles along x: two rows of vertices.
fn vertices(n: usize) -> impl Iterator<Item = [f32; 3]> {
    (0..n + 2).map(|at| [(at / 2) as f32 * 0.01, (at % 2) as f32, (at as f32 * 0.1).sin()])
}

fn obj(n: usize) -> String {
    let vertices: String = vertices(n).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    vertices + &each(n, |at| format!("f {} {} {}\n", at + 1, at + 2, at + 3))
}

fn wall(n: usize) -> Vec<u8> {
    let positions: Vec<f32> = vertices(n).flatten().collect();
    let indices: Vec<u32> = (0..n as u32).flat_map(|at| [at, at + 1, at + 2]).collect();
    let mut bytes: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    let split = bytes.len();
    bytes.extend(indices.iter().flat_map(|x| x.to_le_bytes()));
    let (low, high) = ([0.0, 0.0, -1.0], [n.div_ceil(2) as f32 * 0.01, 1.0, 1.0]);
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":{low:?},"max":{high:?}}},
{{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":{split}}},{{"buffer":0,"byteOffset":{split},"byteLength":{}}}],
"buffers":[{{"byteLength":{}}}]}}"#,
        n + 2,
        3 * n,
        bytes.len() - split,
        bytes.len()
    );
    glb(&json, &bytes)
}
