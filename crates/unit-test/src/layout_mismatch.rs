//! The error about a Rust type that does not fit a shader's.

use crate::rust_layout::RustLayout;
use anyhit_base::error::{Error, ErrorKind};
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::reflect::{Layout, shorten};

/// An error about a Rust type that does not fit, with the reason where one part is at fault; it
/// shows both layouts side by side.
pub(super) fn mismatch(layout: Layout<'_>, what: &str, rust: &RustLayout, why: Option<String>) -> Error {
    let stride = layout.runtime_stride();
    let wanted = match stride {
        None => format!("{} bytes", layout.size()),
        Some((offset, stride)) => format!("{offset} bytes and {stride} for each element"),
    };
    let name = layout.module.describe_type(layout.ty);
    let message = if let Some(why) = why {
        format!("{what}: {why}")
    } else if stride.is_none() && rust.size == layout.size() {
        format!("{what}: the scalars of `{}` differ from those of the shader's {name}", rust.name)
    } else {
        format!("{what}: `{}` has {} bytes, but the shader's {name} has {wanted}", rust.name, rust.size)
    };
    let heads =
        [format!("{name} in the shader: {wanted}"), format!("{} in Rust: {} bytes", rust.name, rust.size)];
    Error::new(ErrorKind::InvalidArgument, message).note_lines(beside(layout, rust, heads).join("\n"))
}

/// The lines of both layouts, those of one offset in one line.
fn beside(layout: Layout<'_>, rust: &RustLayout, heads: [String; 2]) -> Vec<String> {
    let mut rows: Vec<(usize, [String; 2])> =
        layout.lines().into_iter().map(|(offset, text)| (offset, [text, String::new()])).collect();
    for (at, (offset, text)) in rust.lines().into_iter().enumerate() {
        // Without offsets the fields just stand in their order.
        let found = match offset {
            Some(offset) => rows.iter().position(|row| row.0 == offset),
            None => Some(at).filter(|at| *at < rows.len()),
        };
        match (found, offset) {
            (Some(found), _) => rows[found].1[1] = text,
            (None, Some(offset)) => rows.push((offset, [String::new(), text])),
            (None, None) => rows.push((usize::MAX, [String::new(), text])),
        }
    }
    sort_by_key(&mut rows, |row| row.0);
    let width = rows.iter().map(|row| row.1[0].chars().count()).chain([heads[0].chars().count()]).max();
    let width = width.unwrap_or(0);
    let line = |offset: String, [left, right]: [String; 2]| {
        format!("{offset:>6}  {left:width$}  {right}").trim_end().to_owned()
    };
    let mut lines: Vec<String> = rows
        .into_iter()
        .map(|(offset, cells)| {
            line(if offset == usize::MAX { String::new() } else { offset.to_string() }, cells)
        })
        .collect();
    shorten(&mut lines);
    lines.insert(0, line("offset".into(), heads));
    lines
}
