//! glTF models in scenes: notes on what is not read of them, and models that
//! `judges/gltf/generate.mjs` generates, beside the triangles of three.js.

use std::path::Path;

use anyhit_base::error::Result;
use anyhit_base::input::InputLimits;
use anyhit_scene::mesh::listed::AnimationTime;
use anyhit_scene::mesh::model::{MeshFormat, Model};
use anyhit_scene::{EmbeddedFiles, LoadOptions, load_text};
use serde_json::{Value, json};

use crate::support::skipped::{self, test_name};

/// The corners of all triangles in the world.
fn corners(bytes: Vec<u8>, time: Option<&AnimationTime>) -> Result<Vec<f32>> {
    let limits = InputLimits::default();
    let model = Model::open_at(MeshFormat::Gltf, Path::new("m.gltf"), bytes, &EmbeddedFiles(&[]), time)?;
    let placed = model.placed(&limits)?;
    if placed.is_empty() {
        return Ok(Vec::new());
    }
    let mesh = model.merged(&placed, &limits)?;
    Ok(mesh.indices.iter().flat_map(|index| mesh.vertices[*index as usize]).collect())
}

/// The greatest distance of coordinates of two triangles, whose first corner may differ.
fn distance(one: &[f32; 9], other: &[f64; 9]) -> f64 {
    let turned = |turn: usize| {
        let differences = (0..9).map(|at| (f64::from(one[(at + 3 * turn) % 9]) - other[at]).abs());
        differences.fold(0.0, f64::max)
    };
    (0..3).map(turned).fold(f64::INFINITY, f64::min)
}

/// three.js calculates in 64 bits what it reads as 32: skins, morph targets, animations.
#[test]
fn generated_models_have_the_triangles_of_three_js() {
    let Some(folder) = skipped::variable(test_name!(), "ANYHIT_GLTF_MODELS") else { return };
    let mut count = 0;
    for at in 0.. {
        let Ok(text) = std::fs::read_to_string(format!("{folder}/{at}.json")) else { break };
        let expected: Value = serde_json::from_str(&text).expect("JSON");
        let numbers = expected["corners"].as_array().expect("corners").iter();
        let wanted: Vec<f64> = numbers.map(|number| number.as_f64().expect("a number")).collect();
        let time = expected["time"].as_f64().map(|time| AnimationTime { time: time as f32, animation: None });
        let file = |extension: &str| std::fs::read(format!("{folder}/{at}.{extension}"));
        let bytes = file("gltf").or_else(|_| file("glb")).expect("a model");
        let found = corners(bytes, time.as_ref()).unwrap_or_else(|error| panic!("{at}: {}", error.render()));
        assert_eq!(found.len(), wanted.len(), "{at}");
        let size = wanted.iter().fold(1.0_f64, |size, number| size.max(number.abs()));
        for (one, other) in found.as_chunks().0.iter().zip(wanted.as_chunks().0) {
            assert!(distance(one, other) < 1e-6 * size, "{at}: {one:?} instead of {other:?}");
        }
        count += 1;
    }
    assert!(count > 0, "no model in {folder}");
}

/// A triangle with animations of its node, each of which moves it by 1 along x in two seconds.
fn animated(animations: &[&str]) -> Vec<u8> {
    let numbers: [&[f32]; 3] = [&[0., 0., 0., 1., 0., 0., 0., 1., 0.], &[0., 2.], &[0., 0., 0., 1., 0., 0.]];
    let bytes = numbers.concat().into_iter().flat_map(f32::to_le_bytes);
    let data: String = bytes.map(|byte| format!("%{byte:02x}")).collect();
    let accessor = |view: usize, shape: &str, count: usize| json!({ "bufferView": view, "componentType": 5126, "type": shape, "count": count });
    let view =
        |offset: usize, length: usize| json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    let animation = |name: &&str| {
        json!({
            "name": name, "samplers": [{ "input": 1, "output": 2 }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
        })
    };
    let document = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "name": "a", "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "buffers": [{ "byteLength": 68, "uri": format!("data:application/gltf-buffer,{data}") }],
        "bufferViews": [view(0, 36), view(36, 8), view(44, 24)],
        "accessors": [accessor(0, "VEC3", 3), accessor(1, "SCALAR", 2), accessor(2, "VEC3", 2)],
        "animations": animations.iter().map(animation).collect::<Vec<_>>(),
    });
    document.to_string().into_bytes()
}

/// A file that is open at several times has one note for each set of contents, in the order of the
/// files and of the notes, whatever the order of the models is.
#[test]
fn notes_of_a_file_at_several_times_have_one_order() {
    let (three, two) = (animated(&["walk", "run", "rest"]), animated(&["walk", "run"]));
    let files = [("b.gltf", &three[..]), ("a.gltf", &two[..])];
    let mut models = [
        ("b.gltf", "time = 1.5"),
        ("b.gltf", ""),
        ("a.gltf", ""),
        ("b.gltf", "time = 0.5"),
        ("a.gltf", "time = 0.5\nanimation = 'run'"),
        ("b.gltf", "time = 0.5\nanimation = 'rest'"),
    ];
    let wanted = [
        "a.gltf: not read: 1 animation",
        "a.gltf: not read: 2 animations",
        "b.gltf: not read: 2 animations",
        "b.gltf: not read: 3 animations",
    ];
    // Maps of open models have a random order.
    for _ in 0..12 {
        let entry = |(at, (file, keys)): (usize, &(&str, &str))| {
            format!("[[model]]\nfile = '{file}'\nname = 'm{at}'\n{keys}\n")
        };
        let entries: String = models.iter().enumerate().map(entry).collect();
        let text = format!("version = 1\nlaunch = [1, 1]\n{entries}");
        let scene = load_text(Path::new("s.toml"), &text, &EmbeddedFiles(&files), &LoadOptions::default());
        let scene = scene.unwrap_or_else(|error| panic!("{}", error.render()));
        assert_eq!(scene.notes, wanted);
        let contents: Vec<String> = scene.unread_contents.iter().map(ToString::to_string).collect();
        assert_eq!(contents, wanted);
        models.rotate_left(1);
    }
    // A quarter of the two seconds.
    let scene = "version = 1\nlaunch = [1, 1]\n[[model]]\nfile = 'b.gltf'\ntime = 0.5\n";
    let scene =
        load_text(Path::new("s.toml"), scene, &EmbeddedFiles(&files), &LoadOptions::default()).unwrap();
    assert_eq!(scene.tlas[0].1.instances()[0].transform[0], [1., 0., 0., 0.25]);
}
