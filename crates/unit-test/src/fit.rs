//! Whether the bytes of a Rust value are a value of a shader's type: docs/testing.md, "What a value
//! may be", has the rule as a table.
//!
//! Size, and for each scalar place, width and kind must agree. In arrays of one scalar type, an
//! integer of the other sign passes where its value is the same, and a zero for any scalar: `[2u32,
//! 0]` is `{ uint id; float k; }`. What lies in the shader's padding must be zero there: it would
//! be dropped. Bytes given as `u8`s have no scalars to compare.

use std::collections::HashSet;

use crate::host_struct::HostType;
use crate::host_struct::compare::compare;
use crate::layout_mismatch::mismatch;
use crate::rust_layout::{Class, HostScalar, Known, RustLayout};
use crate::value::bits_of;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::module::ty::Type;
use anyhit_engine::reflect::Layout;

/// Bytes by which a block may be padded at its end.
const PADDING: usize = 16;

/// Scalars of a Rust type with a `Debug` text that are compared one by one.
const COMPARED: usize = 512;

/// Boundaries between rows that are compared.
const BOUNDARIES: usize = 256;

/// A scalar of a shader's type.
#[derive(Clone, Copy)]
struct Scalar<'a> {
    offset: usize,
    /// Its bytes; 2 for a half that stands in four.
    size: usize,
    class: Class,
    layout: Layout<'a>,
}

impl<'a> Scalar<'a> {
    fn new(offset: usize, layout: Layout<'a>) -> Self {
        let (size, class) = match *layout.module.ty(layout.ty) {
            Type::Float { width, .. } => (width as usize / 8, Class::Float),
            _ => (layout.size(), Class::Integer),
        };
        Self { offset, size, class, layout }
    }

    /// Sign and greatest value of an integer.
    fn range(self) -> (bool, u64) {
        match *self.layout.module.ty(self.layout.ty) {
            Type::Bool => (false, 1),
            Type::Int { width, signed } => (signed, u64::MAX >> (64 - width + u32::from(signed))),
            _ => (false, u64::MAX),
        }
    }

    /// Why a scalar of Rust is none of this type, with its bytes.
    fn misfit(self, host: HostScalar, bytes: &[u8]) -> Option<String> {
        let ty = || self.layout.module.describe_type(self.layout.ty);
        if host.size != self.size || host.class != self.class {
            let is_zero = bytes.iter().all(|byte| *byte == 0);
            return (!is_zero).then(|| format!("{}, given as `{}`", ty(), host.name));
        }
        if self.class == Class::Float {
            return None;
        }
        let bits = bits_of(bytes);
        let (signed, greatest) = self.range();
        let is_negative = host.signed && bits >> (8 * host.size - 1) == 1;
        let fits = if is_negative { signed } else { bits <= greatest };
        (!fits).then(|| format!("{}, given the {} {}", ty(), host.name, host.text(bytes)))
    }
}

/// The scalars of a type, ascending by offset, and those of an element of the runtime array that
/// ends it, with its offset and stride.
struct Scalars<'a> {
    fixed: Vec<Scalar<'a>>,
    runtime: Option<(usize, usize, Vec<Scalar<'a>>)>,
    /// The first byte after the parts that are not in the runtime array.
    size: usize,
}

