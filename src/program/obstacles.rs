//! Lists why an entry point cannot run.

use std::fmt::Write;
use std::sync::Arc;

use crate::error::{Error, Place};
use crate::module::Module;
use crate::module::interface::{EntryPoint, Stage};
use crate::ops::support::{self, Gap};

/// The reasons why an entry point cannot run, given the error of
/// [`lower()`](crate::program::lower()).
///
/// Lowering stops at the first obstacle; this lists all features that are known to be unsupported,
/// too.
pub fn obstacles(module: &Arc<Module>, entry: &EntryPoint, error: &Error) -> Vec<String> {
    let is_other_stage = matches!(entry.stage, Stage::Other(_));
    let gaps = if is_other_stage { Vec::new() } else { support::gaps(module, entry) };
    // An error at an instruction that a gap is about tells of the gap.
    let words =
        || error.places().filter_map(|(place, _)| if let Place::Word(at) = place { Some(*at) } else { None });
    let is_about = |gap: &Gap| words().any(|at| gap.offsets.iter().any(|&offset| offset as usize == at));
    let is_listed = gaps.iter().any(is_about);
    let first = (!is_listed).then(|| error.to_string());
    first.into_iter().chain(gaps.iter().map(|gap| obstacle(module, gap))).collect()
}

fn obstacle(module: &Module, gap: &Gap) -> String {
    let mut text = gap.message.clone();
    let times = if gap.count > 1 { format!("{} times, first ", gap.count) } else { String::new() };
    // Writing to a string does not fail.
    let _ = write!(text, " ({times}at word {}", gap.offset);
    if let Some(line) = module.debug_info.line_at(gap.offset) {
        let file = module.debug_info.files.get(line.file as usize).map_or("?", |file| &file.name);
        let _ = write!(text, ", {file}:{}", line.line);
    }
    text.push(')');
    text
}

#[cfg(test)]
mod tests {
    use rspirv::spirv::Op as Opcode;

    use super::*;
    use crate::module::assemble::Assembler;
    use crate::program::lower;

    /// A closest-hit shader that reads an input variable with the builtin of this number, then does
    /// something; why it does not run.
    fn refused(builtin: u32, body: impl FnOnce(&mut Assembler)) -> Vec<String> {
        let mut a = Assembler::new();
        a.with_string(Opcode::EntryPoint, &[5316, 30], "hit", &[]);
        a.op(Opcode::Decorate, &[20, 11, builtin]);
        a.types();
        a.op(Opcode::TypePointer, &[10, 1, 5]);
        a.op(Opcode::Variable, &[10, 20, 1]);
        a.function(30, 31, |a| {
            body(a);
            a.op(Opcode::Return, &[]);
        });
        let module = Arc::new(a.loaded());
        let entry = &module.entry_points[0];
        let error = lower(&module, entry).map(|_| ()).expect_err("a gap");
        obstacles(&module, entry, &error)
    }

    #[test]
    fn a_gap_that_ends_the_lowering_is_listed_once() {
        /// `RemainingRecursionLevelsAMDX`, out of scope.
        const RECURSION_LEVELS: u32 = 5021;
        let load = |a: &mut Assembler| a.op(Opcode::Load, &[5, 32, 20]);
        let found = refused(RECURSION_LEVELS, |a| _ = load(a));
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with("the builtin RemainingRecursionLevelsAMDX is out"), "{found:?}");
        let found = refused(RECURSION_LEVELS, |a| {
            a.op(Opcode::DemoteToHelperInvocation, &[]);
            load(a);
        });
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[1].starts_with("OpDemoteToHelperInvocation"), "{found:?}");
    }

    #[test]
    fn an_error_that_is_no_gap_comes_first() {
        // `InstanceId` is known; the load is of no pointer.
        let found = refused(6, |a| {
            a.op(Opcode::Load, &[5, 32, 31]);
            a.op(Opcode::DemoteToHelperInvocation, &[]);
        });
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[1].starts_with("OpDemoteToHelperInvocation"), "{found:?}");
    }
}
