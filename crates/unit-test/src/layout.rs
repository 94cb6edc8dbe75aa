//! Values of a shader's layout read from bytes, and what a Rust type that does not fit is told.
//!
//! The layout itself, its offsets and sizes, is
//! [`program::layout`](anyhit_engine::program::layout)'s.

use crate::rust_layout::RustLayout;
use crate::value::Value;
use anyhit_base::error::{Error, ErrorKind};
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::program::layout::shorten;

use anyhit_engine::program::layout::Layout;

/// Values of a layout, and what is told where a Rust type does not fit it.
pub trait LayoutValues: Sized {
    /// The device addresses in a value's bytes, each with the type that it points to and the stride
    /// of such elements; those of the first parts, where there are very many.
    fn addresses(self, bytes: &[u8]) -> Vec<(u64, TypeId, Option<usize>)>;

    /// Returns whether values of the type hold device addresses.
    fn has_addresses(self) -> bool;

    /// Reads a value; parts that the bytes do not reach are left out of arrays and are zero
    /// elsewhere.
    ///
    /// Members may share their bytes, so that a few types make any number of parts: those beyond
    /// some sixty readings of all bytes are opaque.
    fn read(self, bytes: &[u8]) -> Value;

    /// An error about a Rust type that does not fit, with the reason where one part is at fault; it
    /// shows both layouts side by side.
    fn mismatch(self, what: &str, rust: &RustLayout, why: Option<String>) -> Error;
}

impl LayoutValues for Layout<'_> {
    fn addresses(self, bytes: &[u8]) -> Vec<(u64, TypeId, Option<usize>)> {
        let mut found = Vec::new();
        collect_addresses(self, bytes, &mut 4096, &mut found);
        found
    }

    fn has_addresses(self) -> bool {
        match *self.module.ty(self.ty) {
            Type::Pointer { storage_class, .. } => storage_class == storage::PHYSICAL_STORAGE_BUFFER,
            Type::Struct { .. } => self.members().any(|(_, part)| part.has_addresses()),
            Type::Array { element, .. } | Type::RuntimeArray { element, .. } => {
                self.part(element).has_addresses()
            }
            _ => false,
        }
    }

    fn read(self, bytes: &[u8]) -> Value {
        let mut budget = bytes.len().saturating_mul(64).saturating_add(1 << 16);
        read_within(self, bytes, &mut budget)
    }

    fn mismatch(self, what: &str, rust: &RustLayout, why: Option<String>) -> Error {
        let stride = self.runtime_stride();
        let wanted = match stride {
            None => format!("{} bytes", self.size()),
            Some((offset, stride)) => format!("{offset} bytes and {stride} for each element"),
        };
        let name = self.module.describe_type(self.ty);
        let message = if let Some(why) = why {
            format!("{what}: {why}")
        } else if stride.is_none() && rust.size == self.size() {
            format!("{what}: the scalars of `{}` differ from those of the shader's {name}", rust.name)
        } else {
            format!("{what}: `{}` has {} bytes, but the shader's {name} has {wanted}", rust.name, rust.size)
        };
        let heads = [
            format!("{name} in the shader: {wanted}"),
            format!("{} in Rust: {} bytes", rust.name, rust.size),
        ];
        Error::new(ErrorKind::InvalidArgument, message).note_lines(beside(self, rust, heads).join("\n"))
    }
}

fn collect_addresses(
    layout: Layout<'_>,
    bytes: &[u8],
    budget: &mut usize,
    found: &mut Vec<(u64, TypeId, Option<usize>)>,
) {
    let Some(left) = budget.checked_sub(1) else { return };
    *budget = left;
    match *layout.module.ty(layout.ty) {
        Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, pointee: Some(pointee), stride } => {
            if let Some(&address) = bytes.first_chunk() {
                found.push((u64::from_le_bytes(address), pointee, stride.map(|stride| stride as usize)));
            }
        }
        Type::Struct { .. } => {
            for (offset, part) in layout.members() {
                collect_addresses(part, bytes.get(offset..).unwrap_or_default(), budget, found);
            }
        }
        Type::Array { element, .. } | Type::RuntimeArray { element, .. } => {
            let part = Layout { ty: element, ..layout };
            let stride = layout.stride().max(1);
            let count = match *layout.module.ty(layout.ty) {
                Type::Array { length, .. } => array_length(layout.module, length),
                _ => usize::MAX,
            };
            for element in bytes.chunks(stride).take(count) {
                if *budget == 0 {
                    break;
                }
                collect_addresses(part, element, budget, found);
            }
        }
        _ => {}
    }
}

