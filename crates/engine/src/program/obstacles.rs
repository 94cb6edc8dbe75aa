//! Lists why an entry point cannot run.

use std::fmt::Write;
use std::sync::Arc;

use crate::module::Module;
use crate::module::interface::{EntryPoint, Stage};
use crate::ops::support::{self, Gap};
use anyhit_base::error::{Error, Place};

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
