//! Maps operations to source lines.

use crate::machine::{OpIndex, ShaderIndex};
use crate::module::debug_info::SourceLine;
use crate::program::Program;
use anyhit_base::error::{Place, ShaderFrame};

impl Program {
    /// The source line of an operation; `None` where the module has no debug information for it.
    #[doc(hidden)]
    pub fn place(&self, op: OpIndex) -> Option<Place> {
        self.place_at(self.origins.get(op.index())?.offset)
    }

    /// This program as a frame of a stack of shader calls: it is this shader of its pipeline,
    /// and is at an operation.
    #[doc(hidden)]
    pub fn frame(&self, shader: ShaderIndex, op: OpIndex) -> ShaderFrame {
        let word = self.origins.get(op.index()).map(|origin| origin.offset);
        let debug = &self.module.debug_info;
        let mut words = word.into_iter().chain(self.inlined_calls(op));
        let line = words.find_map(|word| debug.line_at(word).or_else(|| self.line_near(word)));
        let file = line.and_then(|line| debug.files.get(line.file as usize));
        // A line of a file that the module does not name is told nowhere.
        let line = line.filter(|_| file.is_some());
        ShaderFrame {
            shader: shader.0,
            stage: self.stage,
            entry_point: self.name.clone(),
            file: file.map(|file| file.name.clone()),
            line: line.map(|line| line.line),
            column: line.map(|line| line.column).filter(|&column| column > 0),
            word,
        }
    }

    /// The words of the inlined calls that an operation comes from, the innermost first.
    pub(crate) fn inlined_calls(&self, op: OpIndex) -> impl Iterator<Item = u32> {
        let scope_at = |scope: u32| self.scopes.get(scope as usize).filter(|_| scope != 0);
        let innermost = self.origins.get(op.index()).and_then(|origin| scope_at(origin.scope));
        std::iter::successors(innermost, move |scope| scope_at(scope.parent)).map(|scope| scope.call)
    }

    /// The source line of the instruction at a word offset of the module.
    ///
    /// A [`Place::Text`] spans the line without its indent.
    #[doc(hidden)]
    pub fn place_at(&self, offset: u32) -> Option<Place> {
        self.place_of(self.module.debug_info.line_at(offset)?)
    }

    /// For an instruction without a source line (`OpNoLine`): the last line before it in its block,
    /// else in its function.
    #[doc(hidden)]
    pub fn place_near(&self, offset: u32) -> Option<Place> {
        self.place_of(self.line_near(offset)?)
    }

    fn line_near(&self, offset: u32) -> Option<SourceLine> {
        let function = self.module.functions.iter().rfind(|function| function.offset <= offset)?;
        self.module.debug_info.line_before(offset, function.offset)
    }

    fn place_of(&self, line: SourceLine) -> Option<Place> {
        let debug = &self.module.debug_info;
        let file = debug.files.get(line.file as usize)?;
        if let Some(text) = &file.text {
            let start = text
                .split_inclusive('\n')
                .take(line.line.saturating_sub(1) as usize)
                .map(str::len)
                .sum::<usize>();
            let length = text[start..].lines().next().map_or(0, str::len);
            let indent = text[start..].len() - text[start..].trim_start_matches([' ', '\t']).len();
            let span = start + indent.min(length)..start + length;
            return Some(Place::Text { file: file.name.clone(), text: text.clone(), span });
        }
        Some(Place::Line { file: file.name.clone(), line: line.line, column: line.column })
    }
}
