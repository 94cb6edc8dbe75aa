//! Coverage: which lines and branches of the shaders' sources ran, and which ways rays went.
//!
//! Nothing is instrumented. A [`Recorder`] observes a launch or a ray as an
//! [`Observer`](anyhit_engine::machine::Observer): how many lanes entered each block of a program,
//! and took each edge of a branch. What a block runs of its module is known from lowering
//! ([`Program::instruction_spans`](anyhit_engine::program::Program)), and its lines from debug
//! information. A line that only an eliminated instruction stands on has run where its block has.

mod cobertura;
mod lcov;
mod rays;
mod recorder;

use std::path::Path;

use serde::{Deserialize, Serialize};

use anyhit_base::escape;
use anyhit_base::sorted::{SortedMap, SortedSet};

pub use rays::{RayCounts, Use};
pub use recorder::Recorder;

/// What a suite has covered.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coverage {
    /// By source file, named as it is found from the current folder.
    pub files: SortedMap<String, FileCoverage>,
    /// Modules that know no lines: nothing is known of them.
    pub without_lines: SortedSet<String>,
    /// Which ways rays went.
    pub rays: RayCounts,
}

/// What is covered of a source file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileCoverage {
    /// How often a line ran, by its number from 1.
    pub lines: SortedMap<u32, u64>,
    /// How often each way of a branch was taken; `None` where the branch was never reached.
    #[serde(with = "crate::pairs")]
    pub branches: SortedMap<Edge, Option<u64>>,
    /// How often a function was entered, by its first line and its name.
    #[serde(with = "crate::pairs")]
    pub functions: SortedMap<(u32, String), u64>,
}

/// One way of a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Edge {
    /// The line that the branch stands on.
    pub line: u32,
    /// Which branch of the line, from 0.
    pub branch: u32,
    /// Which way: 0 where the condition holds and 1 where not, or the case's place, the default
    /// last.
    pub way: u32,
}

/// Adds to a count, which a file may hold as large as it likes.
fn add(sum: &mut u64, count: u64) {
    *sum = sum.saturating_add(count);
}

/// Lines that ran, and all; ways of branches that were taken, and all.
fn sum<'f>(files: impl Iterator<Item = &'f FileCoverage> + Clone) -> [[usize; 2]; 2] {
    let lines = files.clone().flat_map(|file| file.lines.values());
    let ways = files.flat_map(|file| file.branches.values());
    [
        [lines.clone().filter(|count| **count > 0).count(), lines.count()],
        [ways.clone().filter(|taken| taken.is_some_and(|taken| taken > 0)).count(), ways.count()],
    ]
}

impl FileCoverage {
    /// As [`Coverage::totals`], of one file.
    pub fn totals(&self) -> [[usize; 2]; 2] {
        sum(std::iter::once(self))
    }
}

impl Coverage {
    /// Adds what another part of the suite has covered.
    pub fn add(&mut self, other: Self) {
        for (name, file) in other.files {
            let sum = self.files.entry(name).or_default();
            for (line, count) in file.lines {
                add(sum.lines.entry(line).or_default(), count);
            }
            for (edge, taken) in file.branches {
                let known = sum.branches.entry(edge).or_default();
                *known = match (*known, taken) {
                    (Some(one), Some(other)) => Some(one.saturating_add(other)),
                    (one, other) => one.or(other),
                };
            }
            for (function, count) in file.functions {
                add(sum.functions.entry(function).or_default(), count);
            }
        }
        self.without_lines.extend(other.without_lines);
        self.rays.add(other.rays);
    }

    /// Lines that ran, and all; ways of branches that were taken, and all.
    pub fn totals(&self) -> [[usize; 2]; 2] {
        sum(self.files.values())
    }

    /// Returns the text of a file: XML of Cobertura where its name ends in `.xml`, else an lcov
    /// tracefile.
    pub fn text_for(&self, path: &Path) -> String {
        match path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xml")) {
            true => {
                let folder = std::env::current_dir().unwrap_or_default();
                self.cobertura(&escape::path(&folder).to_string())
            }
            false => self.lcov(),
        }
    }
}
