//! Places of breakpoints as text.

use crate::debugger::{
    Breakpoint, BreakpointPlace, Debugger, SourceMap, SourcePosition, Time, TraversalFilter,
};
use anyhit_engine::module::interface::Stage;

/// A breakpoint's place with what follows it.
pub(super) struct Specification<'a> {
    pub place: &'a str,
    pub condition: Option<&'a str>,
    pub from_hit: u64,
}

/// The stages that a breakpoint can name, with their spellings.
const STAGES: [(Stage, &str); 7] = [
    (Stage::RayGeneration, "ray-generation"),
    (Stage::Intersection, "intersection"),
    (Stage::AnyHit, "any-hit"),
    (Stage::ClosestHit, "closest-hit"),
    (Stage::Miss, "miss"),
    (Stage::Callable, "callable"),
    (Stage::Compute, "compute"),
];

/// The spellings of the stages.
pub(super) fn stage_names() -> impl Iterator<Item = &'static str> {
    STAGES.iter().map(|(_, name)| *name)
}

/// Splits `PLACE [if CONDITION] [from N]`.
///
/// # Errors
/// What is missing or no number, in words.
pub(super) fn specification(text: &str) -> Result<Specification<'_>, String> {
    let (text, from_hit) = match text.rsplit_once(" from ") {
        Some((before, count)) => {
            let count = count.trim();
            let count = count.parse().map_err(|_| format!("`from {count}`: `{count}` is not a hit count"))?;
            (before.trim(), count)
        }
        None => (text, 0),
    };
    let (place, condition) = match text.split_once(" if ") {
        Some((place, condition)) => (place.trim(), Some(condition.trim())),
        None => (text, None),
    };
    if place.is_empty() {
        return Err("a place is missing: `break 27`, `break shade`, `break OpTraceRayKHR`".into());
    }
    Ok(Specification { place, condition, from_hit })
}

/// Checks the expressions of a log point's text.
///
/// # Errors
/// What is wrong with one, or that a brace is not closed.
pub(super) fn check_log(text: &str) -> Result<(), String> {
    let mut rest = text;
    while let Some((_, after)) = rest.split_once('{') {
        let (expression, after) =
            after.split_once('}').ok_or_else(|| format!("a `}}` is missing in `{text}`"))?;
        Debugger::check_expression(expression).map_err(|why| format!("`{expression}`: {why}"))?;
        rest = after;
    }
    Ok(())
}

/// Reads a place; a line alone is one of the current file.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn parse(text: &str, file: Option<&str>) -> Result<BreakpointPlace, String> {
    if text.contains('=') || text == "traversal" {
        return traversal(text).map(BreakpointPlace::Traversal);
    }
    if let Ok(line) = text.parse() {
        let file = file.ok_or("no source file is known here: use `FILE:LINE`")?.to_owned();
        return Ok(BreakpointPlace::Line { file, line });
    }
    if let Some((file, line)) = text.rsplit_once(':') {
        let line = line.parse().map_err(|_| format!("`{line}` is not a line of `{file}`"))?;
        return Ok(BreakpointPlace::Line { file: file.to_owned(), line });
    }
    let bare = |name: &str| name.replace(['-', '_'], "").to_lowercase();
    let wanted = bare(text.trim_end_matches("KHR").trim_end_matches("NV"));
    if let Some((stage, _)) = STAGES.iter().find(|(_, name)| bare(name) == wanted) {
        return Ok(BreakpointPlace::Stage(*stage));
    }
    if text.starts_with("Op") && text[2..].starts_with(char::is_uppercase) {
        return Ok(BreakpointPlace::Opcode(text.to_owned()));
    }
    Ok(BreakpointPlace::Function(text.to_owned()))
}

/// Reads `primitive=62 instance=2 verdict=opaque any-hit`.
fn traversal(text: &str) -> Result<TraversalFilter, String> {
    let mut filter = TraversalFilter::default();
    for part in text.split_whitespace().filter(|part| *part != "traversal") {
        let number = |value: &str| value.parse().map_err(|_| format!("`{part}`: `{value}` is not an index"));
        match part.split_once('=') {
            Some(("instance", value)) => filter.instance = Some(number(value)?),
            Some(("geometry", value)) => filter.geometry = Some(number(value)?),
            Some(("primitive", value)) => filter.primitive = Some(number(value)?),
            Some(("verdict", value)) => filter.verdict = Some(value.to_owned()),
            None if part == "any-hit" => filter.any_hit = true,
            _ => {
                return Err(format!(
                    "`{part}` is not one of instance=N, geometry=N, primitive=N, verdict=NAME, any-hit"
                ));
            }
        }
    }
    if let Some(verdict) = &filter.verdict
        && !VERDICTS.contains(&&**verdict)
    {
        return Err(format!("`{verdict}` is not a verdict; the verdicts are {}", VERDICTS.join(", ")));
    }
    Ok(filter)
}

