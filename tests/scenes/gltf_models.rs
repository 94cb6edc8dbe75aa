//! Models that `judges/gltf/generate.mjs` generates, beside the triangles of three.js.

use std::path::Path;

use anyhit_base::error::Result;
use anyhit_base::input::InputLimits;
use anyhit_scene::EmbeddedFiles;
use anyhit_scene::mesh::listed::AnimationTime;
use anyhit_scene::mesh::model::{MeshFormat, Model};
use serde_json::Value;

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
