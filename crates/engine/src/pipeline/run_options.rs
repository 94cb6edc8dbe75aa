//! How a launch or a dispatch runs.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use crate::machine::LaunchLimits;

/// How many lanes a batch has: so many invocations run together on a thread. Results do not depend
/// on it; shaders with subgroup instructions run in batches that hold whole subgroups.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BatchWidth {
    /// One lane.
    One,
    /// 64 lanes, which is the fastest.
    #[default]
    Of64,
    /// 128 lanes.
    Of128,
}

impl BatchWidth {
    /// Every width.
    pub const ALL: [Self; 3] = [Self::One, Self::Of64, Self::Of128];

    /// The number of lanes, as a command line spells it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::One => "1",
            Self::Of64 => "64",
            Self::Of128 => "128",
        }
    }
}

impl fmt::Display for BatchWidth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for BatchWidth {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|width| width.name() == text);
        found.ok_or_else(|| format!("a batch has 1, 64 or 128 lanes, not `{text}`"))
    }
}

/// How a launch or a dispatch runs. What it computes depends on none of these but the limits.
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use anyhit_engine::pipeline::{BatchWidth, RunOptions};
///
/// let options = RunOptions::of(BatchWidth::One).threads(NonZeroUsize::MIN);
/// assert_eq!((options.width.name(), options.limits), ("1", None));
/// ```
#[derive(Clone, Copy)]
#[must_use]
pub struct RunOptions<'a> {
    /// How many invocations run together on a thread.
    pub width: BatchWidth,
    /// The most threads that work on it; by default those of rayon's pool.
    pub threads: Option<NonZeroUsize>,
    /// Limits in place of those of the pipeline or of the compute shader.
    pub limits: Option<LaunchLimits>,
    /// Receives how many more invocations have ended, on any thread.
    pub on_progress: &'a (dyn Fn(u64) + Sync),
}

impl Default for RunOptions<'_> {
    fn default() -> Self {
        Self::of(BatchWidth::default())
    }
}

impl fmt::Debug for RunOptions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, threads, limits, .. } = self;
        let mut debug = f.debug_struct("RunOptions");
        debug.field("width", width).field("threads", threads).field("limits", limits);
        debug.finish_non_exhaustive()
    }
}

impl<'a> RunOptions<'a> {
    /// Batches of a width, on all threads, within the limits of the pipeline.
    pub fn of(width: BatchWidth) -> Self {
        Self { width, threads: None, limits: None, on_progress: &|_| () }
    }

    /// Uses at most so many threads.
    pub fn threads(self, most: NonZeroUsize) -> Self {
        Self { threads: Some(most), ..self }
    }

    /// The most threads for what may have to run on one.
    pub(super) fn most_threads(self, single_threaded: bool) -> usize {
        match single_threaded {
            true => 1,
            false => self.threads.map_or(usize::MAX, NonZeroUsize::get),
        }
    }

    /// Sets the limits, in place of those of the pipeline or of the compute shader.
    pub fn limits(self, limits: LaunchLimits) -> Self {
        Self { limits: Some(limits), ..self }
    }

    /// Sets what receives how many more invocations have ended.
    pub fn on_progress(self, on_progress: &'a (dyn Fn(u64) + Sync)) -> Self {
        Self { on_progress, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_is_read_as_it_is_written() {
        for (width, text) in BatchWidth::ALL.into_iter().zip(["1", "64", "128"]) {
            assert_eq!((width.to_string().as_str(), text.parse()), (text, Ok(width)));
        }
        let error = BatchWidth::from_str("8").unwrap_err();
        assert_eq!(error, "a batch has 1, 64 or 128 lanes, not `8`");
    }
}
