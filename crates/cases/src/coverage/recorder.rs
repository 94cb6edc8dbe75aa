//! Derives the coverage of source lines from the blocks and branches that ran.

use std::path::Path;
use std::sync::Arc;

use crate::coverage::{Coverage, Edge, RayCounts};
use crate::source_tree::SourceTree;
use anyhit_base::escape;
use anyhit_base::sorted::{SortedMap, SortedSet};
use anyhit_engine::machine::{BlockIndex, ShaderIndex};
use anyhit_engine::module::debug_info::SourceLine;
use anyhit_engine::module::{Module, Opcode};
use anyhit_engine::pipeline::Event;
use anyhit_engine::program::{Program, Terminator};
use anyhit_explain::names::Names;
use anyhit_scene::{Assembled, ResolvedScene};
use anyhit_unit_test::block_counts::{BlockCounts, ProgramCounts};

/// Collects what the shaders of one scene run.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    /// By pipeline: `[pipeline]`, then the named ones.
    pipelines: Vec<(BlockCounts, RayCounts)>,
    /// By dispatch; its shader is number 0.
    dispatches: Vec<BlockCounts>,
    /// Of dispatches, which have ray queries alone.
    rays: RayCounts,
}

/// Takes the events for a [`Recorder`].
#[derive(Debug)]
pub struct RayEventSink<'a>(&'a mut RayCounts);

impl RayEventSink<'_> {
    /// Counts an event.
    pub fn event(&mut self, event: &Event) {
        self.0.event(event);
    }
}

impl Recorder {
    /// The parts that events and the interpreter are handed to, of the named pipeline with an index
    /// or of `[pipeline]`.
    pub fn parts(&mut self, pipeline: Option<usize>) -> (RayEventSink<'_>, &mut BlockCounts) {
        let at = pipeline.map_or(0, |index| index + 1);
        if self.pipelines.len() <= at {
            self.pipelines.resize_with(at + 1, Default::default);
        }
        let (counts, rays) = &mut self.pipelines[at];
        (RayEventSink(rays), counts)
    }

    /// The recorder of a scene's dispatch, by its index.
    pub fn dispatch(&mut self, at: usize) -> (RayEventSink<'_>, &mut BlockCounts) {
        if self.dispatches.len() <= at {
            self.dispatches.resize(at + 1, BlockCounts::default());
        }
        (RayEventSink(&mut self.rays), &mut self.dispatches[at])
    }

    /// What was covered of a scene, whose shaders everything was recorded of.
    pub fn coverage(mut self, scene: &ResolvedScene, assembled: &Assembled) -> Coverage {
        let pipelines = assembled.all_pipelines().count();
        self.pipelines.resize_with(pipelines, Default::default);
        let mut lines =
            Lines { coverage: Coverage { rays: self.rays, ..Coverage::default() }, modules: Vec::new() };
        for ((index, pipeline), (counts, mut rays)) in assembled.all_pipelines().zip(self.pipelines) {
            rays.name(scene, index, pipeline);
            lines.coverage.rays.add(rays);
            let names = Names::new(scene, index, pipeline);
            for (shader, program) in (0..).map(ShaderIndex).zip(&pipeline.programs) {
                let path = names.module(shader).map_or(&*scene.path, |module| module.path);
                lines.program(program, &counts.ran(shader), path);
            }
        }
        lines.coverage.rays.name_surfaces(scene);
        let nothing = BlockCounts::default();
        for (at, (dispatch, entry)) in assembled.dispatches.iter().zip(&scene.dispatches).enumerate() {
            let path = scene.shaders.get(entry.shader.module).map_or(&scene.path, |module| &module.path);
            let counts = self.dispatches.get(at).unwrap_or(&nothing);
            lines.program(&dispatch.compute.program, &counts.ran(ShaderIndex(0)), path);
        }
        lines.coverage
    }
}

impl Coverage {
    /// Returns the coverage of runs of one shader; `path` is the path of its module or source.
    pub fn of_program(program: &Program, counts: &BlockCounts, path: &Path) -> Self {
        let mut lines = Lines { coverage: Self::default(), modules: Vec::new() };
        lines.program(program, &counts.ran(ShaderIndex(0)), path);
        lines.coverage
    }
}

/// From blocks and edges of programs to lines, branches and functions of sources.
struct Lines {
    coverage: Coverage,
    /// Modules that have been listed.
    modules: Vec<Listed>,
}

/// A module's instructions.
struct Listed {
    module: Arc<Module>,
    /// Word offsets and opcodes, ascending.
    instructions: Arc<Vec<(u32, Opcode)>>,
}

