//! Reports a smoke test as text and as JSON.

use std::fmt::Write;

use serde::Serialize;

use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorReport};
use anyhit_base::sorted::SortedSet;
use anyhit_sanitize::Findings;

/// Places of blocks that the text shows.
const SHOWN: usize = 8;

/// What became of an entry point, or of one of its runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SmokeVerdict {
    /// It ran to its end.
    Ok,
    /// It belongs to a stage that is out of scope.
    OutOfScope,
    /// It did something that the specifications leave undefined or forbid.
    Trap,
    /// Something in it is not supported.
    Unsupported,
    /// It exceeds a limit ([`InputLimit`](anyhit_base::input::InputLimit)).
    Limit,
    /// The module breaks a rule of SPIR-V or Vulkan.
    Invalid,
    /// This program has a bug.
    Bug,
}

/// A smoke test of a module.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
#[must_use]
pub struct SmokeReport {
    /// The seed of all values.
    pub seed: u64,
    /// In the module's order.
    #[doc(hidden)]
    pub entry_points: Vec<EntryReport>,
}

/// A smoke test of an entry point.
#[derive(Clone, Debug, Serialize)]
pub struct EntryReport {
    /// Its name.
    pub name: String,
    /// SPIR-V's name of its execution model.
    pub stage: &'static str,
    /// The worst of its runs, but for traps of one kind of geometry that are notes as another
    /// passes.
    pub result: SmokeVerdict,
    /// What is unsupported or invalid, where something is.
    pub reasons: Vec<String>,
    /// The errors behind the reasons.
    pub errors: Vec<ErrorReport>,
    /// What its runs reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage: Option<BlockCoverage>,
    /// Its runs; none where it cannot run.
    pub runs: Vec<RunReport>,
    /// What the sanitizer found, if it was asked: in the module alone, where it denies what is
    /// undefined; then on made-up inputs, where it only warns, and says so.
    #[serde(skip_serializing_if = "Findings::is_empty")]
    pub findings: Findings,
}

/// What all runs of an entry point reached.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct BlockCoverage {
    /// Blocks of the module that were entered.
    pub blocks_entered: usize,
    /// Blocks of the module that its branches and calls lead to.
    pub blocks: usize,
    /// Where the others begin: source lines, or words of the module where it holds no lines.
    pub blocks_not_entered: Vec<String>,
    /// Instructions that trace rays and were executed.
    pub trace_instructions_reached: usize,
    /// Instructions that trace rays.
    pub trace_instructions: usize,
    /// `OpRayQueryInitializeKHR` that were executed.
    pub query_instructions_reached: usize,
    /// All `OpRayQueryInitializeKHR`.
    pub query_instructions: usize,
    /// Rays that were traced.
    pub rays_traced: u64,
    /// Ray queries that began.
    pub ray_queries: u64,
    /// Any-hit shaders that ran.
    pub any_hits: u64,
    /// Hits that intersection shaders reported.
    pub reports: u64,
    /// Sets of values that were tried, for all kinds of geometry together.
    pub sets: u32,
    /// What ended the search for more: `fuel` or `time`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut_short: Option<&'static str>,
}

impl BlockCoverage {
    /// Whether every block was entered.
    pub fn is_whole(&self) -> bool {
        self.blocks_entered == self.blocks
    }

    /// Whether at least so many percent of the blocks were entered.
    pub fn is_at_least(&self, percent: f64) -> bool {
        self.blocks_entered as f64 * 100.0 >= self.blocks as f64 * percent
    }

    /// Writing to a string does not fail.
    fn write(&self, out: &mut String) {
        let many = |count: u64, one: &str, several: &str| match count {
            1 => format!("1 {one}"),
            _ => format!("{} {several}", grouped(count)),
        };
        let mut parts = Vec::new();
        if self.trace_instructions > 0 {
            let rays = many(self.rays_traced, "ray", "rays");
            let (reached, all) = (self.trace_instructions_reached, self.trace_instructions);
            let reached = grouped(reached);
            parts.push(format!("{rays} traced by {reached} of {}", many(all as u64, "trace", "traces")));
        }
        if self.query_instructions > 0 {
            let queries = many(self.ray_queries, "ray query", "ray queries");
            let (reached, all) = (self.query_instructions_reached, self.query_instructions);
            let all = many(all as u64, "OpRayQueryInitializeKHR", "OpRayQueryInitializeKHR");
            parts.push(format!("{queries} initialised by {} of {all}", grouped(reached)));
        }
        if self.any_hits > 0 {
            parts.push(many(self.any_hits, "any-hit shader run", "any-hit shaders run"));
        }
        if self.reports > 0 {
            parts.push(many(self.reports, "hit reported", "hits reported"));
        }
        let sets = many(self.sets.into(), "set of values", "sets of values");
        let _ = writeln!(
            out,
            "  reached {} of {}{} with {sets}",
            grouped(self.blocks_entered),
            many(self.blocks as u64, "block", "blocks"),
            parts.iter().fold(String::new(), |text, part| text + ", " + part),
        );
        if let Some(what) = self.cut_short {
            let _ = writeln!(out, "  stopped trying sets of values: the {what} is exhausted");
        }
        let missing = &self.blocks_not_entered;
        if !missing.is_empty() {
            let shown = &missing[..missing.len().min(SHOWN)];
            let more = missing.len() - shown.len();
            let more = if more > 0 { format!(" and {} more", grouped(more)) } else { String::new() };
            let _ = writeln!(out, "  not reached: {}{more}", shown.join(", "));
        }
    }
}

