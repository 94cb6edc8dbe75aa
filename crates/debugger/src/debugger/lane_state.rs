//! What a stopped shader offers to whoever reads its variables.

use std::fmt::Debug;

use anyhit_engine::machine::hit_object::HitObject;
use anyhit_engine::machine::ray_query::RayQuery;
use anyhit_engine::machine::{Bindings, Buffer, Reg};
use anyhit_engine::ops::builtin::Builtin;

/// One invocation that is stopped: its registers, and the memory that it reaches.
pub trait LaneState: Debug {
    /// The word of a register.
    fn register(&self, register: Reg) -> u32;

    /// Whether a register holds a value of the shader's: that of a variable which has not been
    /// written holds none.
    fn is_written(&self, _: Reg) -> bool {
        true
    }

    /// Sets the word of a register.
    fn set_register(&mut self, register: Reg, word: u32);

    /// The descriptors of its program.
    fn bindings(&self) -> &Bindings;

    /// The buffer of its shader record, where in it the record's data begins, and the size of the
    /// data.
    fn shader_record(&self) -> Option<(&Buffer, u64, u64)>;

    /// The memory of its workgroup.
    fn workgroup_memory(&self) -> Option<&Buffer>;

    /// The ray query with a handle; `None` where it is not initialised.
    fn ray_query(&self, _: u32) -> Option<&RayQuery> {
        None
    }

    /// The hit object with a handle.
    fn hit_object(&self, _: u32) -> Option<&HitObject> {
        None
    }

    /// The words of a builtin, whether the shader reads it or not; `None` where its stage has no
    /// such builtin.
    fn builtin(&self, builtin: &'static Builtin) -> Option<Vec<u32>>;
}
