//! A debugger of one invocation or ray: it steps by line and by instruction, into the shaders that
//! a ray calls and through traversal, forwards and backwards.
//!
//! An invocation runs in an unoptimised program, in which every variable has registers of its own.
//! `tracker` follows it and counts its steps; `history` keeps states at some times, so that any
//! step is reached again by running on from the state before it. Nothing here reads or writes a
//! file or a terminal.

mod breakpoint;
mod condition;
mod course;
pub mod debuggee;
mod decision;
pub mod expression;
mod history;
mod id_places;
mod inspect;
pub mod lane_state;
mod last_write;
mod memory_state;
mod object_state;
mod place_memory;
mod segment_summary;
pub mod source_frames;
mod source_locals;
mod source_map;
mod stack;
mod start;
mod stopped_lane;
pub mod tracker;
mod traversal_names;
mod unwritten;
mod value_layout;
mod value_paths;
pub mod variable_place;
pub mod variables;

use std::cell::RefCell;
use std::fmt;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::error::Error;
use crate::machine::Reg;
use crate::machine::printed::Printed;
use crate::pipeline::{Event, Pipeline, Resumed};

use condition::{Hit, StopConditions, words_of};
use course::Course;
use debuggee::Debuggee;
use history::{Checkpoint, History};
use last_write::Edit;
use memory_state::ChangingMemory;
use segment_summary::SegmentSummary;
use tracker::{Followed, Tracker};

pub use breakpoint::{Breakpoint, BreakpointId, BreakpointPlace, BreakpointTable, TraversalFilter};
pub use condition::{Reason, Watch, WatchedWords, Write};
pub use course::Time;
pub use lane_state::LaneState;
pub use last_write::LastWrite;
pub use source_frames::{SourceFrame, source_frames};
pub use source_map::{SourceMap, SourcePosition, SourceText};
pub use stack::StackFrame;
pub use traversal_names::{instance_verdict_name, is_step_of_traversal, verdict_name};
pub use variable_place::VariablePlace;
pub use variables::{
    Variable, VariableKind, global_variables, temporaries_in_frame, variables_in_frame, variables_in_scope,
};

/// A step of the debugger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stepping {
    /// To the next line, in functions and shaders that this one calls, too.
    Into,
    /// To the next line of this function, or of its caller where it ends.
    Over,
    /// To the caller.
    Out,
    /// To the next instruction, in functions and shaders that this one calls, too.
    IntoInstruction,
    /// To the next instruction of this function, or of its caller where it ends.
    OverInstruction,
    /// To what the traversal of a ray does next: a node, an instance, a primitive, a candidate.
    Traversal,
}

/// Why the debugger stopped.
#[derive(Clone, Debug)]
pub enum StopReason {
    /// At the first line.
    Entry,
    /// A step came to its end.
    Step,
    /// At breakpoints.
    Breakpoints(Vec<BreakpointId>),
    /// The traversal did what a breakpoint, if one is given, or a step waits for.
    Traversal(Option<BreakpointId>),
    /// What is watched was written.
    Wrote(Write),
    /// The step before made a NaN from numbers.
    Nan,
    /// The step that is next traps.
    Trap(Error),
    /// Another thread asked for it; [`Debugger::proceed`] goes on with what was interrupted.
    Interrupted,
    /// Nothing is before this.
    Beginning,
    /// Everything has run.
    End,
}

/// Where a run goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Forwards,
    Backwards,
}

/// One invocation or ray that is debugged.
pub struct Debugger {
    debuggee: Box<dyn Debuggee>,
    pipeline: Arc<Pipeline>,
    sources: Rc<SourceMap>,
    memory: ChangingMemory,
    printed: Option<Arc<Printed>>,
    course: Course,
    history: History,
    breakpoints: Vec<Breakpoint>,
    table: Rc<BreakpointTable>,
    watches: Vec<Watch>,
    last_breakpoint: u32,
    /// What was printed, with the time after it.
    output: Vec<(Time, String)>,
    /// The first line's time, once it is known.
    first: Time,
    /// Whether it stops where an operation makes a NaN of numbers, too.
    stops_at_nan: bool,
    interrupt: Option<Arc<AtomicBool>>,
    /// What was interrupted.
    interrupted: Option<StopConditions>,
    /// What was set by hand.
    edits: Vec<Edit>,
    /// The event of the traversal at which it stopped, among [`Debugger::events`].
    matched_event: Option<usize>,
}