/// What a traversal decides.
const VERDICTS: [&str; 12] = [
    "entered",
    "masked",
    "skipped",
    "missed-box",
    "missed",
    "outside-interval",
    "transparent",
    "culled-by-opacity",
    "culled-by-face",
    "behind",
    "opaque",
    "candidate",
];

/// A position of a file, whether it has code or not.
///
/// # Errors
/// That no such file is known, in words.
pub(super) fn find_line(sources: &SourceMap, file: &str, line: u32) -> Result<SourcePosition, String> {
    let found = sources.file(file).ok_or_else(|| unknown_file(sources, file))?;
    Ok(SourcePosition { file: found, line })
}

fn unknown_file(sources: &SourceMap, file: &str) -> String {
    let names: Vec<&str> = sources.files().iter().map(|file| &*file.name).collect();
    format!("no shader was compiled from `{file}`; the sources are {}", names.join(", "))
}

/// Why a breakpoint would never stop.
pub(super) fn nowhere(place: &BreakpointPlace, sources: &SourceMap) -> String {
    match place {
        BreakpointPlace::Line { file, line } if sources.file(file).is_some() => {
            format!("`{file}` has no code at or after line {line}")
        }
        BreakpointPlace::Line { file, .. } => unknown_file(sources, file),
        BreakpointPlace::Function(name) => {
            let names = sources.function_names();
            format!("no function is named `{name}`; the functions are {}", names.join(", "))
        }
        BreakpointPlace::Opcode(name) => format!("`{name}` is not a SPIR-V opcode"),
        BreakpointPlace::Instruction { .. } | BreakpointPlace::Stage(_) | BreakpointPlace::Traversal(_) => {
            "the place does not exist".into()
        }
    }
}

/// A breakpoint in a line, with its hits up to a step.
pub(super) fn describe(breakpoint: &Breakpoint, sources: &SourceMap, now: Time) -> String {
    let place = match &breakpoint.place {
        BreakpointPlace::Line { file, line } => match breakpoint.resolved[..] {
            [] => format!("{file}:{line}"),
            ref all => all.iter().map(|&at| sources.describe(at)).collect::<Vec<_>>().join(", "),
        },
        BreakpointPlace::Function(name) => match breakpoint.resolved.first() {
            Some(&at) => format!("{name} at {}", sources.describe(at)),
            None => name.clone(),
        },
        BreakpointPlace::Opcode(name) => format!("before each {name}"),
        BreakpointPlace::Instruction { offset, .. } => match breakpoint.resolved.first() {
            Some(&at) => format!("before the instruction at word {offset}, {}", sources.describe(at)),
            None => format!("before the instruction at word {offset}"),
        },
        BreakpointPlace::Stage(stage) => format!("where {} begins", stage.name()),
        BreakpointPlace::Traversal(filter) => {
            let given = |name: &str, value: Option<u32>| value.map(|value| format!("{name} {value}"));
            let parts = [
                given("instance", filter.instance),
                given("geometry", filter.geometry),
                given("primitive", filter.primitive),
                filter.verdict.clone(),
                filter.any_hit.then(|| "for an any-hit shader".to_owned()),
            ];
            let parts: Vec<String> = parts.into_iter().flatten().collect();
            format!(
                "where traversal decides: {}",
                if parts.is_empty() { "anything".into() } else { parts.join(", ") }
            )
        }
    };
    let condition = breakpoint.condition.as_ref().map_or_else(String::new, |text| format!(" if {text}"));
    let from = if breakpoint.from_hit > 1 { format!(" from {}", breakpoint.from_hit) } else { String::new() };
    let log = breakpoint.log.as_ref().map_or_else(String::new, |text| format!(", prints \"{text}\""));
    let rests = if breakpoint.is_enabled { "" } else { " (disabled)" };
    let hits = match breakpoint.hits.count(now) {
        0 => String::new(),
        1 => ", hit once".to_owned(),
        hits => format!(", hit {hits} times"),
    };
    format!("breakpoint {}: {place}{condition}{from}{log}{hits}{rests}\n", breakpoint.id.0)
}
