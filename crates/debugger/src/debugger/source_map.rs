//! Where in the sources each operation of a pipeline's shaders is.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use anyhit_base::sorted::sort;
use anyhit_engine::machine::{BlockIndex, OpIndex, ShaderIndex};
use anyhit_engine::module::{Function, Id, Opcode};
use anyhit_engine::program::{Program, Terminator};

use super::prologue::body_offset;
use super::source_frames::SourceFrame;
use super::unwritten::VariableWrites;

/// A line of a source, by its number in [`SourceMap::line`]; 0 where an operation has none.
pub(super) type LineIndex = u32;

/// Where an operation is: its line, and the inlined call that it belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Site {
    /// The line; none before the first statement of a function.
    pub line: LineIndex,
    /// The inlined call, an index into [`Program::scopes`].
    pub scope: u32,
}

/// The sites of one shader.
#[derive(Debug)]
pub struct ShaderSites {
    /// The shader.
    pub program: Arc<Program>,
    /// By operation, then by block for its terminator.
    sites: Vec<Site>,
    /// By inlined call: in how many others it is.
    depths: Vec<u32>,
    /// By file of the module: its index in [`SourceMap::files`].
    files: Vec<u32>,
    /// Where its variables are written.
    pub(super) writes: VariableWrites,
    /// Whether its lines are instructions, as its module has no debug information.
    pub is_disassembled: bool,
}

/// A line of a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SourcePosition {
    /// An index into [`SourceMap::files`].
    pub file: u32,
    /// The line, from 1.
    pub line: u32,
}

/// A source file that debug information names, or the disassembly of a module without any.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceText {
    /// The file's name as the compiler wrote it.
    pub name: String,
    /// Its text, where a module holds it.
    pub text: Option<Arc<str>>,
}

/// The sources of a pipeline's shaders.
#[derive(Debug, Default)]
pub struct SourceMap {
    files: Vec<SourceText>,
    lines: Vec<SourcePosition>,
    shaders: Vec<ShaderSites>,
}

impl SourceMap {
    /// The sources of shaders, in the order of a pipeline.
    pub fn new(programs: &[Arc<Program>]) -> Self {
        let mut builder = Builder::default();
        programs.iter().for_each(|program| builder.add(program));
        builder.map
    }

    /// The sites of a shader.
    pub fn shader(&self, shader: ShaderIndex) -> &ShaderSites {
        &self.shaders[shader.index()]
    }

    /// The shaders, in the order of the pipeline.
    pub fn shaders(&self) -> &[ShaderSites] {
        &self.shaders
    }

    /// Gives files that no module holds the text of one; `read` finds it by the file's name.
    pub fn supply_texts(&mut self, read: &mut dyn FnMut(&str) -> Option<String>) {
        for file in self.files.iter_mut().filter(|file| file.text.is_none()) {
            file.text = read(&file.name).map(Arc::from);
        }
    }

    /// The files.
    pub fn files(&self) -> &[SourceText] {
        &self.files
    }

    /// The position of a line; `None` for 0.
    pub fn line(&self, line: LineIndex) -> Option<SourcePosition> {
        self.lines.get((line as usize).checked_sub(1)?).copied()
    }

    /// The lines of files that a path means, each with its index: a file's whole name, or its last
    /// components.
    pub fn lines_of<'a>(&'a self, path: &'a str) -> impl Iterator<Item = (LineIndex, SourcePosition)> + 'a {
        let is_meant = move |file: u32| names_file(&self.files[file as usize].name, path);
        (1..).zip(self.lines.iter().copied()).filter(move |(_, position)| is_meant(position.file))
    }

    /// The file that a path means, if one does.
    pub fn file(&self, path: &str) -> Option<u32> {
        let at = self.files.iter().position(|file| names_file(&file.name, path))?;
        Some(at as u32)
    }

    /// A position as `file:line`.
    pub fn describe(&self, position: SourcePosition) -> String {
        format!("{}:{}", self.files[position.file as usize].name, position.line)
    }

    /// Whether a position is an instruction of a module without debug information.
    pub fn is_disassembly(&self, position: SourcePosition) -> bool {
        let mut own = self.shaders.iter().filter(|sites| sites.is_disassembled);
        own.any(|sites| sites.files.contains(&position.file))
    }

