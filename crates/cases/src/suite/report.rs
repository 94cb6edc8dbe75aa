//! Reports a suite: as text, as annotations for GitHub, as JSON.

use std::fmt::Write;

use serde_json::{Value, json};

use crate::coverage::Coverage;
use crate::source_tree::SourceTree;
use crate::suite::{Ended, Finished, Outcome, Problem, SuiteResult, TestFailure, TestResult};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, Place};
use anyhit_base::escape;
use anyhit_base::sorted::json_object;
use anyhit_base::style::Style;

/// The version of the JSON.
pub const VERSION: u32 = 1;

/// How many of a long list are named.
const NAMED: usize = 12;

/// A test that has run, as lines: its name and outcome, and beneath a failure all about it.
pub fn text(finished: &Finished, colour: bool) -> String {
    let word = finished.outcome.ended().word();
    let style = match &finished.outcome {
        Outcome::Passed => Style::Good,
        Outcome::KnownFailure(_) | Outcome::Renewed => Style::Warning,
        Outcome::Failed(_) | Outcome::Broken(_) => Style::Bad,
    };
    let mut out = format!("{}  {}", style.paint(word, colour), finished.name);
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
            let explanation = match colour {
                true => failure.coloured_explanation.as_ref().or(failure.explanation.as_ref()),
                false => failure.explanation.as_ref(),
            };
            out.push_str(&indented(&around(failure, explanation), "  "));
        }
    }
    out
}

fn rendered(error: &Error, colour: bool) -> String {
    if colour { error.render_coloured() } else { error.render() }
}

/// What stands beneath a failure's differences.
fn around(failure: &TestFailure, explanation: Option<&String>) -> String {
    let mut out = String::new();
    if !failure.pictures.is_empty() {
        out.push_str("pictures:\n");
        for path in &failure.pictures {
            let _ = writeln!(out, "  {}", escape::path(&path));
        }
    }
    match explanation {
        Some(explanation) => {
            let what = if failure.is_dispatch { "invocation" } else { "ray" };
            let _ = writeln!(out, "the {what}, explained:\n{}", indented(explanation, "  ").trim_end());
        }
        // The explanation has them, too.
        None => failure.hints.iter().for_each(|hint| {
            let _ = writeln!(out, "hint: {}", hint.text);
        }),
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

/// The tests that did not pass, by name; nothing where all did.
pub fn failed(result: &SuiteResult) -> String {
    let failed = result.tests.iter().filter(|test| matches!(test.ended, Ended::Failed | Ended::Error));
    let lines: String =
        failed.map(|test| format!("  {:<6}  {}\n", test.ended.word(), escape::line(&test.name))).collect();
    if lines.is_empty() { lines } else { format!("\ndid not pass:\n{lines}\n") }
}

/// How many tests ended how.
pub fn summary(result: &SuiteResult) -> String {
    let (failed, broken) = (result.count(Ended::Failed), result.count(Ended::Error));
    let mut parts = vec![format!("{} passed", grouped(result.count(Ended::Passed)))];
    let mut more = |number: usize, word: &str| {
        if number > 0 {
            parts.push(format!("{} {word}", grouped(number)));
        }
    };
    more(failed, "failed");
    more(broken, if broken == 1 { "error" } else { "errors" });
    more(result.count(Ended::KnownFailure), "known to fail");
    more(result.count(Ended::Renewed), "renewed");
    more(result.left_out, "not run");
    let mut out = format!("{}\n", parts.join(", "));
    for path in &result.written {
        let _ = writeln!(out, "renewed: {path}");
    }
    out
}

/// What of the shaders and of ray tracing the suite has come to.
pub fn coverage(coverage: &Coverage) -> String {
    let [[lines, all_lines], [ways, all_ways]] = coverage.totals();
    let part = |some: usize, all: usize| match all {
        0 => "none known".to_owned(),
        _ => {
            let percent = 100.0 * some as f64 / all as f64;
            format!("{} of {} ({percent:.1} %)", grouped(some), grouped(all))
        }
    };
    let mut out = format!(
        "coverage\n  lines             {}\n  branch directions {}\n",
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
                let _ = writeln!(out, "    {what}: {}", grouped(count));
            }
        }
        for what in never.iter().take(NAMED) {
            let _ = writeln!(out, "    never: {what}");
        }
        if never.len() > NAMED {
            let _ = writeln!(out, "    and {} more", grouped(never.len() - NAMED));
        }
    }
    let unknown = &coverage.without_lines;
    if !unknown.is_empty() {
        let _ = writeln!(
            out,
            "  {} without lines: compile with debug information (-g)",
            if unknown.len() == 1 {
                "1 module".into()
            } else {
                format!("{} modules", grouped(unknown.len()))
            }
        );
        for name in unknown.iter().take(NAMED) {
            let _ = writeln!(out, "    {name}");
        }
        if unknown.len() > NAMED {
            let _ = writeln!(out, "    and {} more", grouped(unknown.len() - NAMED));
        }
    }
    out
}

