//! Follows one invocation while it runs: counts its steps, knows its function calls, and tells
//! where lines begin and what is asked to stop it.

use std::cell::RefCell;
use std::fmt;

use anyhit_engine::machine::{Batch, Bindings, Observer, OpIndex, Reg, ShaderIndex};
use anyhit_engine::ops::op::Op;
use anyhit_engine::pipeline::Event;
use anyhit_sanitize::Sanitizer;

use super::condition::{Ran, StopConditions};
use super::course::{ActiveShader, Course, FrameLine, Moment, Time};
use super::sanitized_steps::FindingTimes;
use super::segment_summary::SegmentSummary;
use super::source_map::{ShaderSites, Site, SourceMap, SourcePosition};
use super::unwritten::incoming;
use super::words_then::RegistersNow;

/// The invocation that is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Followed {
    /// The lane that it has in every batch of a pipeline.
    Lane(usize),
    /// The lane with this `GlobalInvocationId`, in whichever batch of its workgroup it is.
    Invocation([u32; 3]),
}

impl Followed {
    /// Its lane in a batch.
    pub fn lane<const W: usize>(self, batch: &Batch<W>) -> Option<usize> {
        match self {
            Self::Lane(lane) => Some(lane),
            Self::Invocation(id) => {
                batch.live().lanes().find(|&lane| batch.invocations.launch_id(lane) == id)
            }
        }
    }
}

/// The observer that follows an invocation.
pub struct Tracker<'a> {
    pub(super) course: &'a mut Course,
    sources: &'a SourceMap,
    followed: Followed,
    /// What stops it.
    conditions: &'a mut StopConditions,
    /// What the pipeline reports.
    inbox: &'a RefCell<Vec<Event>>,
    /// Where lines are noted that begin for the first time.
    summary: Option<&'a mut SegmentSummary>,
    /// The times of what a sanitizer finds, where one observes the run, too.
    pub(super) findings: Option<FindingTimes<'a>>,
    /// Where invocations print, where that is noted.
    pub(super) prints: Option<Vec<Print>>,
    /// What others of the workgroup do while the invocation waits, where that is measured.
    pub(super) others: Option<OthersWork>,
    shader: ShaderIndex,
    lane: Option<usize>,
}

/// The work of others between two steps of the invocation that is followed.
#[derive(Clone, Copy, Debug)]
pub(super) struct OthersWork {
    /// The instructions of others after which the run is paused.
    pub limit: u64,
    /// The instructions of the whole workgroup up to where the invocation stopped last.
    pub before: Option<u64>,
    /// Whether others have executed so many.
    pub is_long: bool,
}

/// An invocation has printed a text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Print {
    /// The step behind it.
    pub time: Time,
    /// The invocation.
    pub launch_id: [u32; 3],
    /// The line.
    pub position: Option<SourcePosition>,
}

/// The observers of a debugged run: a sanitizer if there is one, and behind it the tracker, which
/// notes when the sanitizer finds something.
#[derive(Debug)]
pub struct DebugObservers<'a> {
    pub(super) sanitizer: Option<Sanitizer<'a>>,
    /// The tracker.
    pub tracker: Tracker<'a>,
}

impl<'a> DebugObservers<'a> {
    /// Calls a run with one observer that stands for all.
    pub fn observe<const W: usize, R>(&mut self, run: &mut dyn FnMut(&mut dyn Observer<W>) -> R) -> R
    where
        Sanitizer<'a>: Observer<W>,
    {
        match &mut self.sanitizer {
            Some(sanitizer) => run(&mut (sanitizer, &mut self.tracker)),
            None => run(&mut self.tracker),
        }
    }
}

impl fmt::Debug for Tracker<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tracker").field("time", &self.course.time).finish_non_exhaustive()
    }
}

impl<'a> Tracker<'a> {
    pub(super) fn new(
        course: &'a mut Course,
        sources: &'a SourceMap,
        followed: Followed,
        conditions: &'a mut StopConditions,
        inbox: &'a RefCell<Vec<Event>>,
        summary: Option<&'a mut SegmentSummary>,
    ) -> Self {
        // The step at which it was paused is made without another call of the observer.
        if std::mem::take(&mut course.paused) {
            course.time += 1;
            course.events.clear();
        }
        Self {
            course,
            sources,
            followed,
            conditions,
            inbox,
            summary,
            findings: None,
            prints: None,
            others: None,
            shader: ShaderIndex(0),
            lane: None,
        }
    }

    /// Takes what the pipeline has reported.
    pub fn take_events(&mut self) {
        for event in self.inbox.borrow_mut().drain(..) {
            match &event {
                Event::Enter { shader, .. } => self.enter(*shader),
                Event::Leave { .. } => self.leave(),
                _ => {}
            }
            if let Some(findings) = &mut self.findings {
                // The instruction that has called the pipeline was the step before.
                findings.event(event.clone(), self.course.time.saturating_sub(1));
            }
            self.conditions.event(&event, self.course.events.len());
            self.course.events.push(event);
        }
    }

