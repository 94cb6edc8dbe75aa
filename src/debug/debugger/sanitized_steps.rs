//! The sanitizer beside a tracker: at which steps the invocation that is followed meets findings.

use std::sync::Arc;

use crate::machine::{Batch, Observer, ShaderIndex};
use crate::pipeline::Pipeline;
use crate::sanitize::{Finding, Levels, ProgramPlan, Sanitizer};

use super::course::Time;
use super::tracker::Followed;

/// A finding that the followed invocation meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FoundAt {
    /// The step that breaks the rule.
    pub time: Time,
    /// The finding, by its place among all of the run.
    pub finding: usize,
}

/// What the sanitizer of a run borrows while it runs, and the sanitizer itself while the run is
/// paused.
#[derive(Debug)]
pub(super) struct Sanitizing {
    plans: Vec<ProgramPlan>,
    levels: Levels,
    /// Of a dispatch there is none.
    pipeline: Option<Arc<Pipeline>>,
    paused: Option<SanitizedSteps<'static>>,
}

/// The sanitizer while the invocation runs.
#[derive(Debug)]
pub(super) struct SanitizedSteps<'a> {
    /// The sanitizer: whoever tells it of something asks [`SanitizedSteps::note`] what came of it.
    pub(super) sanitizer: Sanitizer<'a>,
    /// What was found, ascending in time.
    found: Vec<FoundAt>,
    /// Whether the tracker has paused the run: a shader that goes on then has called nothing.
    is_paused: bool,
}

impl Sanitizing {
    /// The sanitizer of a run that has not begun, of shaders that are not optimised. `prepare` gives
    /// it what else it knows.
    pub(super) fn new(
        pipeline: &Arc<Pipeline>,
        is_launch: bool,
        levels: Levels,
        prepare: impl FnOnce(Sanitizer<'_>) -> Sanitizer<'_>,
    ) -> Self {
        let plans: Vec<_> = pipeline.programs.iter().map(ProgramPlan::new).collect();
        let sanitizer = prepare(Sanitizer::new(&plans, &levels).noting_occurrences());
        let sanitizer = sanitizer.borrowing(&[], Levels::defaults(), None);
        let paused = Some(SanitizedSteps { sanitizer, found: Vec::new(), is_paused: false });
        Self { plans, levels, pipeline: is_launch.then(|| pipeline.clone()), paused }
    }

    /// What was found so far, ascending in time.
    pub(super) fn found(&self) -> &[FoundAt] {
        self.paused.as_ref().map_or(&[], |steps| &steps.found)
    }

    /// A finding, by its place among all.
    pub(super) fn finding(&self, number: usize) -> Option<&Finding> {
        self.paused.as_ref()?.sanitizer.findings().iter().nth(number)
    }

    /// Takes the sanitizer out for the time that a run goes on.
    pub(super) fn take(&mut self) -> Option<SanitizedSteps<'static>> {
        self.paused.take()
    }

    /// The sanitizer that was taken out, with what it needs to look at steps.
    pub(super) fn looking<'a>(&'a self, steps: SanitizedSteps<'static>) -> SanitizedSteps<'a> {
        steps.borrowing(&self.plans, &self.levels, self.pipeline.as_deref())
    }

    /// Keeps the sanitizer until the run goes on.
    pub(super) fn keep(&mut self, steps: Option<SanitizedSteps<'static>>) {
        self.paused = steps;
    }
}

impl SanitizedSteps<'_> {
    fn borrowing<'b>(
        self,
        plans: &'b [ProgramPlan],
        levels: &'b Levels,
        pipeline: Option<&'b Pipeline>,
    ) -> SanitizedSteps<'b> {
        let Self { sanitizer, found, is_paused } = self;
        SanitizedSteps { sanitizer: sanitizer.borrowing(plans, levels, pipeline), found, is_paused }
    }

    /// The sanitizer without what it borrows.
    pub(super) fn paused(self) -> SanitizedSteps<'static> {
        self.borrowing(&[], Levels::defaults(), None)
    }

    /// The tracker pauses the run before a step.
    pub(super) fn pause(&mut self) {
        self.is_paused = true;
    }

    /// Notes what the followed invocation has met at a step.
    pub(super) fn note<const W: usize>(&mut self, batch: &Batch<W>, (followed, time): (Followed, Time)) {
        let met = self.sanitizer.take_occurrences();
        if met.is_empty() {
            return;
        }
        let own = followed.lane(batch).map(|lane| batch.invocations.launch_id(lane));
        for occurrence in met.into_iter().filter(|occurrence| Some(occurrence.launch_id) == own) {
            let found = FoundAt { time, finding: occurrence.finding };
            // Several invocations of one operation, or operations of one instruction, say it once.
            if self.found.last() != Some(&found) {
                self.found.push(found);
            }
        }
    }

    /// A shader begins to run, or goes on.
    pub(super) fn resumed<const W: usize>(
        &mut self,
        shader: ShaderIndex,
        batch: &mut Batch<W>,
        at: (Followed, Time),
    ) {
        if !std::mem::take(&mut self.is_paused) {
            self.sanitizer.resumed(shader, batch);
            self.note(batch, at);
        }
    }

    /// A shader has stopped.
    pub(super) fn stopped<const W: usize>(
        &mut self,
        shader: ShaderIndex,
        batch: &Batch<W>,
        at: (Followed, Time),
    ) {
        if !self.is_paused {
            self.sanitizer.stopped(shader, batch);
            self.note(batch, at);
        }
    }
}
