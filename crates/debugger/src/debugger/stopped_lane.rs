//! One of the shaders of a stopped invocation, for whoever reads its variables.

use std::fmt;
use std::sync::Arc;

use anyhit_engine::machine::hit_object::HitObject;
use anyhit_engine::machine::ray_query::RayQuery;
use anyhit_engine::machine::{Bindings, Buffer, Reg, ShaderIndex};
use anyhit_engine::ops::builtin::Builtin;

use super::course::{ActiveShader, Course};
use super::debuggee::Debuggee;
use super::lane_state::LaneState;
use super::stack::StackFrame;

/// A shader of the invocation that has begun and not ended.
pub(super) struct StoppedLane<'a> {
    debuggee: &'a mut dyn Debuggee,
    /// What is known of it.
    active: Option<&'a mut ActiveShader>,
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
    pub(super) fn new(debuggee: &'a mut dyn Debuggee, course: &'a mut Course, frame: &StackFrame) -> Self {
        let (number, shader, lane) = (frame.number, frame.shader, frame.lane);
        // What nobody wrote is known of the followed lane alone.
        let active = course.active.get_mut(number).filter(|_| lane.is_none());
        let record = match lane {
            None => debuggee.shader_record(number),
            Some(lane) => debuggee.shader_record_of(lane, number),
        };
        let workgroup_memory = debuggee.workgroup_memory();
        Self { debuggee, active, number, shader, lane, record, workgroup_memory }
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

    fn is_written(&self, register: Reg) -> bool {
        self.active.as_ref().is_none_or(|active| !active.unwritten.contains(register))
    }

    fn set_register(&mut self, register: Reg, word: u32) {
        if self.lane.is_none() {
            if let Some(active) = &mut self.active {
                active.unwritten.write(register, 1);
            }
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

    fn ray_query(&self, handle: u32) -> Option<&RayQuery> {
        self.debuggee.ray_query(self.number, handle)
    }

    fn hit_object(&self, handle: u32) -> Option<&HitObject> {
        self.debuggee.hit_object(self.number, handle)
    }

    fn builtin(&self, builtin: &'static Builtin) -> Option<Vec<u32>> {
        match self.lane {
            None => self.debuggee.builtin(self.number, builtin),
            Some(lane) => self.debuggee.builtin_of(lane, self.number, builtin),
        }
    }
}
