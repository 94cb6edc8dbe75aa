//! The findings of the shadow interpreter, by source line.

use serde::{Deserialize, Serialize};

use crate::stability::place::SourceLocation;
use anyhit_base::sorted::{SortedMap, sort_by};

/// Lines whose worst relative error is greater are reported even without other findings.
pub const REPORTED_ERROR: f64 = 1e-4;

/// The findings of a shadow run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShadowFindings {
    /// Float results that were compared.
    pub results: u64,
    /// The findings by source line.
    #[serde(with = "crate::pairs")]
    pub lines: SortedMap<SourceLocation, LineFindings>,
}

/// The findings on one source line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LineFindings {
    /// Float results that were compared.
    pub results: u64,
    /// The greatest relative error of a result: the difference divided by the greater magnitude.
    pub error: f64,
    /// The launch index of the first invocation with that error.
    pub launch_id: Option<[u32; 3]>,
    /// The most bits that one operation lost: the base-2 logarithm of its result's error divided by
    /// its worst operand's.
    pub bits_lost: f64,
    /// Sums and differences that lost more than 8 bits.
    pub cancellations: u64,
    /// Results of which either the f32 value or the shadow is infinite or NaN.
    pub not_finite: u64,
    /// Comparisons that the shadow decides differently.
    pub comparisons: u64,
    /// Branches that the shadow would take differently.
    pub branches: u64,
    /// Conversions to integers with a different result.
    pub integers: u64,
    /// Rays whose shadow hits a different primitive.
    pub hits: u64,
    /// Floats read from an image or buffer that its storage had rounded, beyond what is reported.
    #[serde(default)]
    pub read_back: u64,
    /// The least bits that such a float was stored in; 0 where there was none.
    #[serde(default)]
    pub storage_bits: u32,
}

impl LineFindings {
    /// Whether a report shows the line.
    pub fn is_significant(&self) -> bool {
        self.flips() > 0 || self.cancellations > 0 || self.not_finite > 0 || self.error > REPORTED_ERROR
    }

    /// The number of decisions that differ.
    pub fn flips(&self) -> u64 {
        [self.comparisons, self.branches, self.integers, self.hits].into_iter().fold(0, u64::saturating_add)
    }

    /// Adds the findings of another run.
    pub fn add(&mut self, other: &Self) {
        if other.error > self.error {
            (self.error, self.launch_id) = (other.error, other.launch_id);
        }
        self.bits_lost = self.bits_lost.max(other.bits_lost);
        self.results = self.results.saturating_add(other.results);
        self.cancellations = self.cancellations.saturating_add(other.cancellations);
        self.not_finite = self.not_finite.saturating_add(other.not_finite);
        self.comparisons = self.comparisons.saturating_add(other.comparisons);
        self.branches = self.branches.saturating_add(other.branches);
        self.integers = self.integers.saturating_add(other.integers);
        self.hits = self.hits.saturating_add(other.hits);
        self.read_back = self.read_back.saturating_add(other.read_back);
        self.storage_bits = match (self.storage_bits, other.storage_bits) {
            (0, bits) | (bits, 0) => bits,
            (one, other) => one.min(other),
        };
    }
}

impl ShadowFindings {
    /// Adds the findings of another run.
    pub fn add(&mut self, other: &Self) {
        self.results = self.results.saturating_add(other.results);
        for (location, found) in &other.lines {
            self.lines.entry(location.clone()).or_default().add(found);
        }
    }

    /// The lines, worst first: by decisions that flip, then by lost bits, then by error.
    pub fn sorted(&self) -> Vec<(&SourceLocation, &LineFindings)> {
        let mut lines: Vec<_> = self.lines.iter().collect();
        sort_by(&mut lines, |(_, one), (_, other)| {
            let key =
                |found: &LineFindings| (found.flips() > 0, found.cancellations > 0 || found.not_finite > 0);
            key(other)
                .cmp(&key(one))
                .then(other.bits_lost.total_cmp(&one.bits_lost))
                .then(other.error.total_cmp(&one.error))
        });
        lines
    }
}
