//! The JSON Schema of scenes, judged by another reader of schemas: it accepts every scene and test
//! of this repository, and refuses keys and values that the parsers refuse.

use std::path::{Path, PathBuf};

use anyhit::LoadedScene;
use anyhit_cases::case::scenes;
use serde_json::Value;

fn schema() -> jsonschema::Validator {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../editors/vscode/scene.schema.json");
    let text = std::fs::read_to_string(path).expect("the schema");
    let schema: Value = serde_json::from_str(&text).expect("JSON");
    jsonschema::draft7::new(&schema).expect("a schema of draft 7")
}

/// A document as JSON, which has no NaN and no infinities: any number stands for them.
fn json(text: &str) -> Option<Value> {
    let mut table = text.parse::<toml::Table>().ok()?;
    table.iter_mut().for_each(|(_, value)| make_finite(value));
    serde_json::to_value(table).ok()
}

fn make_finite(value: &mut toml::Value) {
    match value {
        toml::Value::Float(number) if !number.is_finite() => *number = 0.5,
        toml::Value::Array(elements) => elements.iter_mut().for_each(make_finite),
        toml::Value::Table(members) => members.iter_mut().for_each(|(_, member)| make_finite(member)),
        _ => {}
    }
}

#[test]
fn every_scene_that_loads_is_accepted() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the repository");
    let schema = schema();
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in
        ["shaders/pass", "shaders/fail", "shaders/sanitize", "shaders/debugging", "scenes", "examples"]
    {
        files.extend(scenes(&root.join(folder)).expect("a folder"));
    }
    let mut wrong = Vec::new();
    let mut judged = 0;
    for path in &files {
        let text = std::fs::read_to_string(path).expect("a readable file");
        // What the parser refuses is no scene.
        if LoadedScene::open(path).is_err() {
            continue;
        }
        let Some(value) = json(&text) else { continue };
        judged += 1;
        for error in schema.iter_errors(&value) {
            wrong.push(format!("{}: {}: {error}", path.display(), error.instance_path()));
        }
    }
    println!("{judged} scenes of {} files", files.len());
    assert!(judged >= 150, "only {judged} scenes");
    assert!(wrong.is_empty(), "{}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn mistakes_are_refused() {
    let schema = schema();
    let mistakes = [
        "version = 1\nlaunc = [1, 1]",
        "version = 2",
        "[geometry.a]\ntype = 'grass'",
        "version = 1\n[geometry.a]\ntype = 'gras'",
        "version = 1\n[geometry.a]\ntype = 'spheres'\npositions = [[0, 0, 0]]\nradii = 1\ncaps = 'none'",
        "version = 1\n[pipeline]\nmax_recursion_depth = 'two'",
        "version = 1\n[[instance]]\ngeometry = 'a'\nmaks = 1",
        "version = 1\n[sanitize]\ndeny = 'no-such-rule'",
        "version = 1\nprecision = 'rough'",
    ];
    for text in mistakes {
        assert!(!schema.is_valid(&json(text).expect("TOML")), "{text}");
    }
    assert!(schema.is_valid(&json("version = 1\nlaunch = [1, 1]").expect("TOML")));
}
