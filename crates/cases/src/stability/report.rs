//! Reports the findings as text and as JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::stability::SourceLocation;
use crate::stability::found::{LineFindings, ShadowFindings};
use crate::stability::instability::{DecisionKind, Instability, Perturbation};
use anyhit_base::count::grouped;
use anyhit_base::error::Error;

impl ShadowFindings {
    /// A table of the significant lines, worst first.
    pub fn text(&self) -> String {
        let lines = self.sorted();
        let significant: Vec<_> = lines.iter().filter(|(_, found)| found.is_significant()).collect();
        let mut text = format!(
            "shadow in f64: {} float results on {} lines; {}\n",
            grouped(self.results),
            grouped(lines.len()),
            match significant.len() {
                0 => "no line loses much precision, and no decision changes".to_owned(),
                1 => "1 line needs attention".to_owned(),
                count => format!("{} lines need attention", grouped(count)),
            }
        );
        let width = significant.iter().map(|(location, _)| location.label().len()).max().unwrap_or(0);
        if !significant.is_empty() {
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "\n  {:width$}    error  bits lost  cancelled  comparisons  branches  integers  hits",
                "line"
            );
        }
        for (location, found) in significant {
            let _ = writeln!(
                text,
                "  {:width$}  {:>7}  {:>9.0}  {:>9}  {:>11}  {:>8}  {:>8}  {:>4}{}",
                location.label(),
                format!("{:.1e}", found.error),
                found.bits_lost,
                grouped(found.cancellations),
                grouped(found.comparisons),
                grouped(found.branches),
                grouped(found.integers),
                grouped(found.hits),
                notes(location, found)
            );
        }
        text
    }

    /// All lines, worst first.
    pub fn json(&self, trap: Option<&Error>) -> Value {
        let line = |(location, found): (&SourceLocation, &LineFindings)| {
            json!({
                "file": location.file,
                "line": location.line,
                "text": location.text,
                "results": found.results,
                "relative_error": found.error,
                "worst_launch_id": found.launch_id,
                "bits_lost": found.bits_lost,
                "cancellations": found.cancellations,
                "not_finite": found.not_finite,
                "comparisons_flipped": found.comparisons,
                "branches_flipped": found.branches,
                "integers_changed": found.integers,
                "hits_changed": found.hits,
                "read_back": found.read_back,
                "storage_bits": found.storage_bits,
                "matters": found.is_significant(),
            })
        };
        let lines: Vec<Value> = self.sorted().into_iter().map(line).collect();
        json!({ "results": self.results, "lines": lines, "trap": trap.map(Error::render) })
    }
}

/// The notes beneath a row: the source line, and the launch index of the greatest error.
fn notes(location: &SourceLocation, found: &LineFindings) -> String {
    let mut text = String::new();
    if found.not_finite > 0 {
        let _ = write!(
            text,
            "\n      {} infinite or NaN either here or in f64, but not in both",
            grouped(found.not_finite)
        );
    }
    if found.read_back > 0 {
        let _ = write!(
            text,
            "\n      {} read back after rounding in storage of {} bits",
            grouped(found.read_back),
            found.storage_bits
        );
    }
    if let (Some(source), true) = (&location.text, location.line > 0) {
        let _ = write!(text, "\n      {source}");
    }
    if let Some([x, y, z]) = found.launch_id {
        let _ = write!(text, "\n      worst at ({x}, {y}, {z})");
    }
    text
}

impl Perturbation {
    /// `16 runs with every float result moved within what Vulkan allows, seed 1`
    pub fn describe(&self) -> String {
        let Self { runs, first_run, seed, envelope, .. } = self;
        let runs = match (first_run, runs) {
            (1, 1) => "1 run".to_owned(),
            (1, runs) => format!("{} runs", grouped(runs)),
            (first, runs) => format!("runs {first} to {runs}"),
        };
        format!(
            "{runs} with every float result perturbed within what {} allows, seed {seed}",
            envelope.name()
        )
    }
}

impl Instability {
    /// The instabilities as text; one line if everything is stable.
    pub fn text(&self) -> String {
        let head = self.perturbation.describe();
        if self.is_stable() && self.branches.is_empty() {
            return format!("{head}: {}\n", self.stable_text());
        }
        let mut text = format!("{head}:\n");
        if self.is_stable() {
            let _ = writeln!(text, "  {}", self.stable_text());
        }
        for line in self.lines() {
            let _ = writeln!(text, "  {line}");
        }
        text
    }

    /// Says that all outputs are stable.
    fn stable_text(&self) -> String {
        match self.output_count {
            1 => "the output is stable".to_owned(),
            count => format!("all {} outputs are stable", grouped(count)),
        }
    }

    /// One sentence for each output, branch and ray that is not stable.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = self.output_lines();
        lines.extend(self.branch_lines());
        lines
    }

    /// One sentence for each output that is not stable.
    pub fn output_lines(&self) -> Vec<String> {
        let output = |one: &super::instability::UnstableOutput| {
            let more = if one.values > 1 {
                format!(" (and {} more values)", grouped(one.values - 1))
            } else {
                String::new()
            };
            format!(
                "output {}{more}: {} unperturbed, {} in run {}{}",
                one.name,
                one.reference,
                one.other,
                one.run,
                if one.difference.is_finite() {
                    format!(", off by {:.1e}", one.difference)
                } else {
                    String::new()
                }
            )
        };
        let mut lines: Vec<String> = self.outputs.iter().map(output).collect();
        lines.extend(self.traps.iter().map(|(run, trap)| format!("run {run} traps: {}", trap.message())));
        lines
    }

    /// One sentence for each branch and each traced ray that is not stable.
    pub fn branch_lines(&self) -> Vec<String> {
        let branch = |(decision, count): (&(SourceLocation, DecisionKind), &u64)| {
            let (location, kind) = decision;
            let source = match (&location.text, location.line) {
                (Some(text), 1..) => format!(": {text}"),
                _ => String::new(),
            };
            let what = match kind {
                DecisionKind::Branch => "branch",
                DecisionKind::Hit => "hit of the ray traced",
            };
            let (place, count) = (location.label(), grouped(count));
            format!("{what} at {place} changes first in {count} perturbed invocations{source}")
        };
        self.branches.iter().map(branch).collect()
    }

    /// Returns the findings as JSON.
    pub fn json(&self) -> Value {
        let outputs: Vec<Value> = self
            .outputs
            .iter()
            .map(|one| {
                json!({
                    "name": one.name,
                    "values": one.values,
                    "reference": one.reference,
                    "other": one.other,
                    "run": one.run,
                    "difference": one.difference,
                })
            })
            .collect();
        let branches: Vec<Value> = self
            .branches
            .iter()
            .map(|((location, kind), count)| {
                json!({
                    "file": location.file,
                    "line": location.line,
                    "text": location.text,
                    "what": match kind { DecisionKind::Branch => "branch", DecisionKind::Hit => "hit" },
                    "count": count,
                })
            })
            .collect();
        let traps: Vec<Value> = self
            .traps
            .iter()
            .map(|(run, trap)| json!({ "run": run, "trap": trap.render(), "class": trap.class().name() }))
            .collect();
        json!({
            "runs": self.perturbation.runs,
            "first_run": self.perturbation.first_run,
            "seed": self.perturbation.seed,
            "envelope": self.perturbation.envelope.name(),
            "stable": self.is_stable(),
            "outputs": outputs,
            "branches": branches,
            "traps": traps,
        })
    }
}
