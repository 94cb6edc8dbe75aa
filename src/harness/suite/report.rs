//! Reports a suite: as text, as annotations for GitHub, as JSON.

use std::borrow::Cow;
use std::fmt::Write;
use std::hash::{BuildHasher, RandomState};
use std::path::Path;

use serde_json::{Value, json};

use crate::error::{Error, Place};
use crate::harness::coverage::Coverage;
use crate::harness::suite::{Finished, Outcome, SuiteReport, TestFailure};

/// The version of the JSON.
const VERSION: u32 = 1;

/// How many of a long list are named.
const NAMED: usize = 12;

/// A test that has run, as lines: its name and outcome, and beneath a failure all about it.
pub fn text(finished: &Finished, colour: bool) -> String {
    let ink = |code: &str, text: &str| match colour {
        true => format!("\u{1b}[{code}m{text}\u{1b}[0m"),
        false => text.to_owned(),
    };
    let word = finished.outcome.word();
    let code = match &finished.outcome {
        Outcome::Passed => "32",
        Outcome::KnownFailure(_) | Outcome::Renewed => "33",
        Outcome::Failed(_) | Outcome::Broken(_) => "1;31",
    };
    let mut out = format!("{}  {}", ink(code, word), finished.name);
    match &finished.outcome {
        Outcome::Passed | Outcome::Renewed => out.push('\n'),
        Outcome::KnownFailure(why) => {
            let _ = writeln!(out, ": {why}");
        }
        Outcome::Broken(error) => {
            out.push('\n');
            out.push_str(&indented(&rendered(error, colour), "  "));
        }
        Outcome::Failed(failure) => {
            out.push('\n');
            for error in &failure.errors {
                out.push_str(&indented(&rendered(error, colour), "  "));
            }
            out.push_str(&indented(&around(failure, true), "  "));
        }
    }
    out
}

fn rendered(error: &Error, colour: bool) -> String {
    if colour { error.render_coloured() } else { error.render() }
}

/// What stands beneath a failure's differences.
fn around(failure: &TestFailure, with_explanation: bool) -> String {
    let mut out = String::new();
    if !failure.pictures.is_empty() {
        out.push_str("pictures:\n");
        for path in &failure.pictures {
            let _ = writeln!(out, "  {}", path.display());
        }
    }
    if let Some(explanation) = failure.explanation.as_ref().filter(|_| with_explanation) {
        let _ = writeln!(out, "the ray, explained:\n{}", indented(explanation, "  ").trim_end());
    }
    if let Some(command) = &failure.command {
        let _ = writeln!(out, "see also: {command}");
    }
    out
}

fn indented(text: &str, by: &str) -> String {
    let line = |line: &str| if line.is_empty() { "\n".to_owned() } else { format!("{by}{line}\n") };
    text.lines().map(line).collect()
}

/// How many tests ended how.
pub fn summary(report: &SuiteReport) -> String {
    let count = |wanted: &str| report.finished.iter().filter(|one| one.outcome.word() == wanted).count();
    let (failed, broken) = (count("FAILED"), count("ERROR"));
    let mut parts = vec![format!("{} passed", count("ok"))];
    let mut more = |number: usize, word: &str| {
        if number > 0 {
            parts.push(format!("{number} {word}"));
        }
    };
    more(failed, "failed");
    more(broken, if broken == 1 { "error" } else { "errors" });
    more(count("known failure"), "known to fail");
    more(count("renewed"), "renewed");
    more(report.left_out, "not run");
    let mut out = format!("{}\n", parts.join(", "));
    for path in &report.renewed {
        let _ = writeln!(out, "written anew: {}", path.display());
    }
    out
}

/// What of the shaders and of ray tracing the suite has come to.
pub fn coverage(coverage: &Coverage) -> String {
    let [[lines, all_lines], [ways, all_ways]] = coverage.totals();
    let part = |some: usize, all: usize| match all {
        0 => "none known".to_owned(),
        _ => format!("{some} of {all} ({:.1} %)", 100.0 * some as f64 / all as f64),
    };
    let mut out = format!(
        "coverage\n  lines             {}\n  ways of branches  {}\n",
        part(lines, all_lines),
        part(ways, all_ways)
    );
    for (kind, uses) in coverage.rays.kinds() {
        if uses.is_empty() {
            continue;
        }
        let never: Vec<&str> =
            uses.iter().filter(|(_, count)| **count == 0).map(|(what, _)| what.as_str()).collect();
        let _ = writeln!(out, "  {kind:<17} {}", part(uses.len() - never.len(), uses.len()));
        // Short lists in full: hit groups and shaders of a whole repository only where never used.
        if !matches!(kind, "hit groups" | "miss shaders" | "callable shaders") {
            for (what, count) in uses.iter().filter(|(_, count)| **count > 0) {
                let _ = writeln!(out, "    {what}: {count}");
            }
        }
        for what in never.iter().take(NAMED) {
            let _ = writeln!(out, "    never: {what}");
        }
        if never.len() > NAMED {
            let _ = writeln!(out, "    and {} more never", never.len() - NAMED);
        }
    }
    let unknown = &coverage.without_lines;
    if !unknown.is_empty() {
        let _ = writeln!(
            out,
            "  {} without lines: compile with debug information (-g)",
            if unknown.len() == 1 { "1 module".into() } else { format!("{} modules", unknown.len()) }
        );
        for name in unknown.iter().take(NAMED) {
            let _ = writeln!(out, "    {name}");
        }
        if unknown.len() > NAMED {
            let _ = writeln!(out, "    and {} more", unknown.len() - NAMED);
        }
    }
    out
}

