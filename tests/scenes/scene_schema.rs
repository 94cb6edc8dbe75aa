//! `anyhit schema`: what editors are told about scenes is what the parsers read.

use std::collections::BTreeSet;
use std::path::Path;

use anyhit::cli::scene_schema::scene_schema;
use pretty_assertions::assert_eq;
use serde_json::Value;

/// What the extension for Visual Studio Code is packed with.
const PACKED: &str = "editors/vscode/scene.schema.json";

/// The keys of a table: of its form for a value of `type`, or of its only form.
fn keys<'a>(schema: &'a Value, definition: &str, kind: Option<&str>) -> BTreeSet<&'a str> {
    let definition = &schema["definitions"][definition];
    let forms = definition["anyOf"]
        .as_array()
        .cloned()
        .map_or_else(|| vec![definition], |_| definition["anyOf"].as_array().into_iter().flatten().collect());
    let is_wanted = |form: &&&Value| {
        let kinds = form["properties"]["type"]["enum"].as_array();
        match kind {
            Some(kind) => kinds.is_some_and(|kinds| kinds.iter().any(|one| one == kind)),
            None => form["type"] == "object",
        }
    };
    let form = forms.iter().find(is_wanted).expect("the form");
    form["properties"].as_object().expect("keys").keys().map(String::as_str).collect()
}

#[test]
fn the_packed_schema_is_that_of_the_parsers() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(PACKED);
    let text = format!("{:#}\n", scene_schema());
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&path, &text).expect("a writable file");
    }
    let packed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(packed == text, "{PACKED} is out of date: BLESS=1 writes it");
}

/// The keys that `docs/scene.md` shows.
#[test]
fn keys_depend_on_the_type_of_a_table() {
    let schema = scene_schema();
    let common = ["opaque", "no_duplicate_any_hit", "cluster_id", "type"];
    let chain = keys(&schema, "GeometryEntry", Some("lss"));
    let spheres = keys(&schema, "GeometryEntry", Some("spheres"));
    assert_eq!(chain, keys(&schema, "GeometryEntry", Some("linear_swept_spheres")));
    for key in common {
        assert!(chain.contains(key) && spheres.contains(key), "{key}");
    }
    for key in ["positions", "radii", "indices", "mode", "caps"] {
        assert!(chain.contains(key), "{key}: {chain:?}");
        assert_eq!(spheres.contains(key), !matches!(key, "mode" | "caps"), "{key}");
    }
    let grass = keys(&schema, "GeometryEntry", Some("grass"));
    for key in ["count", "area", "height", "radius", "taper", "lean"] {
        assert!(grass.contains(key), "{key}: {grass:?}");
    }
    let scene = keys(&schema, "SceneFile", None);
    for key in
        ["version", "geometry", "instance", "shaders", "pipeline", "resources", "ray", "expect", "sanitize"]
    {
        assert!(scene.contains(key), "{key}: {scene:?}");
    }
    let pipeline = keys(&schema, "PipelineEntry", None);
    for key in
        ["raygen", "miss", "hit", "callable", "max_recursion_depth", "memory", "unbound", "fuel", "flags"]
    {
        assert!(pipeline.contains(key), "{key}: {pipeline:?}");
    }
    let instance = keys(&schema, "InstanceEntry", None);
    for key in ["geometry", "scale", "rotate", "translate", "transform", "motion", "srt", "mask", "tlas"] {
        assert!(instance.contains(key), "{key}: {instance:?}");
    }
    let ray = keys(&schema, "RayEntry", None);
    for key in ["name", "origin", "direction", "pixel", "expect", "payload"] {
        assert!(ray.contains(key), "{key}: {ray:?}");
    }
}

#[test]
fn names_and_comments_are_there() {
    let schema = scene_schema();
    let pipeline = &schema["definitions"]["PipelineEntry"]["properties"];
    assert_eq!(pipeline["max_recursion_depth"]["description"], "maxPipelineRayRecursionDepth");
    assert_eq!(pipeline["max_recursion_depth"]["type"], "integer");
    let text = schema.to_string();
    for name in ["\"chained\"", "\"storage_image\"", "\"force_opaque\"", "\"nan-output\"", "\"exact\""] {
        assert!(text.contains(name), "{name}");
    }
    assert_eq!(schema["definitions"]["SceneFile"]["required"], serde_json::json!(["version"]));
}
