//! The configurations of editors in docs/debugging.md: each starts a session of `anyhit dap`.

use serde_json::{Value, json};

use super::dap::Adapter;
use crate::support::files::root;

/// The first block of a language below a heading of the page.
fn block(heading: &str, language: &str) -> String {
    let page =
        std::fs::read_to_string(root().join("docs/debugging.md")).expect("the page").replace("\r\n", "\n");
    let section = page.split(&format!("\n### {heading}\n")).nth(1).expect("a section");
    let section = section.split("\n### ").next().unwrap_or_default();
    let start = section.split(&format!("```{language}\n")).nth(1).expect("a block");
    start.split("\n```").next().unwrap_or_default().to_owned()
}

/// Launches with the arguments of an editor, for a scene of the repository, and expects the first
/// line.
fn launch(editor: &str, mut arguments: Value, scene: &str) {
    arguments["scene"] = json!(root().join(scene));
    if arguments["pixel"].is_array() {
        arguments["pixel"] = json!([0, 0]);
    }
    let mut adapter = Adapter::start();
    adapter.request("initialize", &json!({ "adapterID": "anyhit" }));
    adapter.request("launch", &arguments);
    adapter.request("configurationDone", &Value::Null);
    loop {
        let message = adapter.receive().unwrap_or_else(|| panic!("{editor}: the adapter has ended"));
        if message["type"] == "response" {
            assert_eq!(message["success"], true, "{editor}: {message}");
        }
        if message["event"] == "stopped" {
            assert_eq!(message["body"]["reason"], "entry", "{editor}: {message}");
            return;
        }
    }
}

/// Without the keys by which an editor finds the adapter.
fn without(configuration: &Value, keys: &[&str]) -> Value {
    let mut arguments = configuration.clone();
    let members = arguments.as_object_mut().expect("an object");
    for key in keys {
        assert!(members.remove(*key).is_some(), "{key}: {configuration}");
    }
    arguments
}

const PIXEL_SCENE: &str = "shaders/pass/debugger/swept-spheres/scene.toml";

#[test]
fn of_visual_studio_code() {
    let file: Value = serde_json::from_str(&block("Visual Studio Code", "json")).expect("JSON");
    launch("VS Code", file["configurations"][0].clone(), PIXEL_SCENE);
}

#[test]
fn of_zed() {
    let file: Value = serde_json::from_str(&block("Zed", "json")).expect("JSON");
    assert_eq!(file[0]["tcp_connection"], json!({ "host": "127.0.0.1", "port": 4711 }));
    launch("Zed", without(&file[0], &["label", "adapter", "tcp_connection"]), PIXEL_SCENE);
}

/// Helix replaces `{0}` and `{1}` by what it asks for.
#[test]
fn of_helix() {
    let file: Value = toml::from_str(&block("Helix", "toml")).expect("TOML");
    let language = &file["language"][0];
    for stage in ["rgen", "rint", "rahit", "rchit", "rmiss", "rcall", "comp"] {
        assert!(language["file-types"].as_array().expect("a list").contains(&json!(stage)), "{stage}");
    }
    let debugger = &language["debugger"];
    assert_eq!([&debugger["command"], &debugger["args"]], [&json!("anyhit"), &json!(["dap"])]);
    let template = &debugger["templates"][0];
    let asked: Vec<&Value> = template["completion"].as_array().expect("a list").iter().collect();
    let names: Vec<&str> = asked.iter().filter_map(|one| one["name"].as_str().or(one.as_str())).collect();
    assert_eq!(names, ["scene", "ray"]);
    let mut arguments = template["args"].clone();
    assert_eq!([&arguments["scene"], &arguments["ray"]], [&json!("{0}"), &json!("{1}")]);
    arguments["ray"] = json!("a chain in the field");
    launch("Helix", arguments, "scenes/swept-spheres.toml");
}
