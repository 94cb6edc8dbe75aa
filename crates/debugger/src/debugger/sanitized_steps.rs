//! The sanitizer beside a tracker: at which steps the invocation that is followed meets findings.

use std::rc::Rc;
use std::sync::Arc;

use anyhit_engine::machine::{Batch, Observer, ShaderIndex};
use anyhit_engine::pipeline::{Event, Pipeline, PipelineObserver};
use anyhit_sanitize::{
    Finding, Levels, PausedRayWatch, ProgramPlan, RayWatch, Sanitizer, SeenRays, StructureNames,
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
    paused: Option<SanitizedSteps<'static>>,
}

/// The sanitizer while the invocation runs.
pub(super) struct SanitizedSteps<'a> {
    /// The sanitizer: whoever tells it of something asks [`SanitizedSteps::note`] what came of it.
    pub(super) sanitizer: Sanitizer<'a>,
    /// What the rays of the run are checked with.
    names: Option<(&'a Pipeline, &'a dyn StructureNames)>,
    levels: &'a Levels,
    rays: PausedRayWatch,
    seen: SeenRays,
    /// What was found, ascending in time.
    found: Vec<FoundAt>,
    /// Whether the tracker has paused the run: a shader that goes on then has called nothing.
    is_paused: bool,
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
        let sanitizer = prepare(Sanitizer::new(&plans, &levels).noting_occurrences());
        let sanitizer = sanitizer.borrowing(&[], Levels::defaults(), None);
        let steps = SanitizedSteps {
            sanitizer,
            names: None,
            levels: Levels::defaults(),
            rays: PausedRayWatch::noting_occurrences(),
            seen: SeenRays::default(),
            found: Vec::new(),
            is_paused: false,
        };
        let rays = names.map(|names| (pipeline.clone(), names));
        Self { plans, levels, rays, paused: Some(steps) }
    }

    /// What was found so far, ascending in time.
    pub(super) fn found(&self) -> &[FoundAt] {
        self.paused.as_ref().map_or(&[], |steps| &steps.found)
    }

    /// A finding, by its place among all.
    pub(super) fn finding(&self, number: FindingNumber) -> Option<&Finding> {
        let paused = self.paused.as_ref()?;
        match number {
            FindingNumber::OfStep(number) => paused.sanitizer.findings().iter().nth(number),
            FindingNumber::OfRay(number) => paused.rays.findings().iter().nth(number),
        }
    }

    /// Takes the sanitizer out for the time that a run goes on.
    pub(super) fn take(&mut self) -> Option<SanitizedSteps<'static>> {
        self.paused.take()
    }

    /// The sanitizer that was taken out, with what it needs to look at steps.
    pub(super) fn looking<'a>(&'a self, steps: SanitizedSteps<'static>) -> SanitizedSteps<'a> {
        let rays = self.rays.as_ref().map(|(pipeline, names)| (&**pipeline, &**names));
        steps.borrowing(&self.plans, &self.levels, rays)
    }

    /// Keeps the sanitizer until the run goes on.
    pub(super) fn keep(&mut self, steps: Option<SanitizedSteps<'static>>) {
        self.paused = steps;
    }
}

impl<'a> SanitizedSteps<'a> {
    fn borrowing<'b>(
        self,
        plans: &'b [ProgramPlan],
        levels: &'b Levels,
        names: Option<(&'b Pipeline, &'b dyn StructureNames)>,
    ) -> SanitizedSteps<'b> {
        let Self { sanitizer, rays, seen, found, is_paused, .. } = self;
        let sanitizer = sanitizer.borrowing(plans, levels, names.map(|(pipeline, _)| pipeline));
        SanitizedSteps { sanitizer, names, levels, rays, seen, found, is_paused }
    }

    /// The sanitizer without what it borrows.
    pub(super) fn paused(self) -> SanitizedSteps<'static> {
        self.borrowing(&[], Levels::defaults(), None)
    }

    /// The tracker pauses the run before a step.
    pub(super) fn pause(&mut self) {
        self.is_paused = true;
    }

    /// Notes what the followed invocation has met at a step; `own` tells its launch index.
    pub(super) fn note(&mut self, time: Time, own: impl FnOnce() -> Option<[u32; 3]>) {
        let met = self.sanitizer.take_occurrences();
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
        let paused = std::mem::take(&mut self.rays);
        let mut watch = RayWatch::of_paused(pipeline, names, self.levels, &mut self.seen, paused);
        watch.event(event);
        self.rays = watch.pause();
        for occurrence in self.rays.take_occurrences() {
            self.add(FoundAt { time, finding: FindingNumber::OfRay(occurrence.finding) });
        }
    }

    /// Adds what was found. A ray's findings come when its traversal is over, and the next shader
    /// may have begun.
    fn add(&mut self, found: FoundAt) {
        let at = self.found.partition_point(|one| one.time <= found.time);
        // An operation may meet one several times, for each of its operands.
        let same_step = self.found[..at].iter().rev().take_while(|one| one.time == found.time);
        if !same_step.into_iter().any(|one| one.finding == found.finding) {
            self.found.insert(at, found);
        }
    }

    /// A shader begins to run, or goes on.
    pub(super) fn resumed<const W: usize>(&mut self, shader: ShaderIndex, batch: &mut Batch<W>)
    where
        Sanitizer<'a>: Observer<W>,
    {
        if !std::mem::take(&mut self.is_paused) {
            self.sanitizer.resumed(shader, batch);
        }
    }

    /// A shader has stopped.
    pub(super) fn stopped<const W: usize>(&mut self, shader: ShaderIndex, batch: &Batch<W>)
    where
        Sanitizer<'a>: Observer<W>,
    {
        if !self.is_paused {
            self.sanitizer.stopped(shader, batch);
        }
    }
}
