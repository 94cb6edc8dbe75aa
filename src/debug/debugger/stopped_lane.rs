//! One of the shaders of a stopped invocation, for whoever reads its variables.

use std::fmt;
use std::sync::Arc;

use crate::machine::hit_object::HitObject;
use crate::machine::ray_query::RayQuery;
use crate::machine::{Bindings, Buffer, Reg, ShaderIndex};
use crate::ops::builtin::Builtin;

use super::course::{ActiveShader, Course};
use super::debuggee::Debuggee;
use super::lane_state::LaneState;

/// A shader of the invocation that has begun and not ended.
pub(super) struct StoppedLane<'a> {
    debuggee: &'a mut dyn Debuggee,
    /// What is known of it.
    active: Option<&'a mut ActiveShader>,
    /// Its number, from the outermost.
    number: usize,
    shader: ShaderIndex,
    record: Option<(Arc<Buffer>, u64, u64)>,
    workgroup_memory: Option<Arc<Buffer>>,
}

impl<'a> StoppedLane<'a> {
    /// The shader of a number.
    pub(super) fn new(
        debuggee: &'a mut dyn Debuggee,
        course: &'a mut Course,
        number: usize,
        shader: ShaderIndex,
    ) -> Self {
        let active = course.active.get_mut(number);
        let record = debuggee.shader_record(number);
        let workgroup_memory = debuggee.workgroup_memory();
        Self { debuggee, active, number, shader, record, workgroup_memory }
    }
}

impl fmt::Debug for StoppedLane<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StoppedLane").field("number", &self.number).finish_non_exhaustive()
    }
}

impl LaneState for StoppedLane<'_> {
    fn register(&self, register: Reg) -> u32 {
        self.debuggee.register(self.number, register)
    }

    fn is_written(&self, register: Reg) -> bool {
        self.active.as_ref().is_none_or(|active| !active.unwritten.contains(register))
    }

    fn set_register(&mut self, register: Reg, word: u32) {
        if let Some(active) = &mut self.active {
            active.unwritten.write(register, 1);
        }
        self.debuggee.set_register(self.number, register, word);
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
        self.debuggee.builtin(self.number, builtin)
    }
}
