//! The instructions of a launch by source line, as folded stacks.
//!
//! A stack is a line: frames from ray generation through traces and functions to the line whose
//! instructions ran, separated by semicolons, then the number of instructions, counted by lanes.
//! That is the format that `stackcollapse` programs write and flame graphs are drawn from.

use std::collections::HashMap;
use std::fmt::Write;
use std::sync::Arc;

use crate::pixel_cost::call_tree::{Call, CallIndex, CallSite, CallTree};
use anyhit_base::escape;
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::{BlockIndex, OpIndex, ShaderIndex};
use anyhit_engine::pipeline::Pipeline;
use anyhit_engine::program::{Program, Terminator};
use anyhit_explain::names::Names;

/// The instructions of a launch by stack.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// By stack, frames joined by semicolons: the instructions that all lanes ran there.
    pub stacks: SortedMap<String, u64>,
}

impl Profile {
    /// The profile of the calls of a launch.
    pub fn new(calls: &CallTree, pipeline: &Pipeline, names: &Names<'_>) -> Self {
        let shaders = (0..).map(ShaderIndex).zip(&pipeline.programs);
        let mut frames = Frames {
            calls,
            shaders: shaders.map(|(shader, program)| ShaderFrames::new(shader, program, names)).collect(),
            callers: HashMap::new(),
        };
        let mut profile = Self::default();
        for ((call, block), lanes) in calls.blocks() {
            let caller = frames.caller(calls.call(call));
            let shader = &frames.shaders[calls.call(call).shader.index()];
            for (stack, instructions) in shader.lines(block) {
                let stack = if caller.is_empty() { stack } else { format!("{caller};{stack}") };
                *profile.stacks.entry(stack).or_default() += lanes * instructions;
            }
        }
        profile
    }

    /// All instructions.
    pub fn total(&self) -> u64 {
        self.stacks.values().sum()
    }

    /// The stacks as text, a line each, in the order of their names.
    pub fn folded(&self) -> String {
        let mut text = String::new();
        for (stack, count) in &self.stacks {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{stack} {count}");
        }
        text
    }
}

/// The frames of all shaders of a pipeline.
struct Frames<'a> {
    calls: &'a CallTree,
    shaders: Vec<ShaderFrames<'a>>,
    /// The stacks that call what was asked for, by the caller and where it calls.
    callers: HashMap<(CallIndex, CallSite), String>,
}

impl Frames<'_> {
    /// The stack that made a call; empty for ray generation.
    fn caller(&mut self, call: Call) -> String {
        let Some((caller, site)) = call.caller else { return String::new() };
        if let Some(known) = self.callers.get(&(caller, site)) {
            return known.clone();
        }
        let above = self.calls.call(caller);
        let own = self.shaders[above.shader.index()].site(site);
        let outer = self.caller(above);
        let stack = if outer.is_empty() { own } else { format!("{outer};{own}") };
        self.callers.insert((caller, site), stack.clone());
        stack
    }
}

/// The frames of one shader.
struct ShaderFrames<'a> {
    program: &'a Program,
    /// The stage, and where there are no lines the file of the module.
    entry: String,
    /// Word offsets of the module's instructions, ascending.
    instructions: Vec<u32>,
}

impl<'a> ShaderFrames<'a> {
    fn new(shader: ShaderIndex, program: &'a Arc<Program>, names: &Names<'_>) -> Self {
        let label = names.shader(shader);
        let file = match (label.file, label.name) {
            (Some(file), _) => file,
            (None, Some(name)) => name,
            (None, None) => label.entry,
        };
        Self {
            program,
            entry: frame(&format!("{} {file}", program.stage.name())),
            instructions: program.module.instructions().map(|one| one.offset).collect(),
        }
    }

    /// The stacks within the shader whose instructions a block runs, and how many of each.
    fn lines(&self, block: BlockIndex) -> SortedMap<String, u64> {
        let mut lines = SortedMap::new();
        for span in self.program.instruction_spans.iter().filter(|span| span.block == block) {
            let first = self.instructions.partition_point(|&offset| offset < span.first);
            for &offset in self.instructions[first..].iter().take_while(|&&offset| offset <= span.last) {
                *lines.entry(self.stack(span.scope, offset)).or_default() += 1;
            }
        }
        lines
    }

    /// The stack within the shader that makes a call.
    fn site(&self, site: CallSite) -> String {
        let origin = match site {
            CallSite::Op(op) => self.program.origins.get(op.index()),
            CallSite::ReturnTo(block) => {
                let calls = |terminator: &Terminator| matches!(terminator, Terminator::Call { return_to, .. } if *return_to == block);
                let at = self.program.blocks.iter().position(|block| calls(&block.terminator));
                at.and_then(|at| self.program.origins.get(OpIndex::new(self.program.ops.len() + at).index()))
            }
        };
        origin.map_or_else(|| self.entry.clone(), |origin| self.stack(origin.scope, origin.offset))
    }

    /// The frames of an instruction: of the inlined calls that lead to it, then its own.
    fn stack(&self, scope: u32, offset: u32) -> String {
        let own = self.frame(scope, offset);
        match self.program.scopes.get(scope as usize) {
            // A function that is not inlined knows no call of its own.
            Some(inlined) if scope > 0 && inlined.call > 0 => {
                format!("{};{own}", self.stack(inlined.parent, inlined.call))
            }
            _ => own,
        }
    }

    /// The frame of an instruction: its stage or function, and its line.
    fn frame(&self, scope: u32, offset: u32) -> String {
        let module = &self.program.module;
        let function = self.program.scopes.get(scope as usize).filter(|_| scope > 0);
        let what = match function.map(|scope| scope.function) {
            Some(id) => module.function_name(id).map_or_else(|| format!("function %{}", id.0), str::to_owned),
            None => self.program.stage.name().to_owned(),
        };
        let debug = &module.debug_info;
        let begin = module.functions.iter().rfind(|function| function.offset <= offset);
        let line = debug.line_at(offset).or_else(|| debug.line_before(offset, begin?.offset));
        let file = line.and_then(|line| Some((debug.files.get(line.file as usize)?, line.line)));
        match file {
            Some((file, line)) => {
                let name = file.name.rsplit(['/', '\\']).next().unwrap_or(&file.name);
                frame(&format!("{what} {name}:{line}"))
            }
            None if scope > 0 => frame(&what),
            None => self.entry.clone(),
        }
    }
}

/// A frame's name without what the format takes for itself.
fn frame(name: &str) -> String {
    escape::line(name).replace(';', ":")
}