impl Debugger {
    fn new(
        debuggee: Box<dyn Debuggee>,
        pipeline: Arc<Pipeline>,
        memory: ChangingMemory,
        printed: Option<Arc<Printed>>,
    ) -> Self {
        let sources = Rc::new(SourceMap::new(&pipeline.programs));
        let course = Course::default();
        let history = History::new(Checkpoint {
            course: course.clone(),
            state: debuggee.save(),
            memory: memory.state(None),
            is_edited: false,
        });
        Self {
            debuggee,
            pipeline,
            sources,
            memory,
            printed,
            course,
            history,
            breakpoints: Vec::new(),
            table: Rc::default(),
            watches: Vec::new(),
            last_breakpoint: 0,
            output: Vec::new(),
            first: 0,
            stops_at_nan: false,
            interrupt: None,
            interrupted: None,
            edits: Vec::new(),
            matched_event: None,
        }
    }

    /// Sets the flag with which another thread interrupts runs forwards.
    pub fn interrupted_by(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = Some(flag);
    }

    /// Whether [`Debugger::resume`] also stops where an operation makes a NaN of numbers.
    pub fn stop_at_nan(&mut self, stops: bool) {
        self.stops_at_nan = stops;
    }

    /// Goes on with what was interrupted.
    pub fn proceed(&mut self) -> StopReason {
        match self.interrupted.take() {
            Some(conditions) => self.run_on(conditions),
            None => StopReason::Step,
        }
    }

    /// Runs to the first line.
    pub fn begin(&mut self) -> StopReason {
        let line = StopConditions { until: Time::MAX, line: Some(u32::MAX), ..StopConditions::default() };
        match self.run(line) {
            StopReason::Step => {
                self.first = self.course.time;
                StopReason::Entry
            }
            other => other,
        }
    }

    /// Goes back to the first line.
    pub fn go_to_first_line(&mut self) {
        self.seek(self.first);
    }

    /// The number of the step that is next.
    pub fn time(&self) -> Time {
        self.course.time
    }

    /// The sources of all shaders.
    pub fn sources(&self) -> &Rc<SourceMap> {
        &self.sources
    }

    /// Gives sources that no module holds a text; `read` finds it by the file's name.
    pub fn supply_texts(&mut self, read: &mut dyn FnMut(&str) -> Option<String>) {
        if let Some(sources) = Rc::get_mut(&mut self.sources) {
            sources.supply_texts(read);
        }
    }

    /// The pipeline that is debugged, not optimised.
    pub fn pipeline(&self) -> &Arc<Pipeline> {
        &self.pipeline
    }

    /// What the pipeline did between the step before and the one that is next.
    pub fn events(&self) -> &[Event] {
        &self.course.events
    }

    /// Which of the [events](Debugger::events) a breakpoint of traversal stopped at.
    pub fn matched_event(&self) -> Option<usize> {
        self.matched_event.filter(|&event| event < self.course.events.len())
    }

    /// What shaders have printed before the step that is next.
    pub fn output(&self) -> impl Iterator<Item = &str> {
        let now = self.course.time;
        let before = self.output.iter().filter(move |(time, _)| *time <= now);
        before.map(|(_, text)| text.as_str())
    }

    /// All that shaders and breakpoints have printed, in the order in which they have: after going
    /// back, also what comes later.
    pub fn all_output(&self) -> impl ExactSizeIterator<Item = &str> {
        self.output.iter().map(|(_, text)| text.as_str())
    }

    /// Makes a step.
    pub fn step(&mut self, step: Stepping) -> StopReason {
        let conditions = self.step_conditions(step, self.course.depth());
        let conditions = StopConditions { breakpoints: Some(self.table.clone()), ..conditions };
        self.run(conditions)
    }

    fn step_conditions(&self, step: Stepping, depth: u32) -> StopConditions {
        let any = Some(u32::MAX);
        let none = StopConditions { until: Time::MAX, ..StopConditions::default() };
        match step {
            Stepping::Into => StopConditions { line: any, ..none },
            // The caller goes on in the middle of a line.
            Stepping::Over => StopConditions { line: Some(depth), below: Some(depth), ..none },
            Stepping::Out => StopConditions { below: Some(depth), ..none },
            Stepping::IntoInstruction => StopConditions { instruction: any, ..none },
            Stepping::OverInstruction => StopConditions { instruction: Some(depth), ..none },
            Stepping::Traversal => StopConditions { traversal: true, ..none },
        }
    }

