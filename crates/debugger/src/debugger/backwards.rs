//! Running backwards: to the line before, to the breakpoint before, to whoever wrote a value.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

use super::condition::{Hit, Reason, StopConditions};
use super::course::Time;
use super::decision::Direction;
use super::segment_summary::SegmentSummary;
use super::{Debugger, Stepping, StopReason};

impl Debugger {
    /// Sets the flag with which another thread ends runs backwards: they cannot go on later, and
    /// stop where they began.
    pub fn given_up_by(&mut self, flag: Arc<AtomicBool>) {
        self.give_up = Some(flag);
    }

    /// Whether a run backwards is to end.
    pub(super) fn is_given_up(&self) -> bool {
        self.give_up.as_ref().is_some_and(|flag| flag.load(Relaxed))
    }

    /// Makes a step backwards: to the begin of the line before, in the same function or its caller
    /// (`Over`), or wherever it is (`Into`); to the call of this function (`Out`).
    pub fn step_back(&mut self, step: Stepping) -> StopReason {
        let depth = self.course.depth();
        let conditions = match step {
            Stepping::Out if depth == 0 => return self.go_to_beginning(),
            Stepping::Out => StopConditions { line: Some(depth - 1), ..StopConditions::default() },
            Stepping::Over => StopConditions { line: Some(depth), ..StopConditions::default() },
            step => self.step_conditions(step, depth),
        };
        let now = self.course.time;
        let hits = self.last_hits(&conditions, now);
        if self.is_given_up() {
            self.seek(now);
            return StopReason::Interrupted;
        }
        let Some(hit) = hits.into_iter().next() else { return self.go_to_beginning() };
        self.seek(hit.time);
        match hit.reason {
            Reason::Traversal(id, _) => StopReason::Traversal(id),
            _ => StopReason::Step,
        }
    }

    /// Runs backwards to the breakpoint before, or to the step that wrote what is watched.
    pub fn resume_back(&mut self) -> StopReason {
        let conditions = StopConditions {
            breakpoints: Some(self.table.clone()),
            watches: self.watches.clone(),
            ..StopConditions::default()
        };
        let now = self.course.time;
        let mut before = now;
        loop {
            let finding = self.last_finding_before(before);
            let hits = self.last_hits(&conditions, before);
            if self.is_given_up() {
                self.seek(now);
                return StopReason::Interrupted;
            }
            let time = hits.first().map(|hit| hit.time);
            if let Some(found) = finding.filter(|&found| time.is_none_or(|time| time <= found)) {
                self.seek(found);
                return StopReason::Findings(self.findings_here());
            }
            let Some(time) = time else { return self.go_to_beginning() };
            self.seek(time);
            let reasons: Vec<Reason> = hits.into_iter().map(|hit| hit.reason).collect();
            if let Some(stop) = self.decide(&reasons, Direction::Backwards) {
                return stop;
            }
            before = time;
        }
    }

    pub(super) fn go_to_beginning(&mut self) -> StopReason {
        self.seek(self.first.min(self.course.time));
        StopReason::Beginning
    }

    /// The reasons at the last time before a time at which conditions were met. Searches backwards,
    /// segment by segment, and leaves the debuggee somewhere.
    pub(super) fn last_hits(&mut self, conditions: &StopConditions, before: Time) -> Vec<Hit> {
        let Some(last) = before.checked_sub(1) else { return Vec::new() };
        for number in (0..self.history.segments()).rev() {
            let (checkpoint, summary) = self.history.segment(number);
            let begins = checkpoint.course.time;
            if begins > last || number > 0 && begins == last || !can_be_in(conditions, summary) {
                continue;
            }
            let until = last.min(self.history.segment_end(number));
            self.restore_segment(number);
            let interrupt = self.give_up.clone();
            let mut collecting = StopConditions { collects: true, until, interrupt, ..conditions.clone() };
            self.look_at_watched(&mut collecting);
            self.advance(&mut collecting);
            if self.is_given_up() {
                return Vec::new();
            }
            let hits = collecting.hits;
            let Some(time) = hits.iter().map(|hit| hit.time).filter(|&time| time <= last).max() else {
                continue;
            };
            return hits.into_iter().filter(|hit| hit.time == time).collect();
        }
        Vec::new()
    }
}

/// Whether conditions can be met in a segment.
fn can_be_in(conditions: &StopConditions, summary: &SegmentSummary) -> bool {
    let at_lines = match &conditions.breakpoints {
        None => false,
        Some(table) => table.only_lines().is_none_or(|lines| summary.has_one_of(lines)),
    };
    let others = conditions.instruction.is_some()
        || conditions.below.is_some()
        || conditions.traversal
        || conditions.watches_results();
    others || at_lines || conditions.line.is_some_and(|depth| summary.has_line_within(depth))
}
