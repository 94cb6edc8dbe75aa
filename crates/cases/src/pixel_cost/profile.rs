//! The instructions of a launch by source line, as folded stacks.
//!
//! A stack is a line: frames from ray generation through traces and functions to the line whose
//! instructions ran, separated by semicolons, then the number of instructions, counted by lanes.
//! Each shader has a frame of its own above those of its lines. That is the format that
//! `stackcollapse` programs write and flame graphs are drawn from.

use std::collections::HashMap;
use std::fmt::Write;
use std::sync::Arc;

use crate::pixel_cost::call_tree::{Call, CallSite, CallTree};
use anyhit_base::error::Result;
use anyhit_base::escape;
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::{BlockIndex, OpIndex, ShaderIndex};
use anyhit_engine::pipeline::Pipeline;
use anyhit_engine::program::{Program, Terminator};
use anyhit_explain::names::Names;
use anyhit_scene::ResolvedScene;
use anyhit_scene::frame::SinglePass;

/// The instructions of a launch by stack.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// By stack, frames joined by semicolons: the instructions that all lanes ran there.
    pub stacks: SortedMap<String, u64>,
}

impl Profile {
    /// The profile of the calls of a scene's pass.
    ///
    /// # Errors
    /// As [`PipelineBuilder::build`](anyhit_engine::pipeline::PipelineBuilder::build).
    pub fn of_pass(scene: &ResolvedScene, single: &SinglePass<'_>, calls: &CallTree) -> Result<Self> {
        Ok(match single {
            SinglePass::Launch(single) => {
                let names = Names::new(scene, single.index, &single.pipeline);
                Self::new(calls, &single.pipeline, &names)
            }
            SinglePass::Dispatch(single) => {
                let pipeline = single.dispatch.compute.as_pipeline()?;
                let module = scene.dispatches[single.index].shader.module;
                Self::new(calls, &pipeline, &Names::of_dispatch(scene, module, &pipeline))
            }
        })
    }

    /// The profile of the calls of a launch.
    pub fn new(calls: &CallTree, pipeline: &Pipeline, names: &Names<'_>) -> Self {
        let shaders = (0..).map(ShaderIndex).zip(&pipeline.programs);
        let mut frames = Frames {
            calls,
            shaders: shaders.map(|(shader, program)| ShaderFrames::new(shader, program, names)).collect(),
            stacks: HashMap::new(),
        };
        let mut profile = Self::default();
        for ((call, block), lanes) in calls.blocks() {
            let stack = frames.stack(calls.call(call));
            let shader = &frames.shaders[calls.call(call).shader.index()];
            for (lines, instructions) in shader.lines(block) {
                *profile.stacks.entry(format!("{stack}{lines}")).or_default() += lanes * instructions;
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
    /// The stacks of calls that were asked for.
    stacks: HashMap<Call, String>,
}

impl Frames<'_> {
    /// The stack of a call: up to the frame of its shader, or to the line that calls its function.
    fn stack(&mut self, call: Call) -> String {
        if let Some(known) = self.stacks.get(&call) {
            return known.clone();
        }
        let entry = &self.shaders[call.shader.index()].entry;
        let stack = match call.caller {
            None => entry.clone(),
            Some((caller, site)) => {
                let above = self.calls.call(caller);
                let shader = match site {
                    CallSite::Op(_) => format!(";{entry}"),
                    CallSite::ReturnTo(_) => String::new(),
                };
                let line = self.shaders[above.shader.index()].site(site);
                format!("{}{line}{shader}", self.stack(above))
            }
        };
        self.stacks.insert(call, stack.clone());
        stack
    }
}

/// The frames of one shader.
struct ShaderFrames<'a> {
    program: &'a Program,
    /// The stage, and the file of the shader.
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
        // Lines are those of the source.
        let has_lines = !program.module.debug_info.files.is_empty();
        let file = file.strip_suffix(".spv").filter(|_| has_lines).unwrap_or(&file);
        Self {
            program,
            entry: frame(&format!("{} {file}", program.stage.name())),
            instructions: program.module.instructions().map(|one| one.offset).collect(),
        }
    }

    /// The frames below the shader's whose instructions a block runs, and how many of each.
    fn lines(&self, block: BlockIndex) -> SortedMap<String, u64> {
        let mut lines = SortedMap::new();
        for span in self.program.instruction_spans.iter().filter(|span| span.block == block) {
            let first = self.instructions.partition_point(|&offset| offset < span.first);
            for &offset in self.instructions[first..].iter().take_while(|&&offset| offset <= span.last) {
                *lines.entry(self.frames(span.scope, offset)).or_default() += 1;
            }
        }
        lines
    }

    /// The frames below the shader's that make a call.
    fn site(&self, site: CallSite) -> String {
        let origin = match site {
            CallSite::Op(op) => self.program.origins.get(op.index()),
            CallSite::ReturnTo(block) => {
                let calls = |terminator: &Terminator| matches!(terminator, Terminator::Call { return_to, .. } if *return_to == block);
                let at = self.program.blocks.iter().position(|block| calls(&block.terminator));
                at.and_then(|at| self.program.origins.get(OpIndex::new(self.program.ops.len() + at).index()))
            }
        };
        origin.map_or_else(String::new, |origin| self.frames(origin.scope, origin.offset))
    }

    /// The frames of an instruction below its shader's, each behind a semicolon: of the inlined
    /// calls that lead to it, then its own.
    fn frames(&self, scope: u32, offset: u32) -> String {
        let own = self.frame(scope, offset).map_or_else(String::new, |own| format!(";{own}"));
        match self.program.scopes.get(scope as usize) {
            // A function that is not inlined knows no call of its own.
            Some(inlined) if scope > 0 && inlined.call > 0 => {
                format!("{}{own}", self.frames(inlined.parent, inlined.call))
            }
            _ => own,
        }
    }

    /// The frame of an instruction: its function, unless that is the entry point, and its line;
    /// `None` where neither is known.
    fn frame(&self, scope: u32, offset: u32) -> Option<String> {
        let module = &self.program.module;
        let function = self.program.scopes.get(scope as usize).filter(|_| scope > 0);
        let function = function.map(|scope| match module.function_name(scope.function) {
            Some(name) => name.to_owned(),
            None => format!("function %{}", scope.function.0),
        });
        let debug = &module.debug_info;
        let begin = module.functions.iter().rfind(|function| function.offset <= offset);
        let line = debug.line_at(offset).or_else(|| debug.line_before(offset, begin?.offset));
        let file = line.and_then(|line| Some((debug.files.get(line.file as usize)?, line.line)));
        let line = file.map(|(file, line)| {
            let name = file.name.rsplit(['/', '\\']).next().unwrap_or(&file.name);
            format!("{name}:{line}")
        });
        let words: Vec<String> = function.into_iter().chain(line).collect();
        (!words.is_empty()).then(|| frame(&words.join(" ")))
    }
}

/// A frame's name without what the format takes for itself.
fn frame(name: &str) -> String {
    escape::line(name).replace(';', ":")
}
