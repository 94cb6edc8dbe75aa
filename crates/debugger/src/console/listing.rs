//! Source lines, instructions and frames as text.

use std::fmt::Write as _;

use anyhit_base::style::Style;

use crate::debugger::{SourceMap, SourcePosition, StackFrame};

/// How many lines a listing shows before and after the one that it is about.
const AROUND: u32 = 5;

/// How things are listed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Listing {
    colours: bool,
}

impl Listing {
    pub(super) fn new(colours: bool) -> Self {
        Self { colours }
    }

    /// A frame in a line: its function, place and shader.
    pub(super) fn frame(self, sources: &SourceMap, frame: &StackFrame) -> String {
        let place = frame.position.map_or_else(|| "?".to_owned(), |at| sources.describe(at));
        let function = Style::Strong.paint(&frame.source.function, self.colours);
        format!("{function} at {place}  {} `{}`", frame.stage.name(), frame.entry_point)
    }

    /// Where a frame is stopped, with its line.
    pub(super) fn stop(self, sources: &SourceMap, frame: &StackFrame) -> String {
        let mut text = self.frame(sources, frame) + "\n";
        if let Some(position) = frame.position {
            let line = match sources.is_disassembly(position) {
                true => Some(sources.instruction_text(frame.shader, position.line)),
                false => sources.text(position).map(str::to_owned),
            };
            if let Some(line) = line {
                let number = Style::Name.paint(&format!("{:>5}", position.line), self.colours);
                let _ = writeln!(text, "{number}  {line}");
            }
        }
        text
    }

    /// The lines around a position; the current one is marked.
    pub(super) fn around(
        self,
        sources: &SourceMap,
        position: SourcePosition,
        current: Option<SourcePosition>,
    ) -> Result<String, String> {
        let file = &sources.files()[position.file as usize];
        let source = file.text.as_deref().ok_or_else(|| {
            format!("the module does not contain the text of `{}`: compile it with -gVS, or -g", file.name)
        })?;
        let mut text = String::new();
        let first = position.line.saturating_sub(AROUND).max(1);
        for (number, line) in (1..).zip(source.lines()).skip(first as usize - 1).take(2 * AROUND as usize + 1)
        {
            let is_current = current == Some(SourcePosition { file: position.file, line: number });
            let mark = if is_current { ">" } else { " " };
            let shown = Style::Name.paint(&format!("{number:>5}"), self.colours);
            let line = if is_current { Style::Strong.paint(line, self.colours) } else { line.to_owned() };
            let _ = writeln!(text, "{}", format!("{mark}{shown}  {line}").trim_end());
        }
        Ok(text)
    }

    /// The instructions around the one that is next in a frame.
    pub(super) fn instructions(self, sources: &SourceMap, frame: &StackFrame) -> String {
        let mut text = String::new();
        let here = frame.source.origin.offset;
        for offset in sources.instructions_around(frame.shader, here, AROUND as usize) {
            let mark = if offset == here { '>' } else { ' ' };
            let _ = writeln!(text, "{mark}{offset:>6}  {}", sources.instruction_text(frame.shader, offset));
        }
        text
    }
}
