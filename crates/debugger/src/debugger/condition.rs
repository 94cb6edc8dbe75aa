//! What stops the invocation that is debugged.

use std::collections::VecDeque;
use std::ops::Range;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

use anyhit_engine::machine::{Buffer, OpIndex, Reg};
use anyhit_engine::ops::access::Access;
use anyhit_engine::pipeline::Event;
use anyhit_engine::program::Program;

use super::breakpoint::{BreakpointId, BreakpointTable, HitLog};
use super::course::{Moment, Time};
use super::traversal_names::is_step_of_traversal;
use super::unwritten::{incoming, written_registers};
use super::words_then::{RegistersNow, WordsThen};

/// How many places a search backwards keeps at a time.
const MOST_HITS: usize = 1024;
/// How many steps are made between two looks at whether another thread interrupts.
const STEPS_BETWEEN_LOOKS: Time = 100_000;

/// Why the invocation stopped.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// It came to the wanted time.
    Arrived,
    /// A line, an instruction or the caller was reached, as a step asks.
    Stepped,
    /// A breakpoint.
    Breakpoint(BreakpointId),
    /// The traversal did what a breakpoint or a step waits for; the number of the event among those
    /// before the step.
    Traversal(Option<BreakpointId>, usize),
    /// What is watched was written.
    Wrote(Write),
    /// An operation made the first NaN.
    Nan,
}

/// A write to what a data breakpoint watches.
#[derive(Clone, Debug, PartialEq)]
pub struct Write {
    /// Which of the watches, by its place in their list.
    pub watch: usize,
    /// The step that wrote it; `None` where the pipeline did, as a call of a shader returned.
    pub time: Option<Time>,
    /// The words before.
    pub before: WordsThen,
    /// The words after.
    pub after: WordsThen,
}

/// A reason at a time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Hit {
    /// When: the step that is next then.
    pub time: Time,
    /// Why it stopped.
    pub reason: Reason,
}

/// What a data breakpoint watches.
#[derive(Clone, Debug)]
pub struct Watch {
    /// The breakpoint.
    pub breakpoint: Option<BreakpointId>,
    /// The words.
    pub words: WatchedWords,
    /// What they held last, and the run of the shader that was looked at.
    pub last: Option<(u64, WordsThen)>,
    /// It stops only where this expression holds after the write.
    pub condition: Option<String>,
    /// It stops from this write on; 0 and 1 for the first.
    pub from_hit: u64,
    /// The writes on the way forwards.
    pub hits: HitLog,
}

impl Watch {
    /// What always stops after a write of words.
    pub fn new(breakpoint: Option<BreakpointId>, words: WatchedWords) -> Self {
        Self { breakpoint, words, last: None, condition: None, from_hit: 0, hits: HitLog::default() }
    }
}

/// An operation that ran.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ran<'a> {
    /// The shader.
    pub program: &'a Program,
    /// The number of the shader's run: how many shaders had begun before it.
    pub run: u64,
    /// The run of the shader that called it, and the first register of what it was given.
    pub caller: Option<(u64, Reg)>,
    /// The operation.
    pub op: OpIndex,
}

/// Words that a data breakpoint watches.
#[derive(Clone, Debug)]
pub enum WatchedWords {
    /// Registers of a run of a shader.
    Registers {
        /// The shader's run: how many shaders had begun before it.
        run: u64,
        /// The registers.
        registers: Vec<Reg>,
    },
    /// Words of the payload or callable data that a run of a shader gives to those that it calls.
    Passed {
        /// The run of the shader that calls.
        run: u64,
        /// The first register of its payload or callable data.
        from: Reg,
        /// The words.
        words: Range<u32>,
    },
    /// A buffer, or a part of one, in whole words.
    Memory(Arc<Buffer>),
}

impl WatchedWords {
    /// Whether some words are among both.
    pub(super) fn overlap(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Registers { run, registers }, Self::Registers { run: of, registers: others }) => {
                run == of && registers.iter().any(|register| others.contains(register))
            }
            (Self::Memory(one), Self::Memory(other)) => {
                let range = |buffer: &Buffer| buffer.offset()..buffer.offset() + buffer.size();
                let (a, b) = (range(one), range(other));
                one.memory_id() == other.memory_id() && a.start < b.end && b.start < a.end
            }
            _ => false,
        }
    }
}

