//! Who wrote a value last: a search backwards, through the payloads that shaders pass each other.

use std::ops::Range;

use anyhit_engine::machine::Reg;
use anyhit_engine::ops::op::Op;
use anyhit_engine::program::Program;

use super::Debugger;
use super::breakpoint::BreakpointId;
use super::condition::{Reason, StopConditions, Watch, WatchedWords, Write};
use super::course::{HOST, Time};
use super::inspect::check_followed;
use super::stack::StackFrame;
use super::unwritten::incoming;
use super::variable_place::VariablePlace;

/// Who gave a value what it is.
#[derive(Clone, Debug, PartialEq)]
pub enum LastWrite {
    /// The step that is next writes it.
    Step(Write),
    /// It was set by hand before the step that is next.
    SetByHand,
    /// Nothing has written it.
    Nobody,
}

impl Debugger {
    /// Goes back to the step that wrote a value last: it is next then. A payload is followed into
    /// the shaders that were given it, and out to the one that gave it.
    ///
    /// Where it was set by hand later than that, it goes there; where nothing has written it, it
    /// stays.
    ///
    /// # Errors
    /// Why the value cannot be followed, in words.
    pub fn back_to_last_write(
        &mut self,
        frame: &StackFrame,
        place: &VariablePlace,
    ) -> Result<LastWrite, String> {
        let now = self.course.time;
        let mut words = self.watched_words(frame, place)?;
        let mut number = frame.number;
        loop {
            // What others have written who were given these words, and what its own shader has.
            let passed = self.passed_from(&words, number);
            let outer = self.given_by(&words, number);
            let last = self.last_write(&words, now);
            let passed = passed.or_else(|| self.given_by_host(&words, number));
            let last = match passed {
                Some(passed) => later(last, self.last_write(&passed, now)),
                None => last,
            };
            self.seek(now);
            let written = last.as_ref().map(|write| write.time.unwrap_or(now));
            if let Some(edit) = self.last_edit(&words, now).filter(|&edit| Some(edit) > written) {
                self.seek(edit);
                return Ok(LastWrite::SetByHand);
            }
            match (last, outer) {
                (Some(write), _) => {
                    self.seek(write.time.unwrap_or(now));
                    return Ok(LastWrite::Step(write));
                }
                (None, Some(outer)) => (number, words) = (number - 1, outer),
                (None, None) => return Ok(LastWrite::Nobody),
            }
        }
    }

    /// What watches a value for a data breakpoint: of a payload, also what the shaders have that
    /// are given it.
    ///
    /// # Errors
    /// Why the value cannot be watched, in words.
    pub fn watches_of(
        &mut self,
        id: BreakpointId,
        frame: &StackFrame,
        place: &VariablePlace,
    ) -> Result<Vec<Watch>, String> {
        let words = self.watched_words(frame, place)?;
        let passed = self.passed_from(&words, frame.number);
        Ok(std::iter::once(words).chain(passed).map(|words| Watch::new(Some(id), words)).collect())
    }

    /// Whether a shader has given these words to one that runs: what is set here is overwritten
    /// when that returns.
    pub(super) fn is_passed_on(&self, frame: &StackFrame, place: &VariablePlace) -> bool {
        let Some(&first) = place.own_registers().and_then(<[Reg]>::first) else { return false };
        let stopped = self.debuggee.shaders();
        let waits = frame.number + 1 < stopped.len();
        let program = &self.sources.shader(frame.shader).program;
        let op = stopped.get(frame.number).and_then(|stopped| program.ops.get(stopped.op.index()));
        let span = op.filter(|_| waits).and_then(Op::payload_span);
        span.is_some_and(|span| (span.first..span.first.plus(span.count)).contains(&first))
    }