/// One way in which an entry point was run.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// What it was called for: `launch`, `dispatch`, `ray`, `call`, or the kind of geometry.
    pub with: &'static str,
    /// What became of it.
    pub result: SmokeVerdict,
    /// Where it trapped.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trap: Option<SmokeTrap>,
    /// Which values made it trap where others did not, a line for each trap; for a trap that does
    /// not count, why.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// A trap with its place.
#[derive(Clone, Debug, Serialize)]
pub struct SmokeTrap {
    /// What happened, and the rule.
    pub rule: String,
    /// The source file, where the module names it.
    pub file: Option<String>,
    /// The line in it, from 1.
    pub line: Option<u32>,
    /// The instruction, in words from the start of the module.
    pub word: u32,
    /// The trap as an error: its message is the rule, its notes tell what was accessed, in which
    /// function, and who called it.
    #[serde(flatten)]
    pub error: ErrorReport,
}

impl SmokeTrap {
    pub(super) fn of(error: &Error, word: u32) -> Self {
        let (file, line) = error.places().find_map(|(place, _)| place.file_line()).unzip();
        let file = file.map(str::to_owned);
        Self { rule: error.message().to_owned(), file, line, word, error: ErrorReport::of(error) }
    }
}

impl SmokeReport {
    /// Whether every entry point that is in scope ran to its end.
    #[must_use]
    pub fn is_ok(&self) -> bool {
        self.entry_points.iter().all(|entry| entry.result <= SmokeVerdict::OutOfScope)
    }

    /// The worst of all.
    #[doc(hidden)]
    pub fn worst(&self) -> SmokeVerdict {
        self.entry_points.iter().map(|entry| entry.result).max().unwrap_or(SmokeVerdict::Ok)
    }

    /// The report for people.
    #[must_use]
    pub fn text(&self) -> String {
        let mut out = String::new();
        let mut told = SortedSet::new();
        for entry in &self.entry_points {
            entry.write(&mut out, &mut told);
        }
        if self.entry_points.is_empty() {
            out.push_str("no entry points\n");
        }
        out
    }
}

impl EntryReport {
    /// Writing to a string does not fail. A trap that was reported before is only named.
    fn write(&self, out: &mut String, told: &mut SortedSet<(u32, String)>) {
        let reached = self.coverage.as_ref().filter(|reached| !reached.is_whole());
        let part = reached.filter(|_| self.result == SmokeVerdict::Ok).map_or_else(String::new, |reached| {
            let [entered, blocks] = [reached.blocks_entered, reached.blocks].map(grouped);
            format!(", reached {entered} of {blocks} blocks")
        });
        let _ = writeln!(out, "{} `{}`: {}{part}", self.stage, self.name, self.result.words());
        for reason in &self.reasons {
            let _ = writeln!(out, "  - {reason}");
        }
        if let Some(reached) = &self.coverage {
            reached.write(out);
        }
        for finding in &self.findings {
            for line in finding.render().trim_end().lines() {
                let _ = writeln!(out, "  {line}");
            }
        }
        let mut written = vec![false; self.runs.len()];
        for (at, run) in self.runs.iter().enumerate() {
            let is_told = run.result != SmokeVerdict::Ok || run.note.is_some();
            if !is_told || std::mem::replace(&mut written[at], true) {
                continue;
            }
            // Kinds of geometry that end alike stand together.
            let mut with = vec![run.with];
            for (other, written) in self.runs.iter().zip(&mut written).skip(at + 1) {
                let same = |run: &RunReport| run.trap.as_ref().map(|trap| (trap.word, trap.rule.clone()));
                if (other.result, same(other)) == (run.result, same(run))
                    && (run.trap.is_some() || other.note == run.note)
                {
                    *written = true;
                    with.push(other.with);
                }
            }
            let words = if run.is_note() { "a note" } else { run.result.words() };
            let _ = writeln!(out, "  {}: {words}", with.join(", "));
            for line in run.note.iter().flat_map(|note| note.lines()) {
                let _ = writeln!(out, "    {line}");
            }
            let Some(trap) = &run.trap else { continue };
            if !told.insert((trap.word, trap.rule.clone())) {
                let _ = writeln!(out, "    the trap at word {} reported above: {}", trap.word, trap.rule);
                continue;
            }
            for line in trap.error.report.lines() {
                let _ = writeln!(out, "    {line}");
            }
        }
    }
}

impl RunReport {
    /// Whether it trapped, but that does not count.
    pub fn is_note(&self) -> bool {
        self.result == SmokeVerdict::Trap && self.note.is_some()
    }
}

impl SmokeVerdict {
    fn words(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::OutOfScope => "out of scope",
            Self::Trap => "trap",
            Self::Unsupported => "NOT SUPPORTED",
            Self::Limit => "limit",
            Self::Invalid => "invalid",
            Self::Bug => "BUG IN ANYHIT",
        }
    }
}