    fn enter(&mut self, shader: ShaderIndex) {
        let base = self.course.frames.len() as u32;
        let run = self.course.begun;
        let sites = self.sources.shader(shader);
        let mut unwritten = sites.writes.at_begin();
        let caller = self.course.active.iter().rev().find_map(|active| Some((active, active.passes?)));
        if let (Some(given), Some((caller, from))) = (incoming(&sites.program), caller) {
            unwritten.take(given.first, &caller.unwritten, from, given.count);
        }
        self.course.begun += 1;
        let (passes, last_block, last_calls) = (None, None, 0);
        let active = ActiveShader { shader, run, base, passes, last_block, last_calls, unwritten };
        self.course.active.push(active);
        self.course.last = None;
    }

    fn leave(&mut self) {
        if let Some(ended) = self.course.active.pop() {
            self.course.frames.truncate(ended.base as usize);
            let given = incoming(&self.sources.shader(ended.shader).program);
            let mut callers = self.course.active.iter_mut().rev();
            let caller = callers.find_map(|active| Some((active.passes?, &mut active.unwritten)));
            if let (Some(given), Some((to, caller))) = (given, caller) {
                caller.take(to, &ended.unwritten, given.first, given.count);
            }
        }
        self.course.last = None;
    }

    /// The invocation is about to make a step; whether it is to be paused.
    fn arrive(&mut self, op: OpIndex, calls: usize) -> bool {
        let sources = self.sources;
        let sites = sources.shader(self.shader);
        let site = sites.site(op);
        let moved = self.course.last != Some((self.shader, site));
        if moved || self.conditions.watches_every_step() {
            let moment = self.moment(sites, op, site, calls, moved);
            if moment.begins_line
                && let Some(summary) = &mut self.summary
            {
                summary.add(moment.depth, site.line);
            }
            self.conditions.arrive(&moment);
        }
        self.course.last_op = Some((self.shader, op));
        if self.conditions.is_met(self.course.time) {
            self.course.paused = true;
            return true;
        }
        self.course.time += 1;
        if !self.course.events.is_empty() {
            self.course.events.clear();
        }
        false
    }

    /// Follows calls and returns to the function of a site.
    fn moment(
        &mut self,
        sites: &'a ShaderSites,
        op: OpIndex,
        site: Site,
        calls: usize,
        moved: bool,
    ) -> Moment<'a> {
        let course = &mut *self.course;
        let base = course.active.last().map_or(0, |active| active.base);
        let depth = base + calls as u32 + sites.depth(site.scope);
        let (mut begins_line, mut begins_function) = (false, false);
        if moved {
            course.frames.truncate(depth as usize + 1);
            let nowhere = FrameLine { scope: u32::MAX, line: 0, has_begun: false };
            course.frames.resize(depth as usize + 1, nowhere);
            let frame = &mut course.frames[depth as usize];
            if frame.scope != site.scope {
                *frame = FrameLine { scope: site.scope, ..nowhere };
            }
            if site.line != 0 && frame.line != site.line {
                frame.line = site.line;
                begins_line = true;
                begins_function = !std::mem::replace(&mut frame.has_begun, true);
            }
            course.last = Some((self.shader, site));
        }
        let is_same =
            |last: OpIndex| sites.program.origins.get(last.index()) == sites.program.origins.get(op.index());
        let begins_instruction =
            course.last_op.is_none_or(|(shader, last)| shader != self.shader || !is_same(last));
        Moment {
            time: course.time,
            shader: self.shader,
            sites,
            op,
            site,
            depth,
            begins_line,
            begins_function,
            begins_instruction,
        }
    }

    /// Notes what the followed invocation has made the sanitizer find at a step.
    fn note_findings<const W: usize>(&mut self, batch: &Batch<W>, time: Time) {
        let followed = self.followed;
        if let Some(findings) = &mut self.findings {
            findings.note(time, || followed.lane(batch).map(|lane| batch.invocations.launch_id(lane)));
        }
    }

    /// Notes where invocations print.
    fn note_print<const W: usize>(&mut self, batch: &Batch<W>, op: OpIndex) {
        let sites = self.sources.shader(self.shader);
        if let Some(prints) = &mut self.prints
            && sites.program.ops.get(op.index()).is_some_and(Op::prints)
        {
            let (time, position) = (self.course.time, sites.position(sites.offset(op)));
            let ids = batch.mask.lanes().map(|lane| batch.invocations.launch_id(lane));
            prints.extend(ids.map(|launch_id| Print { time, launch_id, position }));
        }
    }

    /// The invocation goes on. Pauses it at its next step if others have worked for long, as
    /// nobody wants to run them again: a checkpoint is due.
    fn look_at_others<const W: usize>(&mut self, batch: &Batch<W>) {
        let Some(others) = self.others.as_mut().filter(|_| self.lane.is_some()) else { return };
        let now = work(batch);
        if others.before.is_some_and(|before| now.saturating_sub(before) >= others.limit) {
            others.is_long = true;
            self.conditions.until = self.course.time;
        }
        others.before = Some(now);
    }

    /// The lane, where it is among those that run.
    fn running_lane<const W: usize>(&self, batch: &Batch<W>) -> Option<usize> {
        self.lane.filter(|&lane| batch.mask.contains(lane))
    }
}

