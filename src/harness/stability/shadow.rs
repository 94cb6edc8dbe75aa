//! The f64 shadow: every float operation is executed a second time in f64.
//!
//! Each register that holds a float has a shadow value, the one that f64 arithmetic would have
//! computed. It follows the value through variables, calls, payloads, callable data, hit attributes
//! and buffers. Values from elsewhere (constants, builtins, textures, results of ray queries and
//! atomic instructions) are their own shadows. The shadow does not change the run: if a comparison
//! of shadow values has a different result, it is counted, and control flow follows the run.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::debug::session::ResolvedRequest;
use crate::error::{Error, Result};
use crate::harness::run::fresh_resources;
use crate::harness::stability::found::ShadowFindings;
use crate::harness::stability::place::Programs;
use crate::harness::stability::probe;
use crate::harness::stability::shadow_interpreter::{Memory, ShadowInterpreter};
use crate::ops::op::Op;
use crate::ops::shadow_op::{ShadowOp, shadow_op};
use crate::program::Program;
use crate::scene::{Assembled, ResolvedScene};

/// Runs a scene's passes on a copy of its resources, with shadows. Returns
/// the findings, and the trap that ended the run, if there is one.
///
/// # Errors
/// `UnsupportedModule` where invocations cannot run one by one.
pub fn shadow(scene: &ResolvedScene, assembled: &Assembled) -> Result<(ShadowFindings, Option<Error>)> {
    let context = ShadowContext::new(scene, assembled);
    let resources = fresh_resources(&assembled.resources);
    let mut sum = ShadowFindings::default();
    let outcome = probe::run(
        assembled,
        &resources,
        &|| ShadowInterpreter::new(&context),
        &mut |interpreter: ShadowInterpreter<'_>| {
            sum.add(&interpreter.findings());
            context.memory().extend(interpreter.memory);
        },
    );
    trap_of(outcome).map(|trap| (sum, trap))
}

/// Runs one ray or one invocation of ray generation with f64 shadows.
///
/// # Errors
/// As [`shadow`], and where the ray does not fit the scene.
pub fn shadow_one(
    scene: &ResolvedScene,
    assembled: &Assembled,
    which: &ResolvedRequest,
) -> Result<(ShadowFindings, Option<Error>)> {
    let context = ShadowContext::new(scene, assembled);
    let resources = fresh_resources(&assembled.resources);
    let interpreter = ShadowInterpreter::new(&context);
    let (interpreter, outcome) =
        probe::run_one(scene, assembled, &resources, which, interpreter, &mut |_| ())?;
    trap_of(outcome).map(|trap| (interpreter.findings(), trap))
}

/// The trap of a run, which is a finding; any other error is returned as an error.
fn trap_of(outcome: Result<()>) -> Result<Option<Error>> {
    match outcome {
        Ok(()) => Ok(None),
        Err(error) if error.kind() == crate::error::ErrorKind::Trap => Ok(Some(error)),
        Err(error) => Err(error),
    }
}

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
    fn new(scene: &ResolvedScene, assembled: &Assembled) -> Self {
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
    pub fn flags(&self, pipeline: Option<usize>) -> u32 {
        self.flags[pipeline.map_or(0, |index| index + 1)]
    }

    /// Locks the shadow values of buffers.
    pub fn memory(&self) -> MutexGuard<'_, Memory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The word offset of the instruction that ends each block.
pub(super) fn branch_offsets(program: &Program) -> Vec<u32> {
    let mut offsets = vec![0; program.blocks.len()];
    for span in &program.instruction_spans {
        offsets[span.block as usize] = span.last;
    }
    offsets
}