    /// The names of all functions, without repetition.
    pub fn function_names(&self) -> Vec<String> {
        let of = |sites: &ShaderSites| -> Vec<String> {
            (0..sites.program.scopes.len() as u32).map(|scope| sites.function_name(scope)).collect()
        };
        let mut names: Vec<String> = self.shaders.iter().flat_map(of).collect();
        sort(&mut names);
        names.dedup();
        names
    }

    /// An instruction in words, given by its offset in words from the start of the module.
    pub fn instruction_text(&self, shader: ShaderIndex, offset: u32) -> String {
        self.shader(shader).program.module.describe_instruction(offset)
    }

    /// The offsets of instructions around one of them: as many before and after it.
    pub fn instructions_around(&self, shader: ShaderIndex, offset: u32, around: usize) -> Vec<u32> {
        let module = &self.shader(shader).program.module;
        let instructions = module.function_at(offset).into_iter().flat_map(Function::instructions);
        let all: Vec<u32> = instructions.map(|instruction| instruction.offset).collect();
        let at = all.iter().position(|&one| one == offset).unwrap_or(0);
        let range = at.saturating_sub(around)..(at + around + 1).min(all.len());
        all[range].to_vec()
    }

    /// The text of a line without its indent, where a module holds it.
    pub fn text(&self, position: SourcePosition) -> Option<&str> {
        let text = self.files.get(position.file as usize)?.text.as_deref()?;
        text.lines().nth(position.line.checked_sub(1)? as usize).map(str::trim)
    }
}

/// By inlined call: the offset at which the body of its function begins.
fn bodies(program: &Program) -> Vec<u32> {
    let mut known: FxHashMap<Id, u32> = FxHashMap::default();
    let body =
        |id: Id| program.module.function(id).map_or(0, |function| body_offset(&program.module, function));
    let scopes = program.scopes.iter();
    scopes.map(|scope| *known.entry(scope.function).or_insert_with(|| body(scope.function))).collect()
}

/// Whether a path means a file: it is its name, or the last components of it.
pub(super) fn names_file(name: &str, path: &str) -> bool {
    let normal = |path: &str| path.replace('\\', "/");
    let (name, path) = (normal(name), normal(path));
    let path = path.strip_prefix("./").unwrap_or(&path);
    let ends = |long: &str, short: &str| {
        long.strip_suffix(short).is_some_and(|rest| rest.is_empty() || rest.ends_with('/'))
    };
    !path.is_empty() && (ends(&name, path) || ends(path, &name))
}

impl ShaderSites {
    /// The site of an operation or terminator.
    pub fn site(&self, op: OpIndex) -> Site {
        self.sites.get(op.index()).copied().unwrap_or_default()
    }

    /// In how many inlined calls an inlined call is.
    pub fn depth(&self, scope: u32) -> u32 {
        self.depths[scope as usize]
    }

    /// The function of an inlined call.
    pub fn function(&self, scope: u32) -> Id {
        self.program.scopes[scope as usize].function
    }

    /// The name of the function of an inlined call, as its source has it.
    pub fn function_name(&self, scope: u32) -> String {
        let id = self.function(scope);
        let debug = &self.program.module.debug_info;
        let name = debug.function_names.get(&id).map(|name| &**name).filter(|name| !name.is_empty());
        let name = name.or_else(|| self.program.module.name(id));
        name.map_or_else(|| format!("%{}", id.0), str::to_owned)
    }

    /// The terminator of the block that calls a function and goes on in a block.
    pub fn call_before(&self, return_to: BlockIndex) -> Option<OpIndex> {
        let calls = |terminator: &Terminator| matches!(terminator, Terminator::Call { return_to: to, .. } if *to == return_to);
        let block = self.program.blocks.iter().position(|block| calls(&block.terminator))?;
        Some(self.program.terminator_index(BlockIndex::new(block)))
    }

    /// The line at which a function begins, inlined in a call: that of its first operation that has
    /// one.
    pub fn first_line(&self, scope: u32) -> LineIndex {
        let is_in = |site: &&Site| site.scope == scope && site.line != 0;
        self.sites.iter().find(is_in).map_or(0, |site| site.line)
    }

    /// The opcode of the instruction of an operation.
    pub fn opcode(&self, op: OpIndex) -> Opcode {
        let word = self.program.module.words.get(self.offset(op) as usize);
        word.map_or(Opcode::Nop, |&word| Opcode::of_word(word))
    }

