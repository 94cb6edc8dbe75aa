//! The JSON Schema of scenes and tests, for editors: which keys there are, and what they take.

use serde_json::json;

use anyhit_cases::expect::{Expectations, OneRay};
use anyhit_sanitize::rule;
use anyhit_scene::file::{SceneFile, VERSION};
use anyhit_scene::read::Parse;
use anyhit_scene::read::recorder::{JsonSchema, SchemaProbe};

/// The page that describes the keys.
const DOCUMENTATION: &str = include_str!("../../docs/scene.md");

/// The schema of `scene.toml` and of `*.test.toml`: what the parsers read, with the comments of
/// `docs/scene.md` as descriptions.
pub fn scene_schema() -> JsonSchema {
    let mut probe = SchemaProbe::default();
    let scene = SceneFile::schema(&mut probe);
    let (expect, of_ray) = (Expectations::schema(&mut probe), OneRay::schema(&mut probe));
    let mut schema = probe.finish("A scene of anyhit, with its tests", &scene);
    let definitions = &mut schema["definitions"];
    let root = &mut definitions["SceneFile"];
    root["properties"]["version"] = json!({ "const": VERSION });
    root["properties"]["expect"] = expect;
    root["properties"]["sanitize"] = sanitize();
    root["required"] = json!(["version"]);
    definitions["RayEntry"]["properties"]["expect"] = of_ray;
    describe(&mut schema);
    schema
}

/// `[sanitize]`: lists of rules by their level.
fn sanitize() -> JsonSchema {
    let ids: Vec<&str> = rule::all().map(|rule| rule.id).collect();
    let rule = json!({ "enum": ids });
    let rules = json!({ "anyOf": [rule, { "type": "array", "items": rule }] });
    json!({
        "type": "object",
        "properties": { "allow": rules, "warn": rules, "deny": rules },
        "additionalProperties": false,
    })
}

/// Gives keys the comments that stand behind them in the documentation's examples, and the meanings
/// of its tables: the first of each.
fn describe(schema: &mut JsonSchema) {
    let mut table: Option<String> = Some(String::new());
    let (mut section, mut is_example) = (String::new(), false);
    for line in DOCUMENTATION.lines() {
        if line.starts_with("```") {
            is_example = line == "```toml";
            table = is_example.then(String::new);
        } else if let Some(heading) = line.strip_prefix("## ") {
            section = heading.to_lowercase();
        } else if let Some(header) = line.strip_prefix('[').filter(|_| is_example) {
            let name = header.trim_start_matches('[').split([']', '.']).next();
            // Tables in tables are described where they stand alone.
            let is_nested = header.split(']').next().is_some_and(|path| path.matches('.').count() > 1);
            table = name.filter(|_| !is_nested).map(str::to_owned);
        } else if let (true, Some(table)) = (is_example, &table) {
            let parts = line.split_once(" = ").zip(line.rsplit_once(" # "));
            if let Some(((key, _), (_, comment))) = parts {
                describe_key(schema, table, key, comment);
            }
        } else if let Some(row) = line.strip_prefix("| `") {
            let cells: Vec<&str> = row.split(" | ").collect();
            if let [key, .., meaning] = cells[..] {
                let meaning = meaning.trim_end_matches('|');
                let key = key.trim_end_matches('`');
                [section.as_str(), section.trim_end_matches('s')]
                    .iter()
                    .for_each(|table| describe_key(schema, table, key, meaning));
            }
        }
    }
}

/// Describes a key of a table at the top of a scene; a table without a name is the scene itself.
fn describe_key(schema: &mut JsonSchema, table: &str, key: &str, text: &str) {
    let text = text.trim();
    let scene = &schema["definitions"]["SceneFile"];
    let holder = match table {
        "" => Some("SceneFile".to_owned()),
        table => definition_of(&scene["properties"][table]),
    };
    let Some(holder) = holder.filter(|_| !text.is_empty()) else { return };
    let definition = &mut schema["definitions"][holder];
    let forms = match definition.get("anyOf").is_some() {
        true => definition["anyOf"].as_array_mut().map_or(&mut [][..], |forms| &mut forms[..]),
        false => std::slice::from_mut(definition),
    };
    for form in forms {
        let Some(known) = form.get_mut("properties").and_then(|keys| keys.get_mut(key)) else { continue };
        if known.get("description").is_some() || !known.is_object() {
            continue;
        }
        // What stands beside a reference is not read.
        if known.get("$ref").is_some() {
            *known = json!({ "allOf": [known.take()] });
        }
        known["description"] = json!(text);
    }
}

/// The definition that a schema refers to, in an array or a table of names, too.
fn definition_of(schema: &JsonSchema) -> Option<String> {
    let path = [schema, &schema["items"], &schema["additionalProperties"]];
    let path = path.iter().find_map(|schema| schema.get("$ref")?.as_str())?;
    path.rsplit('/').next().map(str::to_owned)
}