impl<'a> Scalars<'a> {
    fn of(layout: Layout<'a>) -> Self {
        let ascending = |layout: Layout<'a>| {
            let mut scalars: Vec<_> =
                layout.scalars().into_iter().map(|(offset, part)| Scalar::new(offset, part)).collect();
            scalars.sort_by_key(|scalar| scalar.offset);
            scalars
        };
        let runtime = layout.runtime_stride().map(|(offset, stride)| {
            let element = last_element(layout).map_or_else(Vec::new, ascending);
            (offset, stride.max(1), element)
        });
        Self { fixed: ascending(layout), runtime, size: layout.size() }
    }

    /// All scalars within so many bytes.
    fn within(&self, size: usize) -> impl Iterator<Item = Scalar<'a>> + '_ {
        let runtime = self.runtime.iter().flat_map(move |(offset, stride, element)| {
            let starts = (*offset..size).step_by(*stride).take_while(move |start| start + stride <= size);
            starts.flat_map(move |start| {
                element.iter().map(move |scalar| Scalar { offset: start + scalar.offset, ..*scalar })
            })
        });
        self.fixed.iter().copied().chain(runtime)
    }

    /// Whether all scalars of the type have the size and class of a scalar of Rust, and no padding.
    fn is_all(&self, host: HostScalar, size: usize) -> bool {
        let is_row = |scalars: &[Scalar<'_>], end: usize| {
            let fits = |(index, scalar): (usize, &Scalar<'_>)| {
                scalar.offset == index * host.size
                    && (scalar.size, scalar.class) == (host.size, host.class)
                    && (host.class == Class::Float || scalar.range().0 == host.signed)
                    && !matches!(scalar.layout.module.ty(scalar.layout.ty), Type::Bool)
                    && scalar.layout.size() == scalar.size
            };
            scalars.len() * host.size == end && scalars.iter().enumerate().all(fits)
        };
        match &self.runtime {
            Some((offset, stride, element)) => is_row(&self.fixed, *offset) && is_row(element, *stride),
            None => is_row(&self.fixed, size),
        }
    }
}

/// The elements of the runtime array that ends a block.
fn last_element(layout: Layout<'_>) -> Option<Layout<'_>> {
    match layout.members().last()?.1.element()? {
        (element, None) => Some(element),
        _ => None,
    }
}

/// Checks that a Rust value can be the content of a block; `bytes` gives them where the types leave
/// it open.
///
/// # Errors
/// `InvalidArgument` with the first scalar that does not fit, and both layouts.
pub fn check_block(
    layout: Layout<'_>,
    what: &str,
    rust: &RustLayout,
    bytes: &dyn Fn() -> Vec<u8>,
) -> Result<()> {
    if let Known::Structs(host) = &rust.known {
        return check_structs(layout, what, rust, host);
    }
    let size = layout.size();
    let fits = match (layout.runtime_stride(), &rust.known) {
        (Some((offset, stride)), _) => {
            rust.size >= offset && (rust.size - offset).is_multiple_of(stride.max(1))
        }
        (None, Known::Bytes) => rust.size >= size,
        (None, _) => (size..size + PADDING).contains(&rust.size),
    };
    if !fits {
        return Err(mismatch(layout, what, rust, None));
    }
    check_scalars(layout, what, rust, bytes)
}

/// Checks the scalars of a Rust value, whose size is right.
///
/// # Errors
/// As [`check_block`].
pub(super) fn check_scalars(
    layout: Layout<'_>,
    what: &str,
    rust: &RustLayout,
    bytes: &dyn Fn() -> Vec<u8>,
) -> Result<()> {
    let why = match &rust.known {
        Known::Bytes => None,
        Known::Nothing => stride_misfit(layout, rust),
        Known::Block(parts) => (*parts != layout.lines()).then(String::new),
        Known::Classes(classes) => classes_misfit(layout, rust, classes),
        Known::Row(host, lengths) => row_misfit(layout, rust, *host, lengths, bytes),
        Known::Structs(host) => return struct_misfit(layout, what, host),
    };
    match why {
        None => Ok(()),
        Some(why) => Err(mismatch(layout, what, rust, Some(why).filter(|why| !why.is_empty()))),
    }
}

/// Checks structs of another language: they are the elements of the array that a block consists of,
/// or one of them is the whole block.
fn check_structs(layout: Layout<'_>, what: &str, rust: &RustLayout, host: &HostType) -> Result<()> {
    let Some(WholeArray { array, element, length }) = whole_array(layout) else {
        struct_misfit(layout, what, host)?;
        let size = layout.size();
        let fits = rust.size == host.size() && (size..size + PADDING).contains(&rust.size);
        return if fits { Ok(()) } else { Err(mismatch(layout, what, rust, None)) };
    };
    struct_misfit(element, what, host)?;
    let stride = array.stride().max(1);
    let count = rust.size / stride;
    let fits = host.size() == stride && length.is_none_or(|length| length == count);
    if fits {
        return Ok(());
    }
    let why = match length {
        Some(length) if host.size() == stride => format!("{count} elements, but {length} in the shader"),
        _ => rows_apart(host.size(), stride),
    };
    Err(mismatch(layout, what, rust, Some(why)))
}

/// An array with its elements.
#[derive(Clone, Copy, Debug)]
pub struct WholeArray<'a> {
    /// The array itself.
    pub array: Layout<'a>,
    /// An element.
    pub element: Layout<'a>,
    /// The number of elements; `None` for a runtime array.
    pub length: Option<usize>,
}

