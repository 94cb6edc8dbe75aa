//! Puts right in which file the lines of a function are, where glslang tells the wrong one.
//!
//! After an `#include` glslang takes the body of `main`, with `-gVS` its head, too, to be in the
//! file that was included last: the lines are right, the file is not. A function's head is never in
//! another file than the whole of its body, and a text tells which file has it.

use std::ops::Range;

use crate::module::Function;
use crate::module::debug_info::DebugInfo;

/// The tools, as the header of a module numbers them, that are or hold glslang: itself and shaderc.
const GLSLANG: [u32; 2] = [8, 13];

/// Puts the files of lines right in a module of a generator.
pub(super) fn repair(debug: &mut DebugInfo, functions: &[Function], generator: u32) {
    if debug.files.len() < 2 || !GLSLANG.contains(&(generator >> 16)) {
        return;
    }
    for (at, function) in functions.iter().enumerate() {
        let head = debug.line_at(function.offset);
        let end = functions.get(at + 1).map_or(u32::MAX, |next| next.offset);
        let body = entries(debug, function.offset + 1..end);
        let mut lines = debug.lines[body.clone()].iter().filter_map(|(_, line)| *line);
        let Some(first) = lines.next() else { continue };
        if lines.any(|line| line.file != first.file) {
            continue;
        }
        let own = match head {
            Some(head) => Some(head.file),
            None => file_of_main(debug, first.file, first.line),
        };
        let Some(own) = own.filter(|&own| own != first.file) else { continue };
        for (_, line) in &mut debug.lines[body] {
            if let Some(line) = line {
                line.file = own;
            }
        }
    }
}

/// The entries of the table of lines for a range of instructions.
fn entries(debug: &DebugInfo, offsets: Range<u32>) -> Range<usize> {
    let before = |offset: u32| debug.lines.partition_point(|&(start, _)| start < offset);
    before(offsets.start)..before(offsets.end)
}

/// The one file that has `main` on a line, where the file that is named does not.
fn file_of_main(debug: &DebugInfo, named: u32, line: u32) -> Option<u32> {
    let has_main = |file: u32| {
        let text = debug.files[file as usize].text.as_deref()?;
        let line = text.lines().nth(line.checked_sub(1)? as usize)?;
        line.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == "main").then_some(file)
    };
    if has_main(named).is_some() {
        return None;
    }
    let mut all = (0..debug.files.len() as u32).filter_map(has_main);
    let only = all.next()?;
    all.next().is_none().then_some(only)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::module::Id;
    use crate::module::debug_info::{SourceFile, SourceLine};

    fn function(offset: u32) -> Function {
        Function {
            id: Id(offset),
            offset,
            control: 0,
            return_type: crate::module::ty::TypeId(0),
            parameters: Vec::new(),
            blocks: Vec::new(),
            calls: Vec::new(),
            variables: Vec::new(),
        }
    }

    fn debug(texts: [Option<&str>; 2], lines: &[(u32, u32, u32)]) -> DebugInfo {
        let file = |text: Option<&str>| SourceFile { name: String::new(), text: text.map(Arc::from) };
        let line = |&(offset, file, line)| (offset, Some(SourceLine { file, line, column: 0 }));
        DebugInfo {
            files: texts.into_iter().map(file).collect(),
            lines: lines.iter().map(line).collect(),
            ..DebugInfo::default()
        }
    }

    fn files(debug: &DebugInfo) -> Vec<u32> {
        debug.lines.iter().filter_map(|(_, line)| Some(line.as_ref()?.file)).collect()
    }

    #[test]
    fn a_body_is_in_the_file_of_its_head() {
        // `OpLine` stands before `OpFunction` at word 10, and those of the body after it.
        let mut info = debug([None, None], &[(10, 0, 15), (12, 1, 16), (20, 1, 17), (30, 1, 6), (33, 1, 7)]);
        repair(&mut info, &[function(10), function(30)], 8 << 16);
        assert_eq!(files(&info), [0, 0, 0, 1, 1]);
        // Another compiler means what it says.
        let mut info = debug([None, None], &[(10, 0, 15), (12, 1, 16)]);
        repair(&mut info, &[function(10)], 40 << 16);
        assert_eq!(files(&info), [0, 1]);
    }

    #[test]
    fn the_text_tells_where_main_is() {
        let (shader, included) = ("#include \"a\"\n\nvoid main() {\n}\n", "float a;\nfloat b;\nfloat c;\n");
        let mut info = debug([Some(shader), Some(included)], &[(12, 1, 3), (20, 1, 4)]);
        repair(&mut info, &[function(10)], 8 << 16);
        assert_eq!(files(&info), [0, 0]);
        // A function of the included file stays there.
        let mut info = debug([Some(shader), Some(included)], &[(12, 1, 2), (20, 1, 3)]);
        repair(&mut info, &[function(10)], 8 << 16);
        assert_eq!(files(&info), [1, 1]);
    }

    #[test]
    fn a_body_of_several_files_is_left_alone() {
        let mut info = debug([None, None], &[(10, 0, 15), (12, 1, 16), (20, 0, 17)]);
        repair(&mut info, &[function(10)], 8 << 16);
        assert_eq!(files(&info), [0, 1, 0]);
    }
}
