//! What the f64 shadow of a run showed, line by line.

use std::collections::BTreeMap;

use crate::harness::stability::place::Spot;

/// Lines whose worst relative error is greater are reported even without other findings.
pub const ERROR: f64 = 1e-4;

/// What the shadow of a run showed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shadow {
    /// Float results that were compared.
    pub results: u64,
    /// By line.
    pub lines: BTreeMap<Spot, LineFindings>,
}

/// What the shadow showed on one line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineFindings {
    /// Float results of the line.
    pub results: u64,
    /// The greatest relative error of a result: the difference by the greater magnitude.
    pub error: f64,
    /// The invocation of ray generation (or of a dispatch, its first) with that error.
    pub launch_id: Option<[u32; 3]>,
    /// The most bits that one operation lost: by how many its result is worse than its worst
    /// operand.
    pub bits_lost: f64,
    /// Sums and differences that lost more than 8 bits.
    pub cancellations: u64,
    /// Results that are infinite or NaN where the shadow is not, or the other way round.
    pub not_finite: u64,
    /// Comparisons that the shadow decides otherwise.
    pub comparisons: u64,
    /// Branches that the shadow would take otherwise.
    pub branches: u64,
    /// Conversions to integers that give another one.
    pub integers: u64,
    /// Rays that would hit something else.
    pub hits: u64,
}

impl LineFindings {
    /// Whether the line is worth a look.
    pub fn matters(&self) -> bool {
        self.flips() + self.cancellations + self.not_finite > 0 || self.error > ERROR
    }

    /// Decisions that fall out otherwise.
    pub fn flips(&self) -> u64 {
        self.comparisons + self.branches + self.integers + self.hits
    }

    /// Adds what another run showed.
    pub fn add(&mut self, other: &Self) {
        if other.error > self.error {
            (self.error, self.launch_id) = (other.error, other.launch_id);
        }
        self.bits_lost = self.bits_lost.max(other.bits_lost);
        self.results += other.results;
        self.cancellations += other.cancellations;
        self.not_finite += other.not_finite;
        self.comparisons += other.comparisons;
        self.branches += other.branches;
        self.integers += other.integers;
        self.hits += other.hits;
    }
}

impl Shadow {
    /// Adds what another run showed.
    pub fn add(&mut self, other: &Self) {
        self.results += other.results;
        for (spot, found) in &other.lines {
            self.lines.entry(spot.clone()).or_default().add(found);
        }
    }

    /// The lines, worst first: by decisions that flip, then by lost bits, then by error.
    pub fn sorted(&self) -> Vec<(&Spot, &LineFindings)> {
        let mut lines: Vec<_> = self.lines.iter().collect();
        lines.sort_by(|(_, one), (_, other)| {
            let key = |found: &LineFindings| (found.flips() > 0, found.cancellations + found.not_finite > 0);
            key(other)
                .cmp(&key(one))
                .then(other.bits_lost.total_cmp(&one.bits_lost))
                .then(other.error.total_cmp(&one.error))
        });
        lines
    }
}
