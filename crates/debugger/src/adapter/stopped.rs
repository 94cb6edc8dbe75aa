//! What a client may ask for while an invocation is stopped: frames and values, by their numbers.

use std::ops::Range;
use std::sync::Arc;

use crate::debugger::{StackFrame, VariablePlace};
use anyhit_engine::machine::Buffer;

/// A row of the stack that a client is shown.
#[derive(Clone, Debug)]
pub(super) enum StackRow {
    /// A function of a shader.
    Function(Box<StackFrame>),
    /// What lies between a shader and the one that called it: the instruction's name.
    Call(String),
}

/// What the variables of a scope are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScopeKind {
    Locals,
    Payload,
    Builtins,
    Globals,
    Registers,
}

/// Something that has parts.
#[derive(Clone, Debug)]
pub(super) enum Handle {
    /// A scope of a frame.
    Scope(StackFrame, ScopeKind),
    /// A value.
    Place {
        /// The frame whose shader holds it.
        frame: StackFrame,
        /// Where it is.
        place: VariablePlace,
        /// The expression that stands for it, where there is one.
        expression: Option<String>,
    },
}

/// Frames and values by their numbers, which are valid up to the next step.
#[derive(Debug, Default)]
pub(super) struct StoppedState {
    rows: Vec<StackRow>,
    /// Which rows are the stack of a lane; of the followed one first, which has no number.
    stacks: Vec<(Option<usize>, Range<usize>)>,
    /// The number of the first row; no number is used twice.
    first_row: i64,
    handles: Vec<Handle>,
    first_handle: i64,
    /// Memory that was told of: what is read there, and from which byte on. Valid for all of the
    /// session.
    memory: Vec<(Arc<Buffer>, u64)>,
}

impl StoppedState {
    /// Forgets frames and values, and has a new stack of the followed lane.
    pub(super) fn renew(&mut self, rows: Vec<StackRow>) {
        self.first_row += self.rows.len() as i64;
        self.first_handle += self.handles.len() as i64;
        self.handles.clear();
        self.rows.clear();
        self.stacks.clear();
        self.add_stack(None, rows);
    }

    /// Adds the stack of a lane.
    pub(super) fn add_stack(&mut self, lane: Option<usize>, rows: Vec<StackRow>) {
        let first = self.rows.len();
        self.rows.extend(rows);
        self.stacks.push((lane, first..self.rows.len()));
    }

    /// Whether the stack of a lane is known.
    pub(super) fn knows(&self, lane: Option<usize>) -> bool {
        self.stacks.iter().any(|(of, _)| *of == lane)
    }

    /// The rows of the stack of a lane, the innermost first, each with its number.
    pub(super) fn rows(&self, lane: Option<usize>) -> impl ExactSizeIterator<Item = (i64, &StackRow)> {
        let found = self.stacks.iter().find(|(of, _)| *of == lane);
        let range = found.map_or(0..0, |(_, range)| range.clone());
        let first = self.first_row + 1 + range.start as i64;
        self.rows[range].iter().enumerate().map(move |(at, row)| (first + at as i64, row))
    }

    /// The function of a row, by its number.
    pub(super) fn frame(&self, number: i64) -> Result<&StackFrame, String> {
        let at = number.checked_sub(self.first_row + 1).and_then(|at| usize::try_from(at).ok());
        match at.and_then(|at| self.rows.get(at)) {
            Some(StackRow::Function(frame)) => Ok(frame),
            Some(StackRow::Call(_)) => Err("a call has no variables".into()),
            None => Err(format!("stack frame {number} does not exist")),
        }
    }

    /// The innermost function.
    pub(super) fn innermost(&self) -> Result<&StackFrame, String> {
        let frame = self.rows.iter().find_map(|row| match row {
            StackRow::Function(frame) => Some(&**frame),
            StackRow::Call(_) => None,
        });
        frame.ok_or_else(|| "no function has stopped".into())
    }

    /// A number for something that has parts.
    pub(super) fn add(&mut self, handle: Handle) -> i64 {
        self.handles.push(handle);
        self.first_handle + self.handles.len() as i64
    }

    /// What has a number.
    pub(super) fn handle(&self, number: i64) -> Result<&Handle, String> {
        let at = number.checked_sub(self.first_handle + 1).and_then(|at| usize::try_from(at).ok());
        let found = at.and_then(|at| self.handles.get(at));
        found.ok_or_else(|| format!("variablesReference {number} does not exist"))
    }

    /// A reference to memory, from a byte on.
    pub(super) fn memory_reference(&mut self, buffer: &Arc<Buffer>, offset: u64) -> String {
        let is_same = |(known, at): &(Arc<Buffer>, u64)| {
            *at == offset
                && known.memory_id() == buffer.memory_id()
                && (known.offset(), known.size()) == (buffer.offset(), buffer.size())
        };
        let number = self.memory.iter().position(is_same).unwrap_or_else(|| {
            self.memory.push((buffer.clone(), offset));
            self.memory.len() - 1
        });
        format!("memory-{}", number + 1)
    }

    /// What a reference to memory stands for.
    pub(super) fn memory(&self, reference: &str) -> Option<&(Arc<Buffer>, u64)> {
        let number: usize = reference.strip_prefix("memory-")?.parse().ok()?;
        self.memory.get(number.checked_sub(1)?)
    }
}