/// As [`Layout::read`]; each part costs its bytes and one more.
fn read_within(layout: Layout<'_>, bytes: &[u8], budget: &mut usize) -> Value {
    let list_at = |bytes: &[u8], count: usize, stride: usize, part: Layout<'_>, budget: &mut usize| {
        let mut elements = Vec::new();
        for index in 0..count {
            if *budget == 0 {
                break;
            }
            let from = bytes.get(index.saturating_mul(stride)..).unwrap_or_default();
            elements.push(read_within(part, from, budget));
        }
        elements
    };
    let list = |count, stride, part, budget: &mut usize| list_at(bytes, count, stride, part, budget);
    let whole = &bytes[..bytes.len().min(layout.size())];
    let name = layout.module.describe_type(layout.ty);
    if *budget == 0 {
        return Value::scalar(name, &[], "opaque");
    }
    *budget = budget.saturating_sub(whole.len() + 1);
    match layout.module.ty(layout.ty) {
        Type::Bool => Value::scalar(name, whole, "bool"),
        Type::Int { width, signed } => {
            let kind = format!("{}{width}", if *signed { 'i' } else { 'u' });
            Value::scalar(name, whole, &kind)
        }
        ty @ Type::Float { .. } => Value::float(name, whole, ty.float_format()),
        // A device address.
        Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. } => {
            Value::scalar(name, whole, "u64")
        }
        Type::Vector { component, count } => {
            let part = layout.part(*component);
            let stride = layout.component_stride(part.size());
            Value::list(name, whole, list(*count as usize, stride, part, budget))
        }
        Type::Matrix { column, count } => {
            let columns = match layout.matrix.filter(|_| layout.explicit()) {
                Some(matrix) if matrix.row_major => {
                    let (part, rows) = (layout.scalar(*column), layout.lanes(*column));
                    let column_name = layout.module.describe_type(*column);
                    let column = |index: usize| {
                        let first = bytes.get(index * part.size()..).unwrap_or_default();
                        let values = list_at(first, rows, matrix.stride as usize, part, budget);
                        let packed = values.iter().flat_map(|value| value.bytes().to_vec());
                        Value::list(column_name.clone(), &packed.collect::<Vec<_>>(), values)
                    };
                    (0..*count as usize).map(column).collect()
                }
                Some(matrix) => list(*count as usize, matrix.stride as usize, layout.part(*column), budget),
                None => list(*count as usize, layout.part(*column).size(), layout.part(*column), budget),
            };
            Value::list(name, whole, columns)
        }
        Type::Array { element, length, .. } => {
            let part = Layout { ty: *element, ..layout };
            // What the bytes reach, as a module may declare any length.
            let reached = match part.size() {
                0 => 0,
                size => bytes.len().div_ceil(size.max(layout.stride())),
            };
            let length = array_length(layout.module, *length).min(reached);
            Value::list(name, whole, list(length, layout.stride(), part, budget))
        }
        Type::RuntimeArray { element, .. } => {
            let part = Layout { ty: *element, ..layout };
            let stride = layout.stride().max(1);
            Value::list(name, bytes, list(bytes.len() / stride, stride, part, budget))
        }
        Type::Struct { members, .. } => {
            let places = members.iter().zip(layout.members()).enumerate();
            let fields = places.map(|(index, (member, (offset, layout)))| {
                let name = match member.name.as_str() {
                    "" => format!("_{index}"),
                    name => name.to_string(),
                };
                (name, read_within(layout, bytes.get(offset..).unwrap_or_default(), budget))
            });
            let open = layout.runtime_stride().is_some();
            Value::structure(name, if open { bytes } else { whole }, fields.collect())
        }
        _ => Value::scalar(name, &[], "opaque"),
    }
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
