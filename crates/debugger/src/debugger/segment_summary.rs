//! What happens between two checkpoints, in short.

use rustc_hash::FxHashSet;

use super::source_map::LineIndex;

/// What happened for the first time after a checkpoint, up to the next one: enough to know where a
/// search need not look.
#[derive(Clone, Debug)]
pub(super) struct SegmentSummary {
    min_depth: u32,
    lines: FxHashSet<LineIndex>,
}

impl Default for SegmentSummary {
    fn default() -> Self {
        Self { min_depth: u32::MAX, lines: FxHashSet::default() }
    }
}

impl SegmentSummary {
    /// Notes that a line begins.
    pub(super) fn add(&mut self, depth: u32, line: LineIndex) {
        self.min_depth = self.min_depth.min(depth);
        self.lines.insert(line);
    }

    /// Whether a line begins at a depth of calls or less.
    pub(super) fn has_line_within(&self, depth: u32) -> bool {
        self.min_depth <= depth
    }

    /// Whether one of these lines begins.
    pub(super) fn has_one_of(&self, mut lines: impl Iterator<Item = LineIndex>) -> bool {
        lines.any(|line| self.lines.contains(&line))
    }

    pub(super) fn append(&mut self, later: Self) {
        self.min_depth = self.min_depth.min(later.min_depth);
        self.lines.extend(later.lines);
    }
}
