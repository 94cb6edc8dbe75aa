//! Who wrote a value last: a search backwards, through the payloads that shaders pass each other.

use std::ops::Range;

use crate::machine::Reg;
use crate::ops::op::Op;
use crate::ops::pointer::storage;
use crate::program::Program;

use super::condition::{Reason, StopConditions, Watch, WatchedWords, Write};
use super::stack::StackFrame;
use super::tracker::Time;
use super::variable_place::VariablePlace;
use super::{Debugger, Stop};

impl Debugger {
    /// Goes back to the step that wrote a value last: it is next then. A payload is followed into
    /// the shaders that were given it, and out to the one that gave it.
    ///
    /// Returns the write, or [`Stop::Beginning`] and goes there where nothing has written it.
    ///
    /// # Errors
    /// Why the value cannot be followed, in words.
    pub fn back_to_last_write(&mut self, frame: &StackFrame, place: &VariablePlace) -> Result<Stop, String> {
        let now = self.course.time;
        let mut words = self.watched_words(frame, place)?;
        let (mut number, mut before) = (frame.number, now);
        loop {
            let write = self.last_write(&words, before);
            match write {
                Some((time, write)) if write.time.is_some() => {
                    self.seek(write.time.unwrap_or(time));
                    return Ok(Stop::Wrote(write));
                }
                // The call of a shader that was given it returned before this step.
                Some((time, write)) => {
                    let Some(passed) = self.passed_from(&words, number) else {
                        self.seek(time);
                        return Ok(Stop::Wrote(write));
                    };
                    (number, before) = (number + 1, time);
                    words = WatchedWords::Passed { number, words: passed };
                }
                None => {
                    self.seek(now);
                    let Some(outer) = self.given_by(&words, number) else {
                        return Ok(self.to_beginning());
                    };
                    (number, words) = (number - 1, outer);
                }
            }
        }
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
        if let Some(registers) = place.own_registers() {
            let run = self.course.run(frame.number).ok_or("the shader has ended")?;
            return Ok(WatchedWords::Registers { run, registers: registers.to_vec() });
        }
        let memory = self.with_lane(frame, |lane| place.own_memory(lane));
        let why = || place.why_unavailable().unwrap_or("it is neither a variable nor in memory").to_owned();
        memory.map(WatchedWords::Memory).ok_or_else(why)
    }

    /// The last write before a time, and the time at which it shows.
    fn last_write(&mut self, words: &WatchedWords, before: Time) -> Option<(Time, Write)> {
        let watch = Watch { breakpoint: None, words: words.clone(), last: None };
        let conditions = StopConditions { watches: vec![watch], ..StopConditions::default() };
        let hits = self.last_hits(&conditions, before);
        hits.into_iter().find_map(|hit| match hit.reason {
            Reason::Wrote(write) => Some((hit.time, write)),
            _ => None,
        })
    }

    /// Which words of what a shader passes to others are registers of its own.
    fn passed_from(&self, words: &WatchedWords, number: usize) -> Option<Range<u32>> {
        let WatchedWords::Registers { registers, .. } = words else { return None };
        let stopped = self.debuggee.shaders();
        let program = &self.sources.shader(stopped.get(number)?.shader).program;
        let (first, last) = (*registers.first()?, *registers.last()?);
        let spans = program.ops.iter().filter_map(|op| match op {
            Op::Stop(call) => call.payload_span(),
            _ => None,
        });
        let mut holding = spans.filter(|span| (span.first..span.first.plus(span.count)).contains(&first));
        let span = holding.next()?;
        Some(first.0 - span.first.0..last.0 + 1 - span.first.0)
    }

    /// The words of a shader's caller that it was given, if these words are such.
    fn given_by(&self, words: &WatchedWords, number: usize) -> Option<WatchedWords> {
        let stopped = self.debuggee.shaders();
        let program = |number: usize| Some(&*self.sources.shader(stopped.get(number)?.shader).program);
        let given = match words {
            WatchedWords::Registers { registers, .. } => given_words(program(number)?, registers)?,
            WatchedWords::Passed { words, .. } => words.clone(),
            WatchedWords::Memory(_) => return None,
        };
        let caller = number.checked_sub(1)?;
        let Op::Stop(call) = program(caller)?.ops.get(stopped[caller].op.index())? else { return None };
        let span = call.payload_span()?;
        let registers = given.filter(|&word| word < span.count).map(|word| span.first.plus(word)).collect();
        Some(WatchedWords::Registers { run: self.course.run(caller)?, registers })
    }
}

/// Which words of the payload or callable data that a shader is given are these registers.
fn given_words(program: &Program, registers: &[Reg]) -> Option<Range<u32>> {
    let classes = [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA];
    let given = classes.into_iter().find_map(|class| program.interface_registers(class))?;
    let (first, last) = (registers.first()?.0, registers.last()?.0);
    let is_inside = first >= given.first.0 && last < given.first.0 + given.count;
    is_inside.then(|| first - given.first.0..last + 1 - given.first.0)
}