/// The report of a test that did not pass, at the line of the shader that caused it or else of the
/// scene file. `tree` is the repository, from whose root other tools look for files.
pub(super) fn problem(finished: &Finished, tree: &SourceTree) -> Option<Problem> {
    let (errors, line): (&[Error], _) = match &finished.outcome {
        Outcome::Failed(failure) => (&failure.errors, failure.line.as_ref()),
        Outcome::Broken(error) => (std::slice::from_ref(error), None),
        _ => return None,
    };
    let error = errors.first()?;
    let place = line.map(|line| (line.file.clone(), line.line)).or_else(|| place(error));
    let (file, line) = place.unwrap_or_else(|| (escape::path(&finished.file).to_string(), 1));
    let mut places = errors.iter().flat_map(Error::places).map(|(place, _)| place);
    let columns = places.find(|place| place.file_line() == Some((&*file, line))).and_then(Place::columns);
    let mut report = String::new();
    for error in errors {
        report.push_str(&error.render());
    }
    if let Outcome::Failed(failure) = &finished.outcome {
        report.push_str(&around(failure, None));
    }
    Some(Problem { path: tree.path_of(&file, Some(&finished.file)), line, columns, report })
}

/// A test that did not pass as a workflow command of GitHub: an annotation of a line.
pub fn github(test: &TestResult) -> Option<String> {
    let problem = test.problem.as_ref()?;
    Some(format!(
        "::error file={},line={}{},title={}::{}\n",
        escape::workflow_property(&problem.path),
        problem.line,
        problem.columns.map_or_else(String::new, |columns| format!(",col={}", columns.start)),
        escape::workflow_property(&test.name),
        escape::workflow_message(problem.report.trim_end())
    ))
}

/// File and line of an error.
fn place(error: &Error) -> Option<(String, u32)> {
    error.places().find_map(|(place, _)| match place {
        Place::File(path) => Some((escape::path(&path).to_string(), 1)),
        place => place.file_line().map(|(file, line)| (file.to_owned(), line)),
    })
}

/// The suite as JSON: `version`, `tests`, the counts, and `coverage` where it was recorded.
pub fn json(result: &SuiteResult) -> Value {
    let tests: Vec<&Value> = result.tests.iter().map(|test| &test.json).collect();
    let mut all = json!({
        "version": VERSION,
        "tests": tests,
        "passed": result.count(Ended::Passed),
        "failed": result.count(Ended::Failed),
        "errors": result.count(Ended::Error),
        "known_failures": result.count(Ended::KnownFailure),
        "renewed": result.count(Ended::Renewed),
        "not_run": result.left_out,
        "written": result.written,
    });
    if let Some(coverage) = &result.coverage {
        let [[lines, all_lines], [ways, all_ways]] = coverage.totals();
        let rays =
            json_object(coverage.rays.kinds().into_iter().map(|(kind, uses)| (kind.to_owned(), json!(uses))));
        all["coverage"] = json!({
            "lines": { "run": lines, "all": all_lines },
            "ways": { "taken": ways, "all": all_ways },
            "without_lines": coverage.without_lines,
            "rays": rays,
        });
    }
    let notes = result.notes();
    if !notes.is_empty() {
        all["notes"] = json!(notes);
    }
    all
}

/// A test as an object of the suite's JSON, with paths from the current folder `here`.
pub(super) fn test_json(finished: &Finished, here: &SourceTree) -> Value {
    let path_of = |file: &str| here.path_of(file, Some(&finished.file));
    let mut test = json!({
        "name": finished.name,
        "file": path_of(&escape::path(&finished.file).to_string()),
        "outcome": finished.outcome.ended(),
    });
    let error = |error: &Error| {
        let place = place(error).map(|(file, line)| json!({ "file": path_of(&file), "line": line }));
        let mut report = json!({
            "message": error.message(),
            "class": error.class().name(),
            "at": place,
            "notes": error.notes(),
            "report": error.render(),
        });
        if let Some(trap) = error.trap() {
            report["trap"] = json!(trap);
        }
        report
    };
    match &finished.outcome {
        Outcome::Failed(failure) => {
            test["differences"] = failure.errors.iter().map(error).collect();
            test["line"] = json!(failure.line);
            if let Some(line) = &failure.line {
                test["line"]["file"] = path_of(&line.file).into();
            }
            test["explanation"] = json!(failure.explanation);
            test["hints"] = json!(failure.hints);
            test["command"] = json!(failure.command);
            let paths: Vec<String> =
                failure.pictures.iter().map(|path| escape::path(&path).to_string()).collect();
            test["pictures"] = json!(paths);
        }
        Outcome::Broken(one) => test["error"] = error(one),
        Outcome::KnownFailure(why) => test["why"] = json!(why),
        _ => {}
    }
    test
}