/// When the invocation is to stop.
#[derive(Clone, Debug, Default)]
pub(super) struct StopConditions {
    /// At this time, at the latest.
    pub until: Time,
    /// Where a line begins at this depth of calls or less.
    pub line: Option<u32>,
    /// Where an instruction begins at this depth of calls or less.
    pub instruction: Option<u32>,
    /// Where the depth of calls is less.
    pub below: Option<u32>,
    /// At what the traversal of a ray does next.
    pub traversal: bool,
    /// Where an operation has made a NaN.
    pub nan: bool,
    /// At breakpoints.
    pub breakpoints: Option<Rc<BreakpointTable>>,
    /// What is watched.
    pub watches: Vec<Watch>,
    /// Whether reasons are collected up to the time, instead of stopping at the first.
    pub collects: bool,
    /// Whether a write counts of which only some operations have run at the last time.
    pub partial_writes: bool,
    /// What was collected, the earliest first; the last ones, if there are many.
    pub hits: VecDeque<Hit>,
    /// The reasons at the step that is next.
    pub met: Vec<Reason>,
    /// Set by another thread that interrupts the run.
    pub interrupt: Option<Arc<AtomicBool>>,
    /// Writes of the instruction that runs, of which not all operations may have run.
    pub writes: Vec<Write>,
}

impl StopConditions {
    /// Stops at a time only.
    pub(super) fn at(time: Time) -> Self {
        Self { until: time, ..Self::default() }
    }

    /// Whether there is no other reason than that a time has come.
    pub(super) fn only_arrived(&self) -> bool {
        self.met.iter().all(|reason| *reason == Reason::Arrived)
    }

    /// When to look at whether another thread interrupts.
    pub(super) fn next_look(&self, now: Time) -> Time {
        let is_open = self.interrupt.is_some();
        if is_open { now.saturating_add(STEPS_BETWEEN_LOOKS) } else { Time::MAX }
    }

    /// Whether another thread interrupts.
    pub(super) fn is_interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|flag| flag.load(Relaxed))
    }

    /// Whether every step must be looked at, not only those where another line begins.
    pub(super) fn watches_every_step(&self) -> bool {
        let by_instruction = |table: &Rc<BreakpointTable>| table.looks_at_instructions();
        self.instruction.is_some()
            || self.below.is_some()
            // A write is told at the next instruction, which may be of the same line.
            || !self.writes.is_empty()
            || self.breakpoints.as_ref().is_some_and(by_instruction)
    }

    /// Whether the results of operations are looked at.
    pub(super) fn watches_results(&self) -> bool {
        self.nan || !self.watches.is_empty()
    }

    /// Looks at a step that is next.
    pub(super) fn arrive(&mut self, moment: &Moment<'_>) {
        if moment.begins_instruction {
            self.met.extend(self.writes.drain(..).map(Reason::Wrote));
        }
        let within = |limit: Option<u32>| limit.is_some_and(|limit| moment.depth <= limit);
        let below = self.below.is_some_and(|limit| moment.depth < limit);
        if below
            || moment.begins_line && within(self.line)
            || moment.begins_instruction && within(self.instruction)
        {
            self.met.push(Reason::Stepped);
        }
        if let Some(table) = &self.breakpoints {
            table.arrive(moment, &mut |id| self.met.push(Reason::Breakpoint(id)));
        }
    }

    /// Looks at what the pipeline reports, the event of a number among those before a step.
    pub(super) fn event(&mut self, event: &Event, number: usize) {
        if self.traversal && is_step_of_traversal(event) {
            self.met.push(Reason::Traversal(None, number));
        }
        let Some(table) = &self.breakpoints else { return };
        for (id, filter) in &table.traversal {
            if filter.matches(event) {
                self.met.push(Reason::Traversal(Some(*id), number));
            }
        }
    }

    /// Looks at the registers of a run of a shader that goes on: what it called may have written
    /// them.
    pub(super) fn resumed(&mut self, run: u64, now: &RegistersNow<'_>) {
        // Where the shaders that are called are watched, too, what they wrote is known.
        let followed: Vec<BreakpointId> = self
            .watches
            .iter()
            .filter(|watch| matches!(watch.words, WatchedWords::Passed { .. }))
            .filter_map(|watch| watch.breakpoint)
            .collect();
        for (watched, watch) in self.watches.iter_mut().enumerate() {
            let WatchedWords::Registers { run: of, registers } = &watch.words else { continue };
            if *of != run {
                continue;
            }
            if watch.breakpoint.is_some_and(|id| followed.contains(&id)) {
                watch.last = Some((run, now.words(registers)));
                continue;
            }
            let after = now.words(registers);
            let before = watch.last.replace((run, after.clone())).map(|(_, words)| words);
            if let Some(before) = before.filter(|before| before.words != after.words) {
                self.writes.push(Write { watch: watched, time: None, before, after });
            }
        }
    }

    /// Looks at what an operation of one of the shaders has done, and at the registers there.
    pub(super) fn ran(&mut self, time: Time, ran: Ran<'_>, registers_now: &RegistersNow<'_>) {
        let Ran { program, op, .. } = ran;
        for (watched, watch) in self.watches.iter_mut().enumerate() {
            let own = match &watch.words {
                WatchedWords::Registers { run, registers } if *run == ran.run => Some(registers.clone()),
                WatchedWords::Passed { run, from, words } if ran.caller == Some((*run, *from)) => {
                    Some(passed_registers(program, words.clone()))
                }
                WatchedWords::Registers { .. } | WatchedWords::Passed { .. } => continue,
                WatchedWords::Memory(_) => None,
            };
            let now = match (&own, &watch.words) {
                (Some(registers), _) => registers_now.words(registers),
                (None, WatchedWords::Memory(buffer)) => WordsThen::of_memory(words_of(buffer)),
                (None, _) => continue,
            };
            let wrote = own.is_none_or(|registers| writes(program, op, &registers, registers_now.word));
            // What a run of another shader holds is no change.
            let before = watch.last.take().filter(|(run, _)| *run == ran.run || wrote);
            let before = before.map_or_else(|| now.clone(), |(_, words)| words);
            watch.last = Some((ran.run, now.clone()));
            let is_memory = matches!(watch.words, WatchedWords::Memory(_));
            // A variable that begins anew is not written.
            if before.words != now.words || wrote && !is_memory {
                let time = wrote.then_some(time);
                // An instruction may be several operations.
                match self.writes.iter_mut().find(|write| write.watch == watched) {
                    Some(write) => write.after = now,
                    None => self.writes.push(Write { watch: watched, time, before, after: now }),
                }
            }
        }
        if self.nan && makes_nan(program, op, registers_now.word) {
            self.met.push(Reason::Nan);
        }
    }

    /// Whether the invocation stops at the step that is next.
    pub(super) fn is_met(&mut self, time: Time) -> bool {
        if self.collects {
            if time >= self.until && self.partial_writes {
                // The rest of an instruction that is still under way is behind what is searched.
                self.met.extend(self.writes.drain(..).map(Reason::Wrote));
            }
            for reason in self.met.drain(..) {
                if self.hits.len() == MOST_HITS {
                    self.hits.pop_front();
                }
                self.hits.push_back(Hit { time, reason });
            }
            return time >= self.until;
        }
        if self.met.is_empty() && time >= self.until {
            self.met.push(Reason::Arrived);
        }
        !self.met.is_empty()
    }
}

