//! Why an entry point would not run.

use std::fmt::Write;
use std::sync::Arc;

use crate::error::Error;
use crate::module::Module;
use crate::module::interface::{EntryPoint, Stage};
use crate::ops::support::{self, Gap};

/// Why an entry point would not run, from the error that [`lower()`](crate::program::lower())
/// stopped with.
///
/// Lowering stops at the first obstacle; everything that is known by name not to run is listed with
/// it.
pub fn obstacles(module: &Arc<Module>, entry: &EntryPoint, error: &Error) -> Vec<String> {
    let foreign = matches!(entry.stage, Stage::Other(_));
    let gaps = if foreign { Vec::new() } else { support::gaps(module, entry) };
    let told = gaps.iter().any(|gap| error.message().contains(&gap.name));
    let first = (!told).then(|| error.to_string());
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