    /// Runs on to the next breakpoint, watched write or trap.
    pub fn resume(&mut self) -> StopReason {
        self.run(StopConditions {
            until: Time::MAX,
            breakpoints: Some(self.table.clone()),
            nan: self.stops_at_nan,
            ..StopConditions::default()
        })
    }

    /// Sets what is watched, in the place of what was: a run stops where it is written.
    pub fn set_watches(&mut self, watches: Vec<Watch>) {
        self.watches = watches;
    }

    /// What is watched.
    pub fn watches(&self) -> &[Watch] {
        &self.watches
    }

    /// Runs on to the first NaN that an operation makes of numbers.
    pub fn resume_to_nan(&mut self) -> StopReason {
        self.run(StopConditions { until: Time::MAX, nan: true, ..StopConditions::default() })
    }

    /// Runs on until conditions are met.
    fn run(&mut self, mut conditions: StopConditions) -> StopReason {
        conditions.watches.extend(self.watches.iter().cloned());
        self.look_at_watched(&mut conditions);
        conditions.interrupt.clone_from(&self.interrupt);
        self.run_on(conditions)
    }

    fn run_on(&mut self, mut conditions: StopConditions) -> StopReason {
        self.interrupted = None;
        loop {
            if self.advance(&mut conditions) == Resumed::Ended {
                // A write is told where another line begins, and none begins behind the last.
                return match (self.at_end(), conditions.writes.pop()) {
                    (StopReason::End, Some(write)) => StopReason::Wrote(write),
                    (stop, _) => stop,
                };
            }
            if conditions.only_arrived() && self.course.time < conditions.until {
                self.interrupted = Some(conditions);
                return StopReason::Interrupted;
            }
            let reasons = std::mem::take(&mut conditions.met);
            if let Some(stop) = self.decide(&reasons, Direction::Forwards) {
                return stop;
            }
        }
    }

    /// What the end is. It stays before the last step, where everything can still be looked at.
    fn at_end(&mut self) -> StopReason {
        let stop = match self.debuggee.trapped() {
            Some(error) => StopReason::Trap(error.clone()),
            None => StopReason::End,
        };
        self.seek(self.course.time.saturating_sub(1));
        stop
    }

    /// Runs on until conditions are met or everything has run.
    fn advance(&mut self, conditions: &mut StopConditions) -> Resumed {
        let until = conditions.until;
        loop {
            let is_new = self.course.time >= self.history.frontier;
            let edit = self.history.next_edit(self.course.time).map(|edit| edit.course.time);
            let chunk = match is_new {
                true => self.history.next_due(),
                false => self.history.frontier,
            };
            let chunk = chunk.min(conditions.next_look(self.course.time));
            conditions.until = until.min(chunk).min(edit.unwrap_or(Time::MAX));
            conditions.met.clear();
            let resumed = self.run_once(conditions, is_new);
            if is_new {
                self.history.frontier = self.course.time;
            }
            if resumed == Resumed::Ended {
                return resumed;
            }
            if edit == Some(self.course.time) {
                self.restore_segment(self.history.segment_at(self.course.time));
            }
            if is_new && self.course.time >= self.history.next_due() {
                let checkpoint = self.checkpoint(false);
                self.history.push(checkpoint);
            }
            if self.course.time >= until || !conditions.only_arrived() || conditions.is_interrupted() {
                conditions.until = until;
                return resumed;
            }
        }
    }

    fn run_once(&mut self, conditions: &mut StopConditions, is_new: bool) -> Resumed {
        let inbox = RefCell::new(Vec::new());
        let summary = is_new.then(|| self.history.open_summary());
        let followed = self.debuggee.followed();
        let mut tracker =
            Tracker::new(&mut self.course, &self.sources, followed, conditions, &inbox, summary);
        let resumed = self.debuggee.resume(&mut tracker, &inbox);
        let printed = self.printed.as_ref().map_or_else(Vec::new, |printed| printed.take());
        if is_new {
            // Nothing can stop behind the last step.
            let time = self.course.time - u64::from(resumed == Resumed::Ended && self.course.time > 0);
            // Others of its workgroup print, too.
            let own = printed.into_iter().filter(|line| match followed {
                Followed::Invocation(id) => line.launch_id == id,
                Followed::Lane(_) => true,
            });
            self.output.extend(own.map(|line| (time, line.text)));
        }
        resumed
    }

    fn checkpoint(&self, is_edited: bool) -> Checkpoint {
        Checkpoint {
            course: self.course.clone(),
            state: self.debuggee.save(),
            memory: self.memory.state(Some(&self.history.last().memory)),
            is_edited,
        }
    }