/// The words of a buffer.
pub(super) fn words_of(buffer: &Buffer) -> Vec<u32> {
    buffer.words().iter().map(|word| word.load(Relaxed)).collect()
}

/// The registers of words of the payload, or of the callable data, that a shader is given.
fn passed_registers(program: &Program, words: Range<u32>) -> Vec<Reg> {
    let given = incoming(program);
    let all = given.map_or(0..0, |given| words.start.min(given.count)..words.end.min(given.count));
    all.map(|word| given.map_or(Reg(0), |given| given.first.plus(word))).collect()
}

/// Whether an operation that ran has written one of the registers; `register` reads them.
fn writes(program: &Program, op: OpIndex, registers: &[Reg], register: &dyn Fn(Reg) -> u32) -> bool {
    let mut wrote = false;
    let Some(op) = program.ops.get(op.index()) else { return false };
    written_registers(op, register, &mut |first, count| {
        wrote |= registers.iter().any(|reg| reg.0.wrapping_sub(first.0) < count);
    });
    wrote
}

/// Whether an operation's result is a NaN of 32 bits, and none of what it reads is one.
fn makes_nan(program: &Program, op: OpIndex, register: &dyn Fn(Reg) -> u32) -> bool {
    let is_nan = |word: u32| f32::from_bits(word).is_nan();
    let Some(operation) = program.ops.get(op.index()) else { return false };
    let (mut made, mut read) = (false, false);
    operation.accesses(|access| match access {
        Access::Write(first, count) => {
            made |= (0..count).any(|word| is_nan(register(first.plus(word))));
        }
        Access::Read(first, count) => {
            read |= (0..count).any(|word| is_nan(register(first.plus(word))));
        }
        Access::Effect => {}
    });
    made && !read && program.module.is_float_result(program.origins[op.index()].offset)
}
