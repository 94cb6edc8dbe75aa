//! Counts of what launches and dispatches did.

use serde::Serialize;

use crate::module::interface::Stage;
use anyhit_base::sorted::SortedMap;

/// Counts of what a launch did.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Stats {
    /// Rays traced.
    pub rays: u64,
    /// Ray queries initialised.
    pub ray_queries: u64,
    /// Rays and ray queries whose direction is zero, which no triangle, sphere or swept sphere
    /// meets.
    pub zero_directions: u64,
    /// Instructions that reorder invocations, which changes nothing here, counted by invocations.
    pub reorders: u64,
    /// Invocations and batches by stage.
    #[doc(hidden)]
    pub shaders: SortedMap<Stage, ShaderStats>,
    /// Work that was elided.
    #[doc(hidden)]
    pub elided: Elided,
}

/// Work of rays that was elided because nothing depends on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Elided {
    /// Closest hits on opaque geometry whose hit group has an any-hit shader, which did not run.
    pub any_hit: u64,
    /// Occlusion rays that ended at the first hit found, because nothing reads which hit it is.
    pub occlusion: u64,
    /// Invocations of shaders without side effects, which did not run.
    pub empty: u64,
    /// Invocations of closest-hit and miss shaders that write only payload words that are never
    /// read, which did not run.
    pub unread: u64,
}

/// How often shaders of a stage ran.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ShaderStats {
    /// The number of invocations.
    pub invocations: u64,
    /// The number of batches that they ran in.
    pub batches: u64,
}

impl Stats {
    /// How many invocations of a stage's shaders ran.
    #[must_use]
    pub fn invocations(&self, stage: Stage) -> u64 {
        self.shaders.get(&stage).map_or(0, |shaders| shaders.invocations)
    }

    /// Counts a batch of a stage and the invocations in its lanes.
    pub(super) fn count(&mut self, stage: Stage, lanes: u32) {
        let entry = self.shaders.entry(stage).or_default();
        entry.batches += 1;
        entry.invocations += u64::from(lanes);
    }

    /// Counts invocations of a shader without effect.
    pub(super) fn elide(&mut self, stage: Stage, count: u32) {
        self.elided.empty += u64::from(count);
        self.count_without_batch(stage, count);
    }

    /// Counts invocations of a shader that writes only payload words that are never read.
    pub(super) fn elide_unread(&mut self, stage: Stage, count: u32) {
        self.elided.unread += u64::from(count);
        self.count_without_batch(stage, count);
    }

    fn count_without_batch(&mut self, stage: Stage, count: u32) {
        if count > 0 {
            self.shaders.entry(stage).or_default().invocations += u64::from(count);
        }
    }

    /// The sum of two counts.
    #[must_use]
    pub fn plus(mut self, other: &Self) -> Self {
        self.rays += other.rays;
        self.ray_queries += other.ray_queries;
        self.zero_directions += other.zero_directions;
        self.reorders += other.reorders;
        self.elided.any_hit += other.elided.any_hit;
        self.elided.occlusion += other.elided.occlusion;
        self.elided.empty += other.elided.empty;
        self.elided.unread += other.elided.unread;
        for (&stage, stats) in &other.shaders {
            let sum = self.shaders.entry(stage).or_default();
            sum.invocations += stats.invocations;
            sum.batches += stats.batches;
        }
        self
    }
}
