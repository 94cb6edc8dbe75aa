//! What a smoke test found, as text and as JSON.

use std::fmt::Write;

use serde::Serialize;

use crate::error::{Error, Place};

/// What became of an entry point, or of one of its runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It ran to its end.
    Ok,
    /// It belongs to a stage that is out of scope.
    OutOfScope,
    /// It did something that the specifications leave undefined or forbid.
    Trap,
    /// Something in it is not supported.
    Unsupported,
    /// The module breaks a rule of SPIR-V or Vulkan.
    Invalid,
    /// This program has a bug.
    Bug,
}

/// A smoke test of a module.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The seed of all values.
    pub seed: u64,
    /// In the module's order.
    pub entry_points: Vec<EntryReport>,
}

/// A smoke test of an entry point.
#[derive(Clone, Debug, Serialize)]
pub struct EntryReport {
    /// Its name.
    pub name: String,
    /// SPIR-V's name of its execution model.
    pub stage: &'static str,
    /// The worst of its runs.
    pub result: Verdict,
    /// What is unsupported or invalid, where something is.
    pub reasons: Vec<String>,
    /// Its runs; none where it cannot run.
    pub runs: Vec<Run>,
}

/// One run of an entry point.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// What it was called for: `launch`, `dispatch`, `ray`, `call`, or the kind of geometry.
    pub with: &'static str,
    /// What became of it.
    pub result: Verdict,
    /// Where it trapped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trap: Option<TrapReport>,
    /// Which values it needed to run to its end, where the first did not do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// A trap with its place.
#[derive(Clone, Debug, Serialize)]
pub struct TrapReport {
    /// What happened, and the rule.
    pub rule: String,
    /// The source file, where the module names it.
    pub file: Option<String>,
    /// The line in it, from 1.
    pub line: Option<u32>,
    /// The instruction, in words from the start of the module.
    pub word: u32,
    /// What was accessed, in which function, who called it.
    pub notes: Vec<String>,
    /// The report for people.
    #[serde(skip)]
    pub text: String,
}

impl TrapReport {
    pub(super) fn of(error: &Error, word: u32) -> Self {
        let line = error.places().find_map(|(place, _)| match place {
            Place::Text { file, text, span } => {
                let before = text.get(..span.start).unwrap_or(text);
                Some((file.clone(), before.matches('\n').count() as u32 + 1))
            }
            Place::Line { file, line, .. } => Some((file.clone(), *line)),
            _ => None,
        });
        let (file, line) = line.unzip();
        Self {
            rule: error.message().to_owned(),
            file,
            line,
            word,
            notes: error.notes().to_vec(),
            text: error.render(),
        }
    }
}

impl Report {
    /// Whether every entry point that is in scope ran to its end.
    pub fn is_ok(&self) -> bool {
        self.entry_points.iter().all(|entry| entry.result <= Verdict::OutOfScope)
    }

    /// The worst of all.
    pub fn worst(&self) -> Verdict {
        self.entry_points.iter().map(|entry| entry.result).max().unwrap_or(Verdict::Ok)
    }

    /// The report for people.
    pub fn text(&self) -> String {
        let mut out = String::new();
        for entry in &self.entry_points {
            entry.write(&mut out);
        }
        if self.entry_points.is_empty() {
            out.push_str("no entry points\n");
        }
        out
    }
}

impl EntryReport {
    /// Writing to a string does not fail.
    fn write(&self, out: &mut String) {
        let _ = writeln!(out, "{} `{}`: {}", self.stage, self.name, self.result.words());
        for reason in &self.reasons {
            let _ = writeln!(out, "  - {reason}");
        }
        for run in &self.runs {
            if run.result != Verdict::Ok || run.note.is_some() {
                let _ = writeln!(out, "  {}: {}", run.with, run.result.words());
            }
            for line in run.trap.iter().flat_map(|trap| trap.text.lines()) {
                let _ = writeln!(out, "    {line}");
            }
            if let Some(note) = &run.note {
                let _ = writeln!(out, "    {note}");
            }
        }
    }
}

impl Verdict {
    fn words(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::OutOfScope => "out of scope",
            Self::Trap => "trap",
            Self::Unsupported => "NOT SUPPORTED",
            Self::Invalid => "invalid",
            Self::Bug => "BUG IN ANYHIT",
        }
    }
}
