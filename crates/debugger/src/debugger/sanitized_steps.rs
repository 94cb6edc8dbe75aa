//! The findings that the invocation that is followed meets, and at which steps.

use std::rc::Rc;
use std::sync::Arc;

use anyhit_engine::pipeline::{Event, Pipeline, PipelineObserver};
use anyhit_sanitize::{
    Finding, Levels, OccurrenceLog, PausedRayWatch, ProgramPlan, RayWatch, Sanitizer, SeenRays,
    StructureNames,
};

use super::course::Time;

/// A finding that the followed invocation meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FoundAt {
    /// The step that breaks the rule.
    pub time: Time,
    /// The finding.
    pub finding: FindingNumber,
}

/// A finding of a run, by its place among those of steps or of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FindingNumber {
    OfStep(usize),
    OfRay(usize),
}

/// What the sanitizer of a run borrows while it runs, and the sanitizer itself while the run is
/// paused.
pub(super) struct Sanitizing {
    plans: Vec<ProgramPlan>,
    levels: Levels,
    /// The pipeline that traces rays, and what the scene calls what they meet; of a dispatch there
    /// is none.
    rays: Option<(Arc<Pipeline>, Rc<dyn StructureNames>)>,
    sanitizer: Option<Sanitizer<'static>>,
    steps: StepFindings,
}

/// What was found of the steps of an invocation and of its rays.
pub(super) struct StepFindings {
    /// What the sanitizer notes.
    of_steps: OccurrenceLog,
    /// What the watch of its rays notes.
    of_rays: OccurrenceLog,
    rays: PausedRayWatch,
    seen: SeenRays,
    /// What was found, ascending in time.
    found: Vec<FoundAt>,
}

/// The findings of a run while it runs.
pub(super) struct FindingTimes<'a> {
    steps: &'a mut StepFindings,
    /// What the rays of the run are checked with.
    names: Option<(&'a Pipeline, &'a dyn StructureNames)>,
    levels: &'a Levels,
}

impl Sanitizing {
    /// The sanitizer of a run that has not begun, of shaders that are not optimised. `prepare`
    /// gives it what else it knows.
    pub(super) fn new(
        pipeline: &Arc<Pipeline>,
        names: Option<Rc<dyn StructureNames>>,
        levels: Levels,
        prepare: impl FnOnce(Sanitizer<'_>) -> Sanitizer<'_>,
    ) -> Self {
        let plans: Vec<_> = pipeline.programs.iter().map(ProgramPlan::new).collect();
        let (of_steps, of_rays) = (OccurrenceLog::default(), OccurrenceLog::default());
        let sanitizer = prepare(Sanitizer::new(&plans, &levels).noting_occurrences(&of_steps));
        let sanitizer = Some(sanitizer.borrowing(&[], Levels::defaults(), None));
        let rays = PausedRayWatch::noting_occurrences(&of_rays);
        let steps = StepFindings { of_steps, of_rays, rays, seen: SeenRays::default(), found: Vec::new() };
        let rays = names.map(|names| (pipeline.clone(), names));
        Self { plans, levels, rays, sanitizer, steps }
    }

    /// What was found so far, ascending in time.
    pub(super) fn found(&self) -> &[FoundAt] {
        &self.steps.found
    }

    /// A finding, by its place among all.
    pub(super) fn finding(&self, number: FindingNumber) -> Option<&Finding> {
        match number {
            FindingNumber::OfStep(number) => self.sanitizer.as_ref()?.findings().iter().nth(number),
            FindingNumber::OfRay(number) => self.steps.rays.findings().iter().nth(number),
        }
    }

    /// Takes the sanitizer out for the time that a run goes on.
    pub(super) fn take(&mut self) -> Option<Sanitizer<'static>> {
        self.sanitizer.take()
    }

    /// The sanitizer that was taken out, with what it needs to look at steps, and the times of its
    /// findings.
    pub(super) fn looking<'a>(
        &'a mut self,
        sanitizer: Sanitizer<'static>,
    ) -> (Sanitizer<'a>, FindingTimes<'a>) {
        let Self { plans, levels, rays, steps, .. } = self;
        let names = rays.as_ref().map(|(pipeline, names)| (&**pipeline, &**names));
        let sanitizer = sanitizer.borrowing(plans, levels, names.map(|(pipeline, _)| pipeline));
        (sanitizer, FindingTimes { steps, names, levels })
    }

    /// Keeps the sanitizer until the run goes on.
    pub(super) fn keep(&mut self, sanitizer: Option<Sanitizer<'static>>) {
        self.sanitizer = sanitizer;
    }
}

impl FindingTimes<'_> {
    /// Notes what the followed invocation has met at a step; `own` returns its launch index.
    pub(super) fn note(&mut self, time: Time, own: impl FnOnce() -> Option<[u32; 3]>) {
        let met = self.steps.of_steps.take();
        if met.is_empty() {
            return;
        }
        let own = own();
        for occurrence in met.into_iter().filter(|occurrence| Some(occurrence.launch_id) == own) {
            self.add(FoundAt { time, finding: FindingNumber::OfStep(occurrence.finding) });
        }
    }

    /// Looks at what the pipeline has done for the followed invocation at a step.
    pub(super) fn event(&mut self, event: Event, time: Time) {
        let Some((pipeline, names)) = self.names else { return };
        let steps = &mut *self.steps;
        let paused = std::mem::take(&mut steps.rays);
        let mut watch = RayWatch::of_paused(pipeline, names, self.levels, &mut steps.seen, paused);
        watch.event(event);
        steps.rays = watch.pause();
        for occurrence in steps.of_rays.take() {
            self.add(FoundAt { time, finding: FindingNumber::OfRay(occurrence.finding) });
        }
    }

    /// Adds what was found. A ray's findings come when its traversal is over, and the next shader
    /// may have begun.
    fn add(&mut self, found: FoundAt) {
        let all = &mut self.steps.found;
        let at = all.partition_point(|one| one.time <= found.time);
        // An operation may meet one several times, for each of its operands.
        let same_step = all[..at].iter().rev().take_while(|one| one.time == found.time);
        if !same_step.into_iter().any(|one| one.finding == found.finding) {
            all.insert(at, found);
        }
    }
}
