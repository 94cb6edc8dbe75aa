//! The sanitizer's findings as places to stop at.
//!
//! A second run of the same invocation, on memory of its own and under the sanitizer, is always
//! ahead of the run that is debugged, and tells at which steps findings are met. Both make the same
//! steps, so a finding is met again at the same step however often the debugger goes back.

use std::fmt;
use std::rc::Rc;

use crate::session::{ExplainRequest, Session};
use anyhit_base::error::Result;
use anyhit_engine::pipeline::Resumed;
use anyhit_sanitize::{Finding, Level, Levels, Rule, StructureNames};
use anyhit_scene::ResolvedScene;
use anyhit_scene::pass::PassWork;
use anyhit_scene::unwritten::unwritten_memory;

use super::Debugger;
use super::condition::StopConditions;
use super::course::Time;
use super::edits::Edit;
use super::sanitized_steps::Sanitizing;

/// How many steps the second run is ahead at least, where it is not at its end.
const STEPS_AHEAD: Time = 100_000;

/// Which findings stop an invocation.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FindingFilter {
    /// Whether also those that are only warned of.
    pub warned: bool,
    /// If not empty, only those of these rules, whatever their level.
    pub rules: Vec<&'static Rule>,
}

impl FindingFilter {
    fn stops_at(&self, finding: &Finding) -> bool {
        match self.rules.is_empty() {
            true => self.warned || finding.level == Level::Deny,
            false => self.rules.contains(&finding.rule),
        }
    }
}

/// The second run.
pub struct FindingsAhead {
    /// Prepares it anew.
    prepare: Box<dyn Fn() -> Result<Debugger>>,
    run: Debugger,
    filter: FindingFilter,
    /// Ascending in time; the first ones have been made.
    edits: Vec<Edit>,
    edits_made: usize,
    has_ended: bool,
}

impl fmt::Debug for FindingsAhead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FindingsAhead").field("filter", &self.filter).finish_non_exhaustive()
    }
}

impl FindingsAhead {
    /// Of an invocation or ray of a scene; rules have these levels, but for those that the filter
    /// names: they are told of in any case.
    ///
    /// # Errors
    /// As [`Debugger::of_scene`].
    pub fn of_scene(
        scene: ResolvedScene,
        request: ExplainRequest,
        mut levels: Levels,
        filter: FindingFilter,
    ) -> Result<Self> {
        for rule in &filter.rules {
            if levels.of(rule) == Level::Allow {
                levels.set(rule.id, Level::Warn)?;
            }
        }
        let prepare = move || Debugger::sanitized(&Session::new(scene.clone())?, &request, &levels);
        let run = prepare()?;
        Ok(Self {
            prepare: Box::new(prepare),
            run,
            filter,
            edits: Vec::new(),
            edits_made: 0,
            has_ended: false,
        })
    }

    /// Runs on until all steps before a time are known, or to the end.
    fn cover(&mut self, time: Time) {
        while !self.has_ended && self.run.course.time < time {
            let edit = self.edits.get(self.edits_made).map_or(Time::MAX, |edit| edit.time);
            let mut conditions = StopConditions::at(time.min(edit));
            self.has_ended = self.run.advance(&mut conditions) == Resumed::Ended;
            self.make_edits();
        }
    }

    /// Sets what was set by hand at the step that is next.
    fn make_edits(&mut self) {
        let now = self.run.course.time;
        while let Some(edit) = self.edits.get(self.edits_made).filter(|edit| edit.time == now) {
            self.edits_made += 1;
            if let Some(frame) = self.run.stack().into_iter().nth(edit.frame) {
                // What could be set in one run can be in the other.
                let _ = self.run.assign(&frame, &edit.target, &edit.value);
            }
        }
    }

    /// Up to which step all findings are known.
    fn known_until(&self) -> Time {
        if self.has_ended { Time::MAX } else { self.run.course.time }
    }

