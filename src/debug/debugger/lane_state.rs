//! What a stopped shader offers to whoever reads its variables.

use std::fmt::Debug;

use crate::machine::{Bindings, Buffer, Reg};
use crate::ops::builtin::Builtin;

/// One invocation that is stopped: its registers, and the memory that it reaches.
pub trait LaneState: Debug {
    /// The word of a register.
    fn register(&self, register: Reg) -> u32;

    /// Sets the word of a register.
    fn set_register(&mut self, register: Reg, word: u32);

    /// The descriptors of its program.
    fn bindings(&self) -> &Bindings;

    /// The buffer of its shader record, where in it the record's data begins, and the size of the
    /// data.
    fn shader_record(&self) -> Option<(&Buffer, u64, u64)>;

    /// The memory of its workgroup.
    fn workgroup_memory(&self) -> Option<&Buffer>;

    /// The words of a builtin, whether the shader reads it or not; `None` where its stage has no
    /// such builtin.
    fn builtin(&self, builtin: &'static Builtin) -> Option<Vec<u32>>;
}
