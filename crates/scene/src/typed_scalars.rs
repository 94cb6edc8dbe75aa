//! Typed scalars of a scene compared with what the shaders declare where they are bound:
//! docs/testing.md, "Value conversions", has the rule.

use std::sync::Arc;

use crate::read::Span;
use crate::scalar::Scalar;
use anyhit_base::error::Error;
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::Type;
use anyhit_engine::reflect::lookup::{DataBlock, find_block, layout_note};
use anyhit_engine::reflect::{Layout, ScalarSearch};

/// Bytes by which a block may be padded at its end.
const PADDING: usize = 16;

/// Scalars of a buffer that are compared; of longer data the first.
const COMPARED: usize = 1 << 20;

/// Scalars of one type in a row.
#[derive(Clone, Debug, PartialEq)]
pub struct TypedScalars {
    /// Bytes before the first.
    pub(super) offset: usize,
    pub(super) scalar: Scalar,
    /// Their bytes, little-endian.
    pub(super) bytes: Vec<u8>,
    /// How often the bytes follow each other.
    pub(super) repeat: u32,
    pub(super) span: Span,
}

/// A scalar that is no value of the shader's type.
pub(super) struct Misfit {
    span: Span,
    message: String,
    help: String,
}

impl Misfit {
    /// The error, and how to mend it.
    pub(super) fn error(self) -> (Error, String) {
        (self.span.error_with(self.message, "given here"), self.help)
    }
}

impl TypedScalars {
    /// Offset and bits of each scalar.
    fn each(&self) -> impl Iterator<Item = (usize, u64)> + '_ {
        let size = self.scalar.size();
        let rows = (0..self.repeat as usize).flat_map(move |row| {
            self.bytes.chunks(size).enumerate().map(move |(at, scalar)| {
                let bits = scalar.iter().rev().fold(0, |bits, byte| bits << 8 | u64::from(*byte));
                (self.offset + row * self.bytes.len() + at * size, bits)
            })
        });
        rows.take(COMPARED)
    }

    /// The first scalar that the layout of `whole`, a path or nothing, cannot have. No shader reads
    /// those beyond its end.
    pub(super) fn misfit(&self, layout: Layout<'_>, whole: &str) -> Option<Misfit> {
        let wrong = |message: String, help: String| Some(Misfit { span: self.span.clone(), message, help });
        for (offset, bits) in self.each().filter(|(_, bits)| *bits != 0) {
            let name = self.scalar.name();
            match layout.scalar_at(offset) {
                ScalarSearch::Scalar(found, start) => {
                    let ty = found.module.ty(found.ty);
                    let is_narrow = matches!(ty, Type::Bool | Type::Int { width: ..32, .. })
                        || matches!(ty, Type::Float { width: ..32, .. });
                    // In payloads what is narrower has 32 bits, whose upper ones count for nothing.
                    if start == offset && self.scalar.fits(bits, ty) || is_narrow && !layout.explicit() {
                        continue;
                    }
                    let path = if whole.is_empty() { layout.path_at(start) } else { whole.to_owned() };
                    let declared = found.module.describe_type(found.ty);
                    let text = self.scalar.text(bits);
                    let help = match Scalar::of(ty) {
                        Some(own) if own != self.scalar => {
                            format!("help: write `{} = ...`, or bytes with `u8` or `hex`", own.name())
                        }
                        _ => "help: insert `{ align = N }` or `{ zeros = N }` before it".to_owned(),
                    };
                    return wrong(format!("`{path}` is {declared}: found the {name} {text}"), help);
                }
                ScalarSearch::Padding => {
                    let text = self.scalar.text(bits);
                    return wrong(
                        format!("the {name} {text} at byte {offset} is in padding, which no shader reads"),
                        "help: write zeros where the layout has padding, or set members by name with `value = ...`"
                            .to_owned(),
                    );
                }
                ScalarSearch::Beyond => {}
            }
        }
        None
    }

    /// Why the scalars, one after the other, are none of a type.
    pub(super) fn misfit_in(&self, ty: &Type) -> Option<String> {
        let wrong = self.each().find(|(_, bits)| *bits != 0 && !self.scalar.fits(*bits, ty))?;
        Some(format!("the {} {}", self.scalar.name(), self.scalar.text(wrong.1)))
    }
}

/// Compares data with the block that the modules declare, where one declares it. Of several
/// declarations one has to agree.
pub(super) fn check(modules: &[Arc<Module>], block: DataBlock, typed: &[TypedScalars]) -> Option<Error> {
    // Several layouts in one module: the data may be any of them.
    let layouts: Result<Vec<_>, Error> = modules.iter().map(|module| find_block(module, block)).collect();
    check_layouts(layouts.ok()?.into_iter().flatten(), typed)
}

/// Compares data with layouts, one of which has to agree.
pub(super) fn check_layouts<'m>(
    layouts: impl Iterator<Item = Layout<'m>>,
    typed: &[TypedScalars],
) -> Option<Error> {
    let mut first = None;
    for layout in layouts {
        let misfit = typed.iter().find_map(|typed| typed.misfit(layout, ""))?;
        first.get_or_insert_with(|| {
            let (error, help) = misfit.error();
            error.note_lines(layout_note(layout)).note(help)
        });
    }
    first
}

/// Compares the size of push constants with the longest block of them that the modules declare.
pub(super) fn check_size(modules: &[Arc<Module>], size: u64, span: &Span) -> Option<Error> {
    let mut longest: Option<Layout<'_>> = None;
    for module in modules {
        let layout = find_block(module, DataBlock::PushConstants).ok()?;
        longest = [longest, layout].into_iter().flatten().max_by_key(|layout| layout.size());
    }
    let layout = longest.filter(|layout| size >= (layout.size() + PADDING) as u64)?;
    let message = format!("the push constants have {size} bytes, but the shaders declare {}", layout.size());
    let error = span.error_with(message, "given here").note_lines(layout_note(layout));
    Some(error.note("help: set only members that the shaders declare"))
}