    /// The steps, ascending, at which findings that stop are met.
    fn times(&self) -> impl DoubleEndedIterator<Item = Time> + '_ {
        let known = self.run.sanitizing.iter();
        known.flat_map(move |known| {
            let stops = |number| known.finding(number).is_some_and(|finding| self.filter.stops_at(finding));
            known.found().iter().filter(move |found| stops(found.finding)).map(|found| found.time)
        })
    }

    /// The findings that a step meets, each with how often it was met up to there.
    fn at(&self, time: Time) -> Vec<Finding> {
        let Some(known) = &self.run.sanitizing else { return Vec::new() };
        let met = known.found().iter().filter(|found| found.time == time);
        let met = met.filter_map(|found| {
            let finding = known.finding(found.finding).filter(|finding| self.filter.stops_at(finding))?;
            let so_far = known.found().iter().take_while(|one| one.time <= time);
            let count = so_far.filter(|one| one.finding == found.finding).count() as u64;
            Some(Finding { count, ..finding.clone() })
        });
        met.collect()
    }

    /// Has the second run do what was set by hand in the first, the last of all these just now.
    pub(super) fn follow(&mut self, edits: &[Edit]) -> Result<()> {
        self.edits = edits.to_vec();
        if edits.last().is_some_and(|last| self.run.course.time > last.time) {
            self.run = (self.prepare)()?;
            (self.edits_made, self.has_ended) = (0, false);
        }
        if self.run.course.paused {
            self.make_edits();
        }
        Ok(())
    }
}

impl Debugger {
    /// A run under the sanitizer, which tells what is met at which step.
    fn sanitized(session: &Session, request: &ExplainRequest, levels: &Levels) -> Result<Self> {
        let mut run = Self::observing_all(session, request)?;
        let assembled = session.assembled();
        let (number, is_launch) = match session.invocation(request)? {
            Some((dispatch, _)) => {
                let is_it = |work: &PassWork| matches!(work, PassWork::Dispatch(at) if *at == dispatch);
                (assembled.passes.iter().position(|pass| is_it(&pass.work)), false)
            }
            None => {
                let (_, request) = session.resolve(request)?;
                (Some(assembled.single_launch(request.pass.as_deref())?.number), true)
            }
        };
        let pass = number.and_then(|number| assembled.passes.get(number));
        let own = pass.map(|pass| assembled.pass_resources(pass, &assembled.resources).into_owned());
        let resources = own.unwrap_or_else(|| assembled.resources.clone());
        // What passes before it have written is not known.
        let unwritten = (number == Some(0)).then(|| unwritten_memory(session.scene(), &resources));
        run.history.keep_no_more();
        let pipeline = run.pipeline.clone();
        let names = is_launch.then(|| Rc::new(session.scene().clone()) as Rc<dyn StructureNames>);
        run.sanitizing = Some(Sanitizing::new(&pipeline, names, levels.clone(), |sanitizer| {
            sanitizer.with_unwritten(unwritten.unwrap_or_default()).with_resources(&resources)
        }));
        Ok(run)
    }

    /// Stops from now on at findings of the sanitizer, which a second run knows; `None` for no
    /// longer.
    pub fn stop_at_findings(&mut self, ahead: Option<FindingsAhead>) {
        self.ahead = ahead.map(|ahead| Box::new(FindingsAhead { edits: self.edits.clone(), ..ahead }));
    }

    /// How far a run may go: to the next finding, or to where none is known yet.
    pub(super) fn free_until(&mut self) -> Time {
        let Some(ahead) = &mut self.ahead else { return Time::MAX };
        let now = self.course.time;
        ahead.cover(now.saturating_add(STEPS_AHEAD));
        // What is next has been stopped at, but for the first step of all.
        let next = ahead.times().find(|&time| time > now || time == now && !self.course.paused);
        next.unwrap_or_else(|| ahead.known_until())
    }

    /// The findings that the step that is next meets.
    pub(super) fn findings_here(&self) -> Vec<Finding> {
        self.ahead.as_ref().map_or_else(Vec::new, |ahead| ahead.at(self.course.time))
    }

    /// The last step before a time that meets findings.
    pub(super) fn last_finding_before(&mut self, time: Time) -> Option<Time> {
        let ahead = self.ahead.as_mut()?;
        ahead.cover(time);
        ahead.times().rfind(|&found| found < time)
    }
}