/// Returns the array that a block consists of.
pub fn whole_array(layout: Layout<'_>) -> Option<WholeArray<'_>> {
    if let Some((element, length)) = layout.element() {
        return Some(WholeArray { array: layout, element, length });
    }
    let mut members = layout.members();
    let (only, others) = (members.next()?.1, members.next());
    others.is_none().then_some(())?;
    whole_array(only)
}

/// # Errors
/// `InvalidArgument` with the first byte at which a struct of another language differs.
fn struct_misfit(layout: Layout<'_>, what: &str, host: &HostType) -> Result<()> {
    let Some(error) = compare(layout, host, host.name()).error() else { return Ok(()) };
    let wrong = Error::new(ErrorKind::InvalidArgument, format!("{what}: {}", error.message()));
    Err(error.notes().iter().fold(wrong, |wrong, note| wrong.note_lines(note.clone())))
}

/// Elements of which only the size is known lie as far apart as the shader's.
fn stride_misfit(layout: Layout<'_>, rust: &RustLayout) -> Option<String> {
    let (offset, stride) = layout.runtime_stride()?;
    let is_one = rust.element == rust.size || rust.element == 0;
    let fits = rust.element.is_multiple_of(stride) || stride.is_multiple_of(rust.element.max(1));
    (offset == 0 && !is_one && !fits).then(|| rows_apart(rust.element, stride))
}

fn rows_apart(given: usize, stride: usize) -> String {
    format!("elements are {given} bytes apart, but {stride} in the shader")
}

fn row_misfit(
    layout: Layout<'_>,
    rust: &RustLayout,
    host: HostScalar,
    lengths: &[usize],
    bytes: &dyn Fn() -> Vec<u8>,
) -> Option<String> {
    let scalars = Scalars::of(layout);
    if let Some(wrong) = boundary_misfit(layout, &scalars, rust, host, lengths) {
        return Some(wrong);
    }
    if scalars.is_all(host, rust.size) {
        return None;
    }
    let bytes = bytes();
    let mut end = 0;
    for scalar in scalars.within(rust.size) {
        if let Some(wrong) = padding_misfit(&bytes, end, scalar.offset, host) {
            return Some(wrong);
        }
        let Some(own) = bytes.get(scalar.offset..scalar.offset + scalar.size) else { break };
        let host = match scalar.offset.is_multiple_of(host.size) {
            true => host,
            // It lies across two: nothing but zero is the same.
            false => HostScalar { size: 0, ..host },
        };
        if let Some(why) = scalar.misfit(host, own) {
            let path = layout.path_at(scalar.offset);
            return Some(format!("`{path}` is {why}"));
        }
        end = end.max(scalar.offset + scalar.size);
    }
    padding_misfit(&bytes, end, bytes.len(), host)
}

/// What would be lost between two scalars of the shader.
fn padding_misfit(bytes: &[u8], from: usize, to: usize, host: HostScalar) -> Option<String> {
    let lost = bytes.get(from..to)?.iter().position(|byte| *byte != 0)? + from;
    let at = lost / host.size * host.size;
    let number = host.text(bytes.get(at..(at + host.size).min(bytes.len()))?);
    Some(format!("the {} {number} at offset {at} is in padding, which no shader reads", host.name))
}

/// Arrays in arrays begin where vectors, columns and elements of the shader do.
fn boundary_misfit(
    layout: Layout<'_>,
    scalars: &Scalars<'_>,
    rust: &RustLayout,
    host: HostScalar,
    lengths: &[usize],
) -> Option<String> {
    if lengths.len() < 2 {
        return None;
    }
    let starts = |layout: Layout<'_>| {
        let mut found = HashSet::new();
        collect_starts(layout, 0, &mut found);
        found
    };
    let fixed = starts(layout);
    let element = last_element(layout).map(starts);
    let mut row = host.size;
    for length in lengths[1..].iter().rev() {
        row *= length;
        let rows = rust.size.checked_div(row).unwrap_or(0);
        for index in (1..rows).take(BOUNDARIES) {
            let at = index * row;
            let is_start = match (&scalars.runtime, &element) {
                (Some((offset, stride, _)), Some(element)) if at >= *offset => {
                    element.contains(&((at - offset) % stride))
                }
                // The padding at the end of a block is its own part.
                _ => fixed.contains(&at) || at >= scalars.size,
            };
            if !is_start {
                return Some(match &scalars.runtime {
                    Some((_, stride, _)) => rows_apart(row, *stride),
                    None => format!(
                        "an array of {row} bytes begins at offset {at}, where no part of the shader's \
                         layout begins"
                    ),
                });
            }
        }
    }
    None
}

