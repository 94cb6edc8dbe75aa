//! Values, shaders and lines in words.

use crate::transcript::{ShaderLabel, ShaderRun, TranscriptLine, Traversal};
use anyhit_engine::reflect::value::{FloatValue, TypedValue, ValueContent};

/// Structs whose text is longer than this, in bytes, are shown member by member.
const MAX_VALUE_BYTES: usize = 72;

/// The rows for the operands of a ray.
pub(super) fn ray(ray: &Traversal) -> Vec<(String, String)> {
    let flags = match &ray.flags.names[..] {
        [] => "none".to_owned(),
        names => format!("{} ({:#x})", names.join(" | "), ray.flags.bits),
    };
    let rows = [
        ("origin", vector(&ray.origin)),
        ("direction", format!("{}, length {}", vector(&ray.direction), ray.direction_length)),
        ("interval", format!("t from {} to {}", ray.t_min, ray.t_max)),
        ("flags", flags),
        ("cull mask", format!("{:#04x}", ray.cull_mask)),
    ];
    let time = ray.time.iter().map(|time| ("time", time.to_string()));
    let structure = ray.structure.iter().map(|name| ("structure", format!("`{name}`")));
    rows.into_iter().chain(time).chain(structure).map(|(label, text)| (label.to_owned(), text)).collect()
}

/// ` traced at a.rgen:19: the line's text`
pub(super) fn source_suffix(line: Option<&TranscriptLine>, verb: &str) -> String {
    let Some(TranscriptLine { file, line, text }) = line else { return String::new() };
    let text = text.as_ref().map_or_else(String::new, |text| format!(": {text}"));
    let gap = if verb.is_empty() { "" } else { ", " };
    format!("{gap}{verb} at {file}:{line}{text}")
}

/// A shader by its name, file and entry point.
pub(super) fn label(shader: &ShaderLabel) -> String {
    let name = shader.name.as_ref().map_or_else(String::new, |name| format!("`{name}` "));
    match &shader.file {
        Some(file) => format!("{name}({file}, {})", shader.entry),
        None => format!("{name}({})", shader.entry),
    }
}

/// What a shader calls the data that it was given.
pub(super) fn payload_label(run: &ShaderRun) -> &'static str {
    if run.shader.stage == "CallableKHR" { "callable data" } else { "payload" }
}

/// The value of a builtin, with the names of flags and hit kinds.
pub(super) fn annotated(name: &str, value: &TypedValue) -> String {
    let ValueContent::Uint(bits) = value.content else { return value.to_string() };
    match name {
        "IncomingRayFlagsKHR" => {
            let flags = crate::names::flags(bits as u32).names;
            let names = if flags.is_empty() { "none".to_owned() } else { flags.join(" | ") };
            format!("{value}: {names}")
        }
        "HitKindKHR" => {
            let kind = crate::names::hit_kind(anyhit_engine::accel::HitKind(bits as u32));
            format!("{value}: {kind}")
        }
        "CullMaskKHR" => format!("{value}: {bits:#04x}"),
        _ => value.to_string(),
    }
}

/// A row for a value, or a row for each of its members if one row would be too long.
pub(super) fn value_rows(word: &str, value: &TypedValue) -> Vec<(String, String)> {
    let text = value.to_string();
    if text.len() <= MAX_VALUE_BYTES {
        return vec![(word.to_owned(), text)];
    }
    let path = |path: String| if path.is_empty() { word.to_owned() } else { format!("{word}.{path}") };
    value.parts().into_iter().map(|(part, value)| (path(part), value.to_string())).collect()
}

/// `vec3(0, 0, 0) -> (0.5, 0, 0)`
pub(super) fn change(before: &TypedValue, after: &TypedValue) -> String {
    format!("{before} -> {}", after.content)
}

/// A point or direction.
pub(super) fn vector(values: &[FloatValue; 3]) -> String {
    format!("({}, {}, {})", values[0], values[1], values[2])
}