/// Instructions that compute nothing.
const SILENT: [Opcode; 6] = [
    Opcode::Variable,
    Opcode::Phi,
    Opcode::LoopMerge,
    Opcode::SelectionMerge,
    Opcode::Branch,
    Opcode::Unreachable,
];

impl Lines {
    /// Adds a program, whose module lies at a path.
    fn program(&mut self, program: &Program, ran: &ProgramCounts<'_>, path: &Path) {
        let debug = &program.module.debug_info;
        if debug.lines.iter().all(|(_, line)| line.is_none()) {
            self.coverage.without_lines.insert(escape::path(&path).to_string());
            return;
        }
        let tree = SourceTree::of_current_folder();
        let names: Vec<String> =
            debug.files.iter().map(|file| tree.path_of(&file.name, Some(path))).collect();
        let instructions = self.instructions(&program.module);
        // A line runs as often as the busiest of its blocks, in each inlined copy by itself.
        let mut lines: SortedMap<(u32, u32, u32), u64> = SortedMap::new();
        let mut entered: SortedSet<u32> = SortedSet::new();
        for span in &program.instruction_spans {
            let count = ran.block(span.block);
            let first = instructions.partition_point(|(offset, _)| *offset < span.first);
            let all = instructions[first..].iter().take_while(|(offset, _)| *offset <= span.last);
            for (offset, _) in all.filter(|(_, opcode)| !SILENT.contains(opcode)) {
                let Some(SourceLine { file, line, .. }) = debug.line_at(*offset) else { continue };
                let known = lines.entry((span.scope, file, line)).or_default();
                *known = count.max(*known);
                if entered.insert(span.scope) {
                    let function = program.scopes.get(span.scope as usize).map(|scope| scope.function);
                    let name = function.and_then(|id| program.module.function_name(id)).map(str::to_owned);
                    if let (Some(name), Some(file)) = (name, names.get(file as usize)) {
                        let file = self.coverage.files.entry(file.clone()).or_default();
                        *file.functions.entry((line, name)).or_default() += count;
                    }
                }
            }
        }
        for ((_, file, line), count) in lines {
            let Some(name) = names.get(file as usize) else { continue };
            *self.coverage.files.entry(name.clone()).or_default().lines.entry(line).or_default() += count;
        }
        self.branches(program, ran, &names);
    }

    fn branches(&mut self, program: &Program, ran: &ProgramCounts<'_>, names: &[String]) {
        // The last instruction of a block is its branch.
        let last: SortedMap<BlockIndex, u32> =
            program.instruction_spans.iter().map(|span| (span.block, span.last)).collect();
        // By that instruction: inlined copies are one branch of the source.
        let mut branches: SortedMap<u32, (u64, Vec<u64>)> = SortedMap::new();
        for (block, offset) in last {
            let ways = match program.blocks.get(block.index()).map(|block| &block.terminator) {
                Some(Terminator::BranchConditional { then, other, .. }) if then != other => 2,
                Some(Terminator::Switch { cases, .. }) => cases.len() + 1,
                _ => continue,
            };
            let (count, taken) = branches.entry(offset).or_insert((0, vec![0; ways]));
            *count += ran.block(block);
            for (way, taken) in taken.iter_mut().enumerate() {
                *taken += ran.edge(block, way);
            }
        }
        let mut ordinals: SortedMap<(u32, u32), u32> = SortedMap::new();
        for (offset, (count, taken)) in branches {
            let Some(SourceLine { file, line, .. }) = program.module.debug_info.line_at(offset) else {
                continue;
            };
            let Some(name) = names.get(file as usize) else { continue };
            let ordinal = ordinals.entry((file, line)).or_default();
            let branch = *ordinal;
            *ordinal += 1;
            let file = self.coverage.files.entry(name.clone()).or_default();
            for (way, taken) in taken.into_iter().enumerate() {
                let sum = file.branches.entry(Edge { line, branch, way: way as u32 }).or_default();
                if count > 0 {
                    *sum = Some(sum.unwrap_or(0) + taken);
                }
            }
        }
    }

    fn instructions(&mut self, module: &Arc<Module>) -> Arc<Vec<(u32, Opcode)>> {
        if let Some(known) = self.modules.iter().find(|known| Arc::ptr_eq(&known.module, module)) {
            return known.instructions.clone();
        }
        let all = module.instructions().map(|one| (one.offset, one.opcode));
        let instructions: Arc<Vec<_>> = Arc::new(all.collect());
        self.modules.push(Listed { module: module.clone(), instructions: instructions.clone() });
        instructions
    }
}