/// A test as a workflow command of GitHub, where it did not pass: an annotation on the line of the
/// shader that is to blame, or of the scene file. GitHub looks for files from the repository's
/// root, wherever the command runs: so paths in `root` are given from there.
pub fn github(finished: &Finished, root: Option<&Path>) -> String {
    let (errors, line): (&[Error], _) = match &finished.outcome {
        Outcome::Failed(failure) => (&failure.errors, failure.line.as_ref()),
        Outcome::Broken(error) => (std::slice::from_ref(error), None),
        _ => return String::new(),
    };
    let Some(error) = errors.first() else { return String::new() };
    let place = line.map(|line| (line.file.clone(), line.line)).or_else(|| place(error));
    let (file, line) = place.unwrap_or_else(|| (finished.file.display().to_string(), 1));
    let mut message = String::new();
    for error in errors {
        message.push_str(&error.render());
    }
    if let Outcome::Failed(failure) = &finished.outcome {
        message.push_str(&around(failure, false));
    }
    format!(
        "::error file={},line={line},title={}::{}\n",
        property(&from_root(&file, root)),
        property(&finished.name),
        escaped(message.trim_end())
    )
}

/// A path from a folder that holds it; as it is where none does.
fn from_root(file: &str, root: Option<&Path>) -> String {
    let inside = || {
        let root = root?.canonicalize().ok()?;
        let whole = Path::new(file).canonicalize().ok()?;
        let parts: Option<Vec<&str>> =
            whole.strip_prefix(root).ok()?.components().map(|part| part.as_os_str().to_str()).collect();
        Some(parts?.join("/"))
    };
    inside().unwrap_or_else(|| file.to_owned())
}

/// A text for the log of a GitHub workflow, which takes lines of it for commands, whatever blanks
/// stand in front of them: where it has such lines, commands are stopped while it is printed, until
/// a word that the text's author could not know.
pub fn github_log(text: &str) -> Cow<'_, str> {
    let is_command = |line: &str| ["::", "##["].iter().any(|start| line.trim_start().starts_with(start));
    // A carriage return ends a line there, too.
    if !text.split(['\n', '\r']).any(is_command) {
        return Cow::Borrowed(text);
    }
    let word = RandomState::new().hash_one(text);
    let end = if text.ends_with('\n') { "" } else { "\n" };
    Cow::Owned(format!("::stop-commands::{word:016x}\n{text}{end}::{word:016x}::\n"))
}

/// What a workflow command takes as its message.
fn escaped(text: &str) -> String {
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

/// What a workflow command takes as a property.
fn property(text: &str) -> String {
    escaped(text).replace(':', "%3A").replace(',', "%2C")
}

/// File and line of an error.
fn place(error: &Error) -> Option<(String, u32)> {
    error.places().find_map(|(place, _)| match place {
        Place::Text { file, text, span } => {
            let before = text.get(..span.start).unwrap_or(text);
            Some((file.clone(), before.matches('\n').count() as u32 + 1))
        }
        Place::Line { file, line, .. } => Some((file.clone(), *line)),
        Place::File(path) => Some((path.display().to_string(), 1)),
        _ => None,
    })
}

/// The suite as JSON: `version`, `tests`, the counts, and `coverage` where it was recorded.
pub fn json(report: &SuiteReport, with_coverage: bool) -> Value {
    let tests: Vec<Value> = report.finished.iter().map(test_json).collect();
    let count = |wanted: &str| report.finished.iter().filter(|one| one.outcome.word() == wanted).count();
    let mut all = json!({
        "version": VERSION,
        "tests": tests,
        "passed": count("ok"),
        "failed": count("FAILED"),
        "errors": count("ERROR"),
        "known_failures": count("known failure"),
        "renewed": count("renewed"),
        "not_run": report.left_out,
        "written": report.renewed.iter().map(|path| path.display().to_string()).collect::<Vec<_>>(),
    });
    if with_coverage {
        let [[lines, all_lines], [ways, all_ways]] = report.coverage.totals();
        let rays: serde_json::Map<String, Value> = report
            .coverage
            .rays
            .kinds()
            .into_iter()
            .map(|(kind, uses)| (kind.to_owned(), json!(uses)))
            .collect();
        all["coverage"] = json!({
            "lines": { "run": lines, "all": all_lines },
            "ways": { "taken": ways, "all": all_ways },
            "without_lines": report.coverage.without_lines,
            "rays": rays,
        });
    }
    all
}

fn test_json(finished: &Finished) -> Value {
    let outcome = match &finished.outcome {
        Outcome::Passed => "passed",
        Outcome::KnownFailure(_) => "known_failure",
        Outcome::Failed(_) => "failed",
        Outcome::Broken(_) => "error",
        Outcome::Renewed => "renewed",
    };
    let mut test = json!({
        "name": finished.name,
        "file": finished.file.display().to_string(),
        "outcome": outcome,
    });
    let error = |error: &Error| {
        let place = place(error).map(|(file, line)| json!({ "file": file, "line": line }));
        let mut told = json!({
            "message": error.message(),
            "class": error.class().name(),
            "at": place,
            "notes": error.notes(),
            "report": error.render(),
        });
        if let Some(trap) = error.trap() {
            told["trap"] = json!(trap);
        }
        told
    };
    match &finished.outcome {
        Outcome::Failed(failure) => {
            test["differences"] = failure.errors.iter().map(error).collect();
            test["line"] = json!(failure.line);
            test["explanation"] = json!(failure.explanation);
            test["command"] = json!(failure.command);
            let paths: Vec<String> = failure.pictures.iter().map(|path| path.display().to_string()).collect();
            test["pictures"] = json!(paths);
        }
        Outcome::Broken(one) => test["error"] = error(one),
        Outcome::KnownFailure(why) => test["why"] = json!(why),
        _ => {}
    }
    test
}