    /// The position of an instruction, given by its offset in words from the start of the module.
    pub fn position(&self, offset: u32) -> Option<SourcePosition> {
        if self.is_disassembled {
            return Some(SourcePosition { file: *self.files.first()?, line: offset });
        }
        let line = self.program.module.debug_info.line_at(offset)?;
        Some(SourcePosition { file: *self.files.get(line.file as usize)?, line: line.line })
    }

    /// The position of a function of the source that is stopped.
    pub fn position_of(&self, frame: &SourceFrame) -> Option<SourcePosition> {
        if self.is_disassembled {
            return self.position(frame.origin.offset);
        }
        let line = frame.line?;
        Some(SourcePosition { file: *self.files.get(line.file as usize)?, line: line.line })
    }

    /// The instruction of an operation, in words from the start of its module.
    pub fn offset(&self, op: OpIndex) -> u32 {
        self.program.origins.get(op.index()).map_or(0, |origin| origin.offset)
    }
}

/// A source map that grows shader by shader.
#[derive(Default)]
struct Builder {
    map: SourceMap,
    files: FxHashMap<String, u32>,
    lines: FxHashMap<SourcePosition, LineIndex>,
}

impl Builder {
    fn add(&mut self, program: &Arc<Program>) {
        let debug = &program.module.debug_info;
        let is_disassembled = debug.lines.iter().all(|(_, line)| line.is_none());
        let files: Vec<u32> = match is_disassembled {
            true => vec![self.disassembly(program)],
            false => debug.files.iter().map(|file| self.file(&file.name, file.text.as_ref())).collect(),
        };
        let mut sites = ShaderSites {
            program: program.clone(),
            sites: Vec::with_capacity(program.origins.len()),
            depths: Vec::with_capacity(program.scopes.len()),
            files,
            writes: VariableWrites::new(program),
            is_disassembled,
        };
        let bodies: Vec<u32> = match is_disassembled {
            // Each instruction is a line.
            true => vec![0; program.scopes.len()],
            false => bodies(program),
        };
        for origin in &program.origins {
            let is_statement = bodies.get(origin.scope as usize).is_some_and(|&body| origin.offset >= body);
            let position = sites.position(origin.offset).filter(|at| is_statement && at.line > 0);
            let line = position.map_or(0, |position| self.line(position));
            sites.sites.push(Site { line, scope: origin.scope });
        }
        for (at, scope) in program.scopes.iter().enumerate() {
            // A function that is called, not inlined, has a frame of its own.
            let is_root = at == 0 || scope.call == 0;
            let depth = if is_root { 0 } else { sites.depths[scope.parent as usize] + 1 };
            sites.depths.push(depth);
        }
        self.map.shaders.push(sites);
    }

    fn file(&mut self, name: &str, text: Option<&Arc<str>>) -> u32 {
        let files = &mut self.map.files;
        let index = *self.files.entry(name.to_owned()).or_insert_with(|| {
            files.push(SourceText { name: name.to_owned(), text: None });
            files.len() as u32 - 1
        });
        let file = &mut files[index as usize];
        file.text = file.text.take().or_else(|| text.cloned());
        index
    }

    /// A file of its own for a shader whose module tells of none.
    fn disassembly(&mut self, program: &Program) -> u32 {
        let name = |number: usize| {
            let number = if number > 1 { format!(" {number}") } else { String::new() };
            format!("{} {}{number}.spvasm", program.name, program.stage.name())
        };
        let is_new = |name: &String| !self.files.contains_key(name);
        let name = (1..).map(name).find(is_new).unwrap_or_default();
        self.file(&name, None)
    }

    fn line(&mut self, position: SourcePosition) -> LineIndex {
        let lines = &mut self.map.lines;
        *self.lines.entry(position).or_insert_with(|| {
            lines.push(position);
            lines.len() as LineIndex
        })
    }
}

#[cfg(test)]
mod tests {
    use super::names_file;

    #[test]
    fn a_path_means_files_by_whole_components() {
        assert!(names_file("shaders/glass/main.rgen", "main.rgen"));
        assert!(names_file("shaders/glass/main.rgen", "./glass/main.rgen"));
        assert!(names_file("main.rgen", "/home/me/glass/main.rgen"));
        assert!(names_file("glass\\main.rgen", "glass/main.rgen"));
        assert!(!names_file("shaders/other-main.rgen", "main.rgen"));
        assert!(!names_file("shaders/main.rgen", ""));
    }
}