    /// A data breakpoint's words.
    ///
    /// # Errors
    /// Why the value cannot be watched, in words.
    pub fn watched_words(
        &mut self,
        frame: &StackFrame,
        place: &VariablePlace,
    ) -> Result<WatchedWords, String> {
        check_followed(frame)?;
        if let Some(registers) = place.own_registers() {
            let run = self.course.run(frame.number).ok_or("the shader has ended")?;
            return Ok(WatchedWords::Registers { run, registers: registers.to_vec() });
        }
        let memory = self.with_lane(frame, |lane| place.own_memory(lane));
        let why = || place.why_unavailable().unwrap_or("it is neither a variable nor in memory").to_owned();
        memory.map(WatchedWords::Memory).ok_or_else(why)
    }

    /// The last write by an operation before a step. Leaves the debuggee somewhere.
    fn last_write(&mut self, words: &WatchedWords, now: Time) -> Option<Write> {
        let watch = Watch::new(None, words.clone());
        let conditions =
            StopConditions { watches: vec![watch], partial_writes: true, ..StopConditions::default() };
        // A write is seen at the instruction after it, which may be the one that is next now.
        let mut before = now + 1;
        loop {
            let hits = self.last_hits(&conditions, before);
            before = hits.first()?.time;
            let writes = hits.into_iter().filter_map(|hit| match hit.reason {
                Reason::Wrote(write) if write.time.is_some_and(|time| time < now) => Some(write),
                _ => None,
            });
            if let Some(write) = writes.max_by_key(|write| write.time) {
                return Some(write);
            }
        }
    }

    /// What a shader's registers are to those that it calls.
    fn passed_from(&self, words: &WatchedWords, number: usize) -> Option<WatchedWords> {
        let WatchedWords::Registers { run, registers } = words else { return None };
        let stopped = self.debuggee.shaders();
        let program = &self.sources.shader(stopped.get(number)?.shader).program;
        let (first, last) = (*registers.first()?, *registers.last()?);
        let spans = program.ops.iter().filter_map(Op::payload_span);
        let mut holding = spans.filter(|span| (span.first..span.first.plus(span.count)).contains(&first));
        let from = holding.next()?.first;
        Some(WatchedWords::Passed { run: *run, from, words: first.0 - from.0..last.0 + 1 - from.0 })
    }

    /// The words of the payload of a ray from the host, which the shaders that it calls are given
    /// one after the other.
    fn given_by_host(&self, words: &WatchedWords, number: usize) -> Option<WatchedWords> {
        let WatchedWords::Registers { registers, .. } = words else { return None };
        let stopped = self.debuggee.shaders();
        let program = &self.sources.shader(stopped.get(number)?.shader).program;
        let words = given_words(program, registers)?;
        (number == 0).then_some(WatchedWords::Passed { run: HOST, from: Reg(0), words })
    }

    /// The registers of a shader's caller of which it was given these words, if it was.
    pub(super) fn given_by(&self, words: &WatchedWords, number: usize) -> Option<WatchedWords> {
        let WatchedWords::Registers { registers, .. } = words else { return None };
        let stopped = self.debuggee.shaders();
        let program = &self.sources.shader(stopped.get(number)?.shader).program;
        let given = given_words(program, registers)?;
        let (run, from) = self.course.caller(number)?;
        if run == HOST {
            return None;
        }
        Some(WatchedWords::Registers { run, registers: given.map(|word| from.plus(word)).collect() })
    }
}

/// The later of two writes.
fn later(one: Option<Write>, other: Option<Write>) -> Option<Write> {
    [one, other].into_iter().flatten().max_by_key(|write| write.time)
}

/// Which words of the payload or callable data that a shader is given are these registers.
fn given_words(program: &Program, registers: &[Reg]) -> Option<Range<u32>> {
    let given = incoming(program)?;
    let (first, last) = (registers.first()?.0, registers.last()?.0);
    let is_inside = first >= given.first.0 && last < given.first.0 + given.count;
    is_inside.then(|| first - given.first.0..last + 1 - given.first.0)
}