/// The instructions that the workgroup of a batch has executed, as far as they have been counted.
fn work<const W: usize>(batch: &Batch<W>) -> u64 {
    batch.watch.as_ref().map_or(0, |watch| watch.spent())
}

impl<const W: usize> Observer<W> for Tracker<'_> {
    fn began(&mut self, _: ShaderIndex, batch: &mut Batch<W>) {
        self.note_findings(batch, self.course.time);
    }

    fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        self.note_findings(batch, self.course.time);
        self.continued(shader, batch);
    }

    fn continued(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        self.take_events();
        self.shader = shader;
        self.lane = self.followed.lane(batch);
        self.look_at_others(batch);
        // Compute shaders report no begin.
        if self.course.active.is_empty() && self.lane.is_some() {
            self.enter(shader);
        }
        if self.conditions.watches_results()
            && let Some(lane) = self.running_lane(batch)
            && let Some(active) = self.course.active.last()
        {
            let word = |reg: Reg| batch.registers[reg].0[lane];
            let now = RegistersNow { word: &word, unwritten: &active.unwritten };
            self.conditions.resumed(active.run, &now);
        }
    }

    fn stopped(&mut self, shader: ShaderIndex, batch: &Batch<W>) {
        self.note_findings(batch, self.course.time);
        if let Some(others) = self.others.as_mut().filter(|_| self.lane.is_some()) {
            others.before = Some(work(batch));
        }
        let program = &self.sources.shader(shader).program;
        if self.lane.is_some()
            && let Some(call) = program.ops.get(batch.stopped_at().index())
            && call.calls_pipeline()
            && let Some(active) = self.course.active.last_mut()
        {
            active.passes = call.payload_span().map(|span| span.first);
        }
    }

    fn block(&mut self, batch: &Batch<W>) {
        self.note_findings(batch, self.course.time);
        if self.running_lane(batch).is_none() {
            return;
        }
        let calls = batch.frames().len();
        let Some(active) = self.course.active.last_mut() else { return };
        // A loop begins its lines anew in each turn.
        if active.last_calls == calls && active.last_block.is_some_and(|last| batch.block <= last) {
            if let Some(frame) = self.course.frames.last_mut() {
                frame.line = 0;
            }
            self.course.last = None;
        }
        (active.last_block, active.last_calls) = (Some(batch.block), calls);
    }

    fn before(&mut self, batch: &mut Batch<W>, op: OpIndex) -> bool {
        self.note_findings(batch, self.course.time);
        self.running_lane(batch).is_some() && self.arrive(op, batch.frames().len())
    }

    fn after(&mut self, batch: &mut Batch<W>, _: &Bindings, op: OpIndex) {
        // The step was counted before it was made.
        self.note_findings(batch, self.course.time.saturating_sub(1));
        if self.prints.is_some() {
            self.note_print(batch, op);
        }
        let sites = self.sources.shader(self.shader);
        if sites.writes.concern(op)
            && let Some(lane) = self.running_lane(batch)
            && let Some(active) = self.course.active.last_mut()
        {
            active.unwritten.ran(&sites.program.ops[op.index()], &|reg| batch.registers[reg].0[lane]);
        }
        if let Some(events) = batch.queries.events.as_mut().filter(|events| !events.is_empty()) {
            let lane = self.lane.map(|lane| lane as u32);
            let own = events.drain(..).filter(|event| Some(event.lane) == lane);
            self.inbox.borrow_mut().extend(own.map(Event::RayQuery));
            self.take_events();
        }
        if self.conditions.watches_results()
            && let Some(lane) = self.running_lane(batch)
            && let Some(active) = self.course.active.last()
        {
            let caller = self.course.caller(self.course.active.len() - 1);
            let ran = Ran { program: &sites.program, run: active.run, caller, op };
            let word = |reg: Reg| batch.registers[reg].0[lane];
            let now = RegistersNow { word: &word, unwritten: &active.unwritten };
            // The step was counted before it was made.
            self.conditions.ran(self.course.time - 1, ran, &now);
        }
    }

    fn terminator(&mut self, batch: &mut Batch<W>) -> bool {
        self.note_findings(batch, self.course.time);
        let terminator = self.sources.shader(self.shader).program.terminator_index(batch.block);
        self.running_lane(batch).is_some() && self.arrive(terminator, batch.frames().len())
    }
}