    /// Puts the state back that a segment begins with.
    fn restore_segment(&mut self, number: usize) {
        let (checkpoint, _) = self.history.segment(number);
        self.course = checkpoint.course.clone();
        self.debuggee.restore(&checkpoint.state);
        self.memory.restore(&checkpoint.memory);
    }

    /// Goes to a step, or to the last one where there are not so many.
    pub fn seek(&mut self, time: Time) {
        let number = self.history.segment_at(time);
        let kept = self.history.segment(number).0.course.time;
        if time < self.course.time || kept > self.course.time || !self.course.paused {
            self.restore_segment(number);
        }
        let must_run = self.course.time < time || !self.course.paused;
        if must_run && self.advance(&mut StopConditions::at(time)) == Resumed::Ended && self.course.time > 0 {
            self.seek(self.course.time - 1);
        }
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
        let hits = self.last_hits(&conditions, self.course.time);
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
        let mut before = self.course.time;
        loop {
            let hits = self.last_hits(&conditions, before);
            let Some(time) = hits.first().map(|hit| hit.time) else { return self.go_to_beginning() };
            self.seek(time);
            let reasons: Vec<Reason> = hits.into_iter().map(|hit| hit.reason).collect();
            if let Some(stop) = self.decide(&reasons, Direction::Backwards) {
                return stop;
            }
            before = time;
        }
    }

    fn go_to_beginning(&mut self) -> StopReason {
        self.seek(self.first.min(self.course.time));
        StopReason::Beginning
    }

    /// The reasons at the last time before a time at which conditions were met. Searches backwards,
    /// segment by segment, and leaves the debuggee somewhere.
    fn last_hits(&mut self, conditions: &StopConditions, before: Time) -> Vec<Hit> {
        let Some(last) = before.checked_sub(1) else { return Vec::new() };
        for number in (0..self.history.segments()).rev() {
            let (checkpoint, summary) = self.history.segment(number);
            let begins = checkpoint.course.time;
            if begins > last || number > 0 && begins == last || !can_be_in(conditions, summary) {
                continue;
            }
            let until = last.min(self.history.segment_end(number));
            self.restore_segment(number);
            let mut collecting = StopConditions { collects: true, until, ..conditions.clone() };
            self.look_at_watched(&mut collecting);
            self.advance(&mut collecting);
            let hits = collecting.hits;
            let Some(time) = hits.iter().map(|hit| hit.time).filter(|&time| time <= last).max() else {
                continue;
            };
            return hits.into_iter().filter(|hit| hit.time == time).collect();
        }
        Vec::new()
    }

    /// Reads what is watched, so that the next step's write is seen.
    fn look_at_watched(&self, conditions: &mut StopConditions) {
        for watch in &mut conditions.watches {
            watch.last = match &watch.words {
                WatchedWords::Registers { run, registers } => {
                    let number = (0..).map_while(|number| self.course.run(number));
                    let number = number.into_iter().position(|one| one == *run);
                    let word = |number: usize, reg: &Reg| self.debuggee.register(number, *reg);
                    number.map(|number| (*run, registers.iter().map(|reg| word(number, reg)).collect()))
                }
                WatchedWords::Passed { .. } => None,
                WatchedWords::Memory(buffer) => Some((0, words_of(buffer))),
            };
        }
    }

    /// Sets breakpoints, in the place of those that there were; returns them with the lines that
    /// they stop at.
    pub fn set_breakpoints(&mut self, breakpoints: Vec<Breakpoint>) -> &[Breakpoint] {
        self.breakpoints = breakpoints;
        let mut table = BreakpointTable::default();
        for breakpoint in &mut self.breakpoints {
            let mut one = BreakpointTable::default();
            let into = if breakpoint.is_enabled { &mut table } else { &mut one };
            breakpoint.resolved = into.add(breakpoint.id, &breakpoint.place, &self.sources);
        }
        self.table = Rc::new(table);
        &self.breakpoints
    }

    /// A number for a new breakpoint.
    pub fn new_breakpoint_id(&mut self) -> BreakpointId {
        self.last_breakpoint += 1;
        BreakpointId(self.last_breakpoint)
    }

    /// The breakpoints.
    pub fn breakpoints(&self) -> &[Breakpoint] {
        &self.breakpoints
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

impl fmt::Debug for Debugger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Debugger").field("time", &self.course.time).finish_non_exhaustive()
    }
}
