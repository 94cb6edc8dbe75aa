//! What is known of an invocation's course, and the moment of a step.

use anyhit_engine::machine::{BlockIndex, OpIndex, Reg, ShaderIndex};
use anyhit_engine::pipeline::Event;

use super::source_map::{LineIndex, ShaderSites, Site};
use super::unwritten::UnwrittenRegisters;

/// How many steps the invocation has made: operations and terminators of its shaders, the
/// pipeline's own work not counted. Step 0 is the first operation of all.
pub type Time = u64;

/// The host as a caller, with the payload of its ray: no shader's run has this number.
pub(super) const HOST: u64 = u64::MAX;

/// A shader that has begun and not ended.
#[derive(Clone, Debug)]
pub(super) struct ActiveShader {
    pub(super) shader: ShaderIndex,
    /// How many shaders had begun before it.
    pub(super) run: u64,
    /// The depth of its entry point among all function calls.
    pub(super) base: u32,
    /// The first register of the payload or callable data of its last call.
    pub(super) passes: Option<Reg>,
    pub(super) last_block: Option<BlockIndex>,
    pub(super) last_calls: usize,
    /// Its variables that have not been written yet.
    pub(super) unwritten: UnwrittenRegisters,
}

/// The line that a function call is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameLine {
    pub(super) scope: u32,
    pub(super) line: LineIndex,
    /// Whether its first line has begun.
    pub(super) has_begun: bool,
}

/// What is known of the invocation's course so far: a part of every checkpoint.
#[derive(Clone, Debug, Default)]
pub(super) struct Course {
    /// The steps made.
    pub time: Time,
    pub(super) active: Vec<ActiveShader>,
    /// How many shaders have begun.
    pub(super) begun: u64,
    pub(super) frames: Vec<FrameLine>,
    pub(super) last: Option<(ShaderIndex, Site)>,
    /// The operation or terminator that was next last.
    pub(super) last_op: Option<(ShaderIndex, OpIndex)>,
    /// What the pipeline did since the step before.
    pub events: Vec<Event>,
    /// The last pause came before the step that is next.
    pub paused: bool,
}

impl Course {
    /// The depth of the function that runs: how many calls it is in, of functions and of shaders.
    pub(super) fn depth(&self) -> u32 {
        (self.frames.len() as u32).saturating_sub(1)
    }

    /// The run of a shader that has begun and not ended, by its number from the outermost.
    pub(super) fn run(&self, number: usize) -> Option<u64> {
        Some(self.active.get(number)?.run)
    }

    /// The run of the shader that called one of them, and the first register of what it gave. What
    /// nobody called, the host has.
    pub(super) fn caller(&self, number: usize) -> Option<(u64, Reg)> {
        if number == 0 {
            return Some((HOST, Reg(0)));
        }
        let caller = self.active.get(number.checked_sub(1)?)?;
        Some((caller.run, caller.passes?))
    }
}

/// A moment at which the invocation is about to make a step.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// The steps made before.
    pub time: Time,
    /// The shader.
    pub shader: ShaderIndex,
    /// Its sites.
    pub sites: &'a ShaderSites,
    /// The operation or terminator.
    pub op: OpIndex,
    /// Its site.
    pub site: Site,
    /// How many calls of functions and shaders it is in.
    pub depth: u32,
    /// Whether a line begins here.
    pub begins_line: bool,
    /// Whether a function begins here: its first line.
    pub begins_function: bool,
    /// Whether an instruction begins here: an instruction may be several operations.
    pub begins_instruction: bool,
}
