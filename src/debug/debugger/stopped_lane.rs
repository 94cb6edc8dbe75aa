//! One of the shaders of a stopped invocation, for whoever reads its variables.

use std::fmt;
use std::sync::Arc;

use crate::machine::{Bindings, Buffer, Reg, ShaderIndex};
use crate::ops::builtin::Builtin;

use super::debuggee::Debuggee;
use super::lane_state::LaneState;
use super::stack::StackFrame;

/// A shader of the invocation that has begun and not ended.
pub(super) struct StoppedLane<'a> {
    debuggee: &'a mut dyn Debuggee,
    /// Its number, from the outermost.
    number: usize,
    shader: ShaderIndex,
    /// Another lane than the followed one, of which nothing can be set.
    lane: Option<usize>,
    record: Option<(Arc<Buffer>, u64, u64)>,
    workgroup_memory: Option<Arc<Buffer>>,
}

impl<'a> StoppedLane<'a> {
    /// The shader of a frame.
    pub(super) fn new(debuggee: &'a mut dyn Debuggee, frame: &StackFrame) -> Self {
        let (number, shader, lane) = (frame.number, frame.shader, frame.lane);
        let record = match lane {
            None => debuggee.shader_record(number),
            Some(lane) => debuggee.shader_record_of(lane, number),
        };
        let workgroup_memory = debuggee.workgroup_memory();
        Self { debuggee, number, shader, lane, record, workgroup_memory }
    }
}

impl fmt::Debug for StoppedLane<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StoppedLane").field("number", &self.number).finish_non_exhaustive()
    }
}

impl LaneState for StoppedLane<'_> {
    fn register(&self, register: Reg) -> u32 {
        match self.lane {
            None => self.debuggee.register(self.number, register),
            Some(lane) => self.debuggee.register_of(lane, self.number, register),
        }
    }

    fn set_register(&mut self, register: Reg, word: u32) {
        if self.lane.is_none() {
            self.debuggee.set_register(self.number, register, word);
        }
    }

    fn bindings(&self) -> &Bindings {
        self.debuggee.bindings(self.shader)
    }

    fn shader_record(&self) -> Option<(&Buffer, u64, u64)> {
        self.record.as_ref().map(|(buffer, offset, size)| (&**buffer, *offset, *size))
    }

    fn workgroup_memory(&self) -> Option<&Buffer> {
        self.workgroup_memory.as_deref()
    }

    fn builtin(&self, builtin: &'static Builtin) -> Option<Vec<u32>> {
        match self.lane {
            None => self.debuggee.builtin(self.number, builtin),
            Some(lane) => self.debuggee.builtin_of(lane, self.number, builtin),
        }
    }
}
