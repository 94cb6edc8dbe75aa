//! What the shadow interpreter needs to know of a scene.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::stability::place::Programs;
use crate::stability::shadow_value::ShadowValue;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::shadow_op::{ShadowOp, shadow_op};
use anyhit_engine::program::Program;
use anyhit_scene::{Assembled, ResolvedScene};

/// What the shadow interpreter needs to know of a scene.
pub(super) struct ShadowContext {
    pub programs: Programs,
    /// The shadow operations, by shader and operation.
    pub shadow_ops: Vec<Vec<ShadowOp>>,
    /// The word offsets of branches, by shader and block.
    pub branches: Vec<Vec<u32>>,
    /// The ray flags that a pipeline adds to those of every ray: of `[pipeline]`, then of the named
    /// ones.
    flags: Vec<u32>,
    /// The shadow values of buffers after a pass, for later passes.
    memory: Mutex<Memory>,
}

impl ShadowContext {
    pub(super) fn new(scene: &ResolvedScene, assembled: &Assembled) -> Self {
        let programs = Programs::of(scene, assembled);
        let shadow_ops = |program: &Arc<Program>| {
            let of = |op: &Op| {
                if let Op::LaneKernel { kernel, .. } = op { shadow_op(kernel) } else { ShadowOp::None }
            };
            program.ops.iter().map(of).collect()
        };
        let shadow_ops = programs.all.iter().map(shadow_ops).collect();
        let branches = programs.all.iter().map(|program| branch_offsets(program)).collect();
        let flags = assembled.all_pipelines().map(|(_, pipeline)| pipeline.flags.ray_flags()).collect();
        Self { programs, shadow_ops, branches, flags, memory: Mutex::default() }
    }

    /// The ray flags that a pipeline adds to those of every ray.
    pub(super) fn flags(&self, pipeline: Option<usize>) -> u32 {
        self.flags[pipeline.map_or(0, |index| index + 1)]
    }

    /// Locks the shadow values of buffers.
    pub(super) fn memory(&self) -> MutexGuard<'_, Memory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The word offset of the instruction that ends each block.
pub(super) fn branch_offsets(program: &Program) -> Vec<u32> {
    let mut offsets = vec![0; program.blocks.len()];
    for span in &program.instruction_spans {
        offsets[span.block.index()] = span.last;
    }
    offsets
}

/// The shadow values of scalars in buffers, by buffer and byte offset.
pub(super) type Memory = HashMap<(usize, u64), ShadowValue>;