/// Offsets at which vectors, columns and scalars that are in no vector begin.
fn collect_starts(layout: Layout<'_>, offset: usize, found: &mut HashSet<usize>) {
    match layout.module.ty(layout.ty) {
        Type::Struct { .. } => {
            for (at, member) in layout.members() {
                collect_starts(member, offset + at, found);
            }
        }
        Type::Array { .. } | Type::Matrix { .. } => {
            for (at, part) in layout.parts() {
                collect_starts(part, offset + at, found);
            }
        }
        _ => {
            found.insert(offset);
        }
    }
}

/// The scalars of a type with a `Debug` text: sizes are looked for that make them the shader's.
fn classes_misfit(layout: Layout<'_>, rust: &RustLayout, classes: &[Class]) -> Option<String> {
    let scalars = Scalars::of(layout);
    let all: Vec<Scalar<'_>> = scalars.within(rust.size).collect();
    // Scalars of one size, as most structs have them.
    let size = rust.size / classes.len().max(1);
    let is_alike = |scalar: &Scalar<'_>| {
        scalar.size == size
            && scalar.offset.is_multiple_of(size)
            && classes.get(scalar.offset / size) == Some(&scalar.class)
    };
    if size * classes.len() == rust.size && all.iter().all(is_alike) || classes.len() > COMPARED {
        return None;
    }
    let open = |offset: usize, size: usize, class: Class| {
        let next = all.partition_point(|scalar| scalar.offset < offset);
        match all.get(next) {
            Some(scalar) if scalar.offset == offset => (scalar.size, scalar.class) == (size, class),
            Some(scalar) => offset + size <= scalar.offset,
            None => true,
        }
    };
    match has_sizes(classes, rust.size, &|_, _, _| true) && !has_sizes(classes, rust.size, &open) {
        true => Some(String::new()),
        false => None,
    }
}

/// Whether scalars of some sizes, one behind the other, fill so many bytes.
fn has_sizes(classes: &[Class], size: usize, fits: &dyn Fn(usize, usize, Class) -> bool) -> bool {
    let mut ends = HashSet::from([0]);
    for class in classes {
        let sizes: &[usize] = match class {
            Class::Float => &[2, 4, 8],
            Class::Integer => &[1, 2, 4, 8],
        };
        let mut next = HashSet::new();
        for &at in &ends {
            next.extend(
                sizes.iter().filter(|&&own| at + own <= size && fits(at, own, *class)).map(|own| at + own),
            );
        }
        ends = next;
    }
    ends.contains(&size)
}
