//! A debugger of one invocation or ray: it steps by line and by instruction, into the shaders that
//! a ray calls and through traversal, forwards and backwards.
//!
//! An invocation runs in an unoptimised program, in which every variable has registers of its own.
//! `tracker` follows it and counts its steps; `history` keeps states at some times, so that any
//! step is reached again by running on from the state before it. Nothing here reads or writes a
//! file or a terminal.

mod backwards;
mod breakpoint;
#[cfg(test)]
mod company_tests;
mod condition;
mod course;
pub mod debuggee;
mod decision;
mod edits;
pub mod expression;
mod findings_ahead;
mod history;
mod id_places;
mod inspect;
pub mod lane_state;
mod last_write;
pub mod memory_state;
mod object_state;
mod output;
mod place_memory;
mod prologue;
mod sanitized_steps;
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
mod value_paths;
pub mod variable_place;
pub mod variables;
mod words_then;

use std::cell::RefCell;
use std::fmt;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhit_base::error::Error;
use anyhit_engine::machine::Reg;
use anyhit_engine::machine::printed::{Printed, PrintedLine};
use anyhit_engine::ops::op::Op;
use anyhit_engine::pipeline::{Event, Pipeline, Resumed};
use anyhit_engine::program::Program;
use anyhit_sanitize::{Finding, Levels};

use condition::{StopConditions, words_of};
use course::Course;
use debuggee::Debuggee;
use decision::Direction;
use edits::Edit;
use history::{Checkpoint, History};
use memory_state::ChangingMemory;
use sanitized_steps::Sanitizing;
use tracker::{DebugObservers, Followed, OthersWork, Tracker};
use words_then::RegistersNow;

