//! The way back: states of a debuggee at some times, from which any other time is reached by
//! running.

use super::course::{Course, Time};
use super::debuggee::SavedState;
use super::memory_state::MemoryState;
use super::segment_summary::SegmentSummary;

/// How many checkpoints are kept: when there are more, every other one is dropped.
const MOST_CHECKPOINTS: usize = 128;
/// How many steps are between two checkpoints at first.
const FIRST_INTERVAL: Time = 20_000;
/// How many instructions others of the workgroup execute between two steps, at first, for a
/// checkpoint to be behind them.
const FIRST_WORK_INTERVAL: u64 = 1 << 24;

/// A state at a time.
pub(super) struct Checkpoint {
    /// The course up to there.
    pub course: Course,
    /// The debuggee.
    pub state: SavedState,
    /// The memory.
    pub memory: MemoryState,
    /// Whether something was set by hand at this time: whoever runs up to it goes on from here.
    pub is_edited: bool,
}

/// Checkpoints, ascending in time, each with what happened after it.
pub(super) struct History {
    checkpoints: Vec<(Checkpoint, SegmentSummary)>,
    interval: Time,
    /// The instructions of others behind which a checkpoint is due, whatever the time.
    pub work_interval: u64,
    /// The time up to which the invocation has run once.
    pub frontier: Time,
}

impl History {
    /// A history that begins with a state at time 0.
    pub(super) fn new(beginning: Checkpoint) -> Self {
        let checkpoints = vec![(beginning, SegmentSummary::default())];
        Self { checkpoints, interval: FIRST_INTERVAL, work_interval: FIRST_WORK_INTERVAL, frontier: 0 }
    }

    /// Keeps no more checkpoints: nobody goes back.
    pub(super) fn keep_no_more(&mut self) {
        self.interval = Time::MAX / 2;
        self.work_interval = u64::MAX;
    }

    /// When the next checkpoint is due.
    pub(super) fn next_due(&self) -> Time {
        self.last().course.time.saturating_add(self.interval)
    }

    /// The latest checkpoint.
    pub(super) fn last(&self) -> &Checkpoint {
        let last = self.checkpoints.last();
        &last.expect("bug in anyhit: a history without a beginning").0
    }

    /// The summary of what happens now for the first time.
    pub(super) fn open_summary(&mut self) -> &mut SegmentSummary {
        let last = self.checkpoints.last_mut();
        &mut last.expect("bug in anyhit: a history without a beginning").1
    }

    /// Adds the state at the frontier.
    pub(super) fn push(&mut self, checkpoint: Checkpoint) {
        self.checkpoints.push((checkpoint, SegmentSummary::default()));
        if self.checkpoints.len() > MOST_CHECKPOINTS {
            self.thin_out();
        }
    }

    /// Drops every other checkpoint, and takes half as many from now on.
    fn thin_out(&mut self) {
        self.interval = self.interval.saturating_mul(2);
        self.work_interval = self.work_interval.saturating_mul(2);
        let mut kept: Vec<(Checkpoint, SegmentSummary)> = Vec::new();
        for (at, (checkpoint, summary)) in self.checkpoints.drain(..).enumerate() {
            match kept.last_mut() {
                Some((_, before)) if at % 2 == 1 && !checkpoint.is_edited => before.append(summary),
                _ => kept.push((checkpoint, summary)),
            }
        }
        self.checkpoints = kept;
    }

    /// Forgets everything after a checkpoint, which is the last one from now on: something was set
    /// by hand there, and the invocation goes another way.
    pub(super) fn go_another_way(&mut self, edited: Checkpoint) {
        let time = edited.course.time;
        self.checkpoints.retain(|(checkpoint, _)| checkpoint.course.time < time);
        self.frontier = time;
        self.checkpoints.push((edited, SegmentSummary::default()));
    }

    /// The first checkpoint after a time at which something was set by hand.
    pub(super) fn next_edit(&self, time: Time) -> Option<&Checkpoint> {
        let mut all = self.checkpoints.iter().map(|(checkpoint, _)| checkpoint);
        all.find(|checkpoint| checkpoint.is_edited && checkpoint.course.time > time)
    }

    /// The segment that begins with the last checkpoint at a time or before it.
    pub(super) fn segment_at(&self, time: Time) -> usize {
        let after = self.checkpoints.partition_point(|(one, _)| one.course.time <= time);
        after.max(1) - 1
    }

    /// How many segments there are: what lies between two checkpoints, or behind the last.
    pub(super) fn segments(&self) -> usize {
        self.checkpoints.len()
    }

    /// A segment: the checkpoint that it begins with, and what happens in it. Its steps are those
    /// after the checkpoint's, up to the next one's, included; the first has step 0, too.
    pub(super) fn segment(&self, number: usize) -> &(Checkpoint, SegmentSummary) {
        &self.checkpoints[number]
    }

    /// The last step of a segment.
    pub(super) fn segment_end(&self, number: usize) -> Time {
        self.checkpoints.get(number + 1).map_or(Time::MAX, |(next, _)| next.course.time)
    }
}
