//! The f64 shadow: every float operation once more in f64, beside the run.
//!
//! Beside each register that holds a float stands the value that f64 arithmetic would have led to;
//! it goes with the value through variables, calls, payloads, callable data, hit attributes and
//! buffers. What comes from elsewhere (constants, builtins, textures, what a ray query says of a
//! hit, what an atomic gives) stands beside itself. The run itself stays as it is: where a
//! comparison of shadows falls out otherwise, that is counted, and both go on along the way of the
//! run.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::debug::session::ResolvedRequest;
use crate::error::{Error, Result};
use crate::harness::run::fresh;
use crate::harness::stability::found::Shadow;
use crate::harness::stability::place::Programs;
use crate::harness::stability::probe;
use crate::harness::stability::shadow_interpreter::{Memory, ShadowInterpreter};
use crate::ops::op::Op;
use crate::ops::shadow_op::{ShadowOp, shadow_op};
use crate::program::Program;
use crate::scene::{Assembled, ResolvedScene};

/// Runs a scene's launch and dispatches on a copy of its resources, with shadows. Beside the
/// findings stands the trap that ended the run, if there is one.
///
/// # Errors
/// `UnsupportedModule` where invocations cannot run one by one.
pub fn shadow(scene: &ResolvedScene, assembled: &Assembled) -> Result<(Shadow, Option<Error>)> {
    let plan = Plan::new(scene, assembled);
    let resources = fresh(&assembled.resources);
    let mut sum = Shadow::default();
    let outcome = probe::run(
        assembled,
        &resources,
        &|_| ShadowInterpreter::new(&plan),
        &mut |interpreter: ShadowInterpreter<'_>| {
            sum.add(&interpreter.shadow());
            plan.memory().extend(interpreter.memory);
        },
    );
    trapped(outcome).map(|trap| (sum, trap))
}

/// Runs one ray or one invocation of ray generation with f64 shadows.
///
/// # Errors
/// As [`shadow`], and where the ray does not fit the scene.
pub fn shadow_one(
    scene: &ResolvedScene,
    assembled: &Assembled,
    which: &ResolvedRequest,
) -> Result<(Shadow, Option<Error>)> {
    let plan = Plan::new(scene, assembled);
    let resources = fresh(&assembled.resources);
    let interpreter = ShadowInterpreter::new(&plan);
    let (interpreter, outcome) = probe::one(scene, assembled, &resources, which, interpreter, &mut |_| ())?;
    trapped(outcome).map(|trap| (interpreter.shadow(), trap))
}

/// A trap is a finding; any other error is one.
fn trapped(outcome: Result<()>) -> Result<Option<Error>> {
    match outcome {
        Ok(()) => Ok(None),
        Err(error) if error.kind() == crate::error::ErrorKind::Trap => Ok(Some(error)),
        Err(error) => Err(error),
    }
}

/// What is known of the programs before anything runs.
pub(super) struct Plan {
    pub programs: Programs,
    /// By shader and operation.
    pub shadow_ops: Vec<Vec<ShadowOp>>,
    /// By shader and block: the word offset of the branch.
    pub branches: Vec<Vec<u32>>,
    /// What the pipeline adds to every ray's flags.
    pub flags: u32,
    /// What the launch left in buffers, for dispatches after it.
    memory: Mutex<Memory>,
}

impl Plan {
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
        let flags = assembled.pipeline.flags.ray_flags();
        Self { programs, shadow_ops, branches, flags, memory: Mutex::default() }
    }

    /// Locks the memory.
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