pub use breakpoint::{Breakpoint, BreakpointId, BreakpointPlace, BreakpointTable, HitLog, TraversalFilter};
pub use condition::{Reason, Watch, WatchedWords, Write};
pub use course::Time;
pub use debuggee::{DebuggedLane, LaneActivity};
pub use findings_ahead::{FindingFilter, FindingsAhead};
pub use lane_state::LaneState;
pub use last_write::LastWrite;
pub use output::DebugOutput;
pub use source_frames::{SourceFrame, source_frames};
pub use source_map::{SourceMap, SourcePosition, SourceText};
pub use stack::{KeptStack, StackFrame};
pub use traversal_names::{instance_verdict_name, is_step_of_traversal, verdict_name};
pub use variable_place::VariablePlace;
pub use variables::{
    Variable, VariableKind, global_variables, temporaries_in_frame, variables_in_frame, variables_in_scope,
};
pub use words_then::WordsThen;

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
    /// The step that is next meets findings of the sanitizer.
    Findings(Vec<Finding>),
    /// The step that is next traps.
    Trap(Error),
    /// Another thread asked for it; [`Debugger::proceed`] goes on with what was interrupted.
    Interrupted,
    /// Nothing is before this.
    Beginning,
    /// Everything has run.
    End,
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
    output: Vec<DebugOutput>,
    /// Whether a shader prints.
    prints: bool,
    /// The first line's time, once it is known.
    first: Time,
    /// Whether it stops where an operation makes a NaN of numbers, too.
    stops_at_nan: bool,
    interrupt: Option<Arc<AtomicBool>>,
    /// What was interrupted.
    interrupted: Option<StopConditions>,
    /// Set by another thread for a search backwards to be given up.
    give_up: Option<Arc<AtomicBool>>,
    /// The sanitizer that looks at this run.
    sanitizing: Option<Sanitizing>,
    /// The run that knows at which steps this one meets findings of the sanitizer.
    ahead: Option<Box<FindingsAhead>>,
    /// What was set by hand, ascending in time.
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
        let prints = |program: &Arc<Program>| program.ops.iter().any(Op::prints);
        let prints = pipeline.programs.iter().any(prints);
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
            prints,
            first: 0,
            stops_at_nan: false,
            interrupt: None,
            interrupted: None,
            give_up: None,
            sanitizing: None,
            ahead: None,
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

    /// Makes a step.
    pub fn step(&mut self, step: Stepping) -> StopReason {
        let conditions = self.step_conditions(step, self.course.depth());
        let nan = self.stops_at_nan;
        let conditions = StopConditions { breakpoints: Some(self.table.clone()), nan, ..conditions };
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
        let wanted = conditions.until;
        loop {
            conditions.until = wanted.min(self.free_until());
            if self.advance(&mut conditions) == Resumed::Ended {
                // A write is told at the next instruction, and none is behind the last.
                return match (self.at_end(), conditions.writes.pop()) {
                    (StopReason::End, Some(write)) => StopReason::Wrote(write),
                    (stop, _) => stop,
                };
            }
            let has_come = std::mem::replace(&mut conditions.until, wanted) <= self.course.time;
            let findings = self.findings_here();
            if !findings.is_empty() {
                return StopReason::Findings(findings);
            }
            if conditions.only_arrived() && self.course.time < wanted {
                if has_come && !conditions.is_interrupted() {
                    continue;
                }
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
            let (resumed, is_due) = self.run_once(conditions, is_new);
            if is_new {
                self.history.frontier = self.course.time;
            }
            if resumed == Resumed::Ended {
                return resumed;
            }
            if edit == Some(self.course.time) {
                self.restore_segment(self.history.segment_at(self.course.time));
            }
            if is_new && (is_due || self.course.time >= self.history.next_due()) {
                let checkpoint = self.checkpoint(false);
                self.history.push(checkpoint);
            }
            if self.course.time >= until || !conditions.only_arrived() || conditions.is_interrupted() {
                conditions.until = until;
                return resumed;
            }
        }
    }

    /// Runs on until conditions are met or everything has run. Returns also whether others of the
    /// workgroup have worked for so long that a checkpoint is due.
    fn run_once(&mut self, conditions: &mut StopConditions, is_new: bool) -> (Resumed, bool) {
        let inbox = RefCell::new(Vec::new());
        let (limit, has_begun) = (self.history.work_interval, self.course.begun > 0);
        let summary = is_new.then(|| self.history.open_summary());
        let followed = self.debuggee.followed();
        let mut tracker =
            Tracker::new(&mut self.course, &self.sources, followed, conditions, &inbox, summary);
        let looking = self.sanitizing.as_mut().and_then(|with| {
            let sanitizer = with.take()?;
            Some(with.looking(sanitizer))
        });
        let (sanitizer, findings) = looking.unzip();
        tracker.findings = findings;
        tracker.prints = (is_new && self.prints).then(Vec::new);
        let others = OthersWork { limit, before: (!has_begun).then_some(0), is_long: false };
        tracker.others = is_new.then_some(others);
        let mut observers = DebugObservers { sanitizer, tracker };
        let resumed = self.debuggee.resume(&mut observers, &inbox);
        let DebugObservers { sanitizer, mut tracker } = observers;
        let sanitizer = sanitizer.map(|sanitizer| sanitizer.borrowing(&[], Levels::defaults(), None));
        let prints = tracker.prints.take().unwrap_or_default();
        let is_due = tracker.others.is_some_and(|others| others.is_long);
        if let Some(sanitizing) = &mut self.sanitizing {
            sanitizing.keep(sanitizer);
        }
        let printed = self.printed.as_ref().map_or_else(Vec::new, |printed| printed.take());
        if is_new {
            // Nothing can stop behind the last step.
            let time = self.course.time - u64::from(resumed == Resumed::Ended && self.course.time > 0);
            // Others of its workgroup print, too.
            let is_own = |line: &PrintedLine| match followed {
                Followed::Invocation(id) => line.launch_id == id,
                Followed::Lane(_) => true,
            };
            self.add_printed(printed.into_iter().filter(is_own).collect(), prints, time);
        }
        (resumed, is_due)
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

    /// Reads what is watched, so that the next step's write is seen.
    fn look_at_watched(&self, conditions: &mut StopConditions) {
        for watch in &mut conditions.watches {
            watch.last = match &watch.words {
                WatchedWords::Registers { run, registers } => {
                    let number = (0..).map_while(|number| self.course.run(number));
                    let number = number.into_iter().position(|one| one == *run);
                    number.and_then(|number| {
                        let word = |reg: Reg| self.debuggee.register(number, reg);
                        let unwritten = &self.course.active.get(number)?.unwritten;
                        Some((*run, RegistersNow { word: &word, unwritten }.words(registers)))
                    })
                }
                WatchedWords::Passed { .. } => None,
                WatchedWords::Memory(buffer) => Some((0, WordsThen::of_memory(words_of(buffer)))),
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

    /// The last number that [`Debugger::new_breakpoint_id`] has given.
    pub fn last_breakpoint_id(&self) -> BreakpointId {
        BreakpointId(self.last_breakpoint)
    }

    /// Has numbers of new breakpoints follow one that somebody else has given.
    pub fn number_breakpoints_after(&mut self, last: BreakpointId) {
        self.last_breakpoint = self.last_breakpoint.max(last.0);
    }

    /// The breakpoints.
    pub fn breakpoints(&self) -> &[Breakpoint] {
        &self.breakpoints
    }
}

impl fmt::Debug for Debugger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Debugger").field("time", &self.course.time).finish_non_exhaustive()
    }
}
