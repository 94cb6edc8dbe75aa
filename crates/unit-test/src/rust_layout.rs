//! The layout of a Rust type, as far as its name and its `Debug` text show it.
//!
//! Scalars, and arrays and slices of them, are known by the type's name: `[[f32; 4]; 2]`.
//! bytemuck's traits promise that other types are plain bytes without padding, and name no fields;
//! `#[derive(Debug)]` does: `Payload { normal: [0.0, 0.0, 1.0], hits: 3 }` is three floats and an
//! integer, in the order of the fields. A text of another form, from a `Debug` written by hand,
//! tells nothing and is not held against the type. `u8`s are bytes, of which nothing is claimed.

use std::fmt::Debug;

use crate::host_struct::HostType;
use crate::value::bits_of;

/// What kind of scalar a number is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    Float,
    Integer,
}

/// A field, or an element that is no array of scalars.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Field {
    path: String,
    class: Class,
    /// Lengths of the arrays around, outermost first.
    shape: Vec<usize>,
}

impl Field {
    fn count(&self) -> usize {
        self.shape.iter().product()
    }

    fn describe(&self) -> String {
        let mut ty = match self.class {
            Class::Float => "float".to_owned(),
            Class::Integer => "integer".to_owned(),
        };
        for length in self.shape.iter().rev() {
            ty = format!("[{ty}; {length}]");
        }
        if self.path.is_empty() { ty } else { format!("{}: {ty}", self.path) }
    }
}

/// A scalar type of Rust.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct HostScalar {
    pub name: &'static str,
    /// Its size in bytes.
    pub size: usize,
    pub class: Class,
    pub signed: bool,
}

impl HostScalar {
    const ALL: [Self; 13] = [
        Self::integer("u8", 1, false),
        Self::integer("u16", 2, false),
        Self::integer("u32", 4, false),
        Self::integer("u64", 8, false),
        Self::integer("usize", size_of::<usize>(), false),
        Self::integer("i8", 1, true),
        Self::integer("i16", 2, true),
        Self::integer("i32", 4, true),
        Self::integer("i64", 8, true),
        Self::float("f16", 2),
        Self::float("bf16", 2),
        Self::float("f32", 4),
        Self::float("f64", 8),
    ];

    const fn integer(name: &'static str, size: usize, signed: bool) -> Self {
        Self { name, size, class: Class::Integer, signed }
    }

    const fn float(name: &'static str, size: usize) -> Self {
        Self { name, size, class: Class::Float, signed: true }
    }

    /// A value of the type as Rust writes it.
    pub(super) fn text(self, bytes: &[u8]) -> String {
        let bits = bits_of(bytes);
        let unused = 64 - 8 * self.size as u32;
        match (self.class, self.size, self.signed) {
            (Class::Float, 8, _) => format!("{:?}", f64::from_bits(bits)),
            (Class::Float, 4, _) => format!("{:?}", f32::from_bits(bits as u32)),
            (Class::Float, ..) => format!("bits {bits:#06x}"),
            (Class::Integer, _, true) => ((bits << unused) as i64 >> unused).to_string(),
            (Class::Integer, ..) => bits.to_string(),
        }
    }
}

/// What is known of the bytes.
#[derive(Clone, Debug)]
pub(super) enum Known {
    /// Nothing but their size.
    Nothing,
    /// They are given as bytes.
    Bytes,
    /// Scalars of one type, in arrays of these lengths from the outermost.
    Row(HostScalar, Vec<usize>),
    /// The classes of all scalars in their order; the sizes are not known.
    Classes(Vec<Class>),
    /// The offset and text of each part of a struct of a module.
    Block(Vec<(usize, String)>),
    /// Structs of another language, one behind the other.
    Structs(HostType),
}

/// A Rust type: name, size, and its scalars as far as they are known.
#[derive(Clone, Debug)]
pub struct RustLayout {
    /// The type's name, without the paths of modules.
    pub name: String,
    /// The size in bytes.
    pub size: usize,
    /// The bytes of an element of a slice; the size of a value.
    pub(super) element: usize,
    pub(super) known: Known,
    /// Its fields in order; empty where the text shows none.
    fields: Vec<Field>,
    /// Bytes of each scalar, where they fill the type without gaps.
    scalar: Option<usize>,
}

impl RustLayout {
    /// The layout of a value's type.
    pub fn of<T: Debug>(value: &T) -> Self {
        let name = std::any::type_name::<T>();
        match row(name) {
            Some((scalar, lengths)) => Self::of_row(scalar, lengths, size_of::<T>()),
            None => Self::from_text(short(name), size_of::<T>(), &format!("{value:?}")),
        }
    }

    /// The layout of a slice of elements.
    pub fn of_slice<T>(elements: &[T]) -> Self {
        let name = std::any::type_name::<T>();
        let size = size_of_val(elements);
        match row(name) {
            Some((scalar, mut lengths)) => {
                lengths.insert(0, elements.len());
                Self { element: size_of::<T>(), ..Self::of_row(scalar, lengths, size) }
            }
            None => {
                let name = format!("[{}; {}]", short(name), elements.len());
                Self { element: size_of::<T>(), ..Self::untold(name, size) }
            }
        }
    }

    /// An array of scalars of a type by its name, with lengths from the outermost.
    pub(super) fn of_array(scalar: &str, lengths: &[usize], size: usize) -> Option<Self> {
        let scalar = HostScalar::ALL.into_iter().find(|known| known.name == scalar)?;
        let inner: usize = lengths.iter().skip(1).product();
        Some(Self { element: inner * scalar.size, ..Self::of_row(scalar, lengths.to_vec(), size) })
    }

    /// Structs of another language, one behind the other.
    pub(super) fn of_structs(host: HostType, size: usize) -> Self {
        let (name, element) = (host.name().to_owned(), host.size());
        Self { element, known: Known::Structs(host), ..Self::untold(name, size) }
    }

    /// Bytes by any name.
    pub fn untold(name: String, size: usize) -> Self {
        Self { name, size, element: size, known: Known::Nothing, fields: Vec::new(), scalar: None }
    }

    /// A struct of a module with its parts.
    pub(super) fn of_block(name: String, size: usize, parts: Vec<(usize, String)>) -> Self {
        Self { known: Known::Block(parts), ..Self::untold(name, size) }
    }

    /// Claims nothing but the size any more.
    pub(super) fn forget(&mut self) {
        self.known = Known::Bytes;
    }

    fn of_row(scalar: HostScalar, lengths: Vec<usize>, size: usize) -> Self {
        let mut name = scalar.name.to_owned();
        for length in lengths.iter().rev() {
            name = format!("[{name}; {length}]");
        }
        let known = match scalar.name {
            "u8" => Known::Bytes,
            _ => Known::Row(scalar, lengths.clone()),
        };
        let field = Field { path: String::new(), class: scalar.class, shape: lengths };
        Self { known, fields: vec![field], scalar: Some(scalar.size), ..Self::untold(name, size) }
    }

    fn from_text(name: String, size: usize, text: &str) -> Self {
        let mut parser = Parser { rest: text, fields: Vec::new() };
        let whole = parser.value("").is_some() && parser.rest.trim().is_empty();
        let fields = if whole { parser.fields } else { Vec::new() };
        let count: usize = fields.iter().map(Field::count).sum();
        let scalar = [4, 8, 2].into_iter().find(|scalar| count > 0 && count * scalar == size);
        let classes: Vec<Class> =
            fields.iter().flat_map(|field| std::iter::repeat_n(field.class, field.count())).collect();
        let known = if classes.is_empty() { Known::Nothing } else { Known::Classes(classes) };
        Self { name, size, element: size, known, fields, scalar }
    }

    /// Offset and text of each field; the offset only where it is known.
    pub fn lines(&self) -> Vec<(Option<usize>, String)> {
        if let Known::Block(parts) = &self.known {
            return parts.iter().map(|(offset, text)| (Some(*offset), text.clone())).collect();
        }
        let mut at = 0;
        let line = |field: &Field| {
            let offset = self.scalar.map(|scalar| at * scalar);
            at += field.count();
            (offset, field.describe())
        };
        self.fields.iter().map(line).collect()
    }
}

/// The scalar type and the lengths of a type that is made of arrays of one scalar type.
fn row(name: &str) -> Option<(HostScalar, Vec<usize>)> {
    let mut lengths = Vec::new();
    let mut rest = name;
    while let Some(inner) = rest.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
        let (element, length) = inner.rsplit_once("; ")?;
        lengths.push(length.parse().ok()?);
        rest = element;
    }
    let name = match rest {
        "half::binary16::f16" => "f16",
        "half::bfloat::bf16" => "bf16",
        name if name.contains(':') => return None,
        name => name,
    };
    let scalar = HostScalar::ALL.into_iter().find(|scalar| scalar.name == name)?;
    Some((scalar, lengths))
}

/// A type's name without the paths of modules: `[a::b::C; 2]` becomes `[C; 2]`.
fn short(name: &str) -> String {
    let mut out = String::new();
    for part in name.split_inclusive(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')) {
        out.push_str(part.rsplit("::").next().unwrap_or(part));
    }
    out
}

struct Parser<'a> {
    rest: &'a str,
    fields: Vec<Field>,
}

impl Parser<'_> {
    fn eat(&mut self, token: char) -> Option<()> {
        self.rest = self.rest.trim_start().strip_prefix(token)?;
        Some(())
    }

    fn word(&mut self) -> String {
        let text = self.rest.trim_start();
        let end = text.find(|c: char| !(c.is_alphanumeric() || "_.+-".contains(c))).unwrap_or(text.len());
        self.rest = &text[end..];
        text[..end].to_owned()
    }

    /// A value; its fields are added under a path.
    fn value(&mut self, path: &str) -> Option<()> {
        if self.eat('[').is_some() {
            return self.list(path, ']');
        }
        if self.eat('(').is_some() {
            return self.list(path, ')');
        }
        let word = self.word();
        let class = match word.as_str() {
            "true" | "false" => Class::Integer,
            "NaN" | "inf" | "-inf" => Class::Float,
            number if number.starts_with(|c: char| c.is_ascii_digit() || c == '-') => {
                number.parse::<f64>().ok()?;
                if number.contains(['.', 'e']) { Class::Float } else { Class::Integer }
            }
            name if name.starts_with(char::is_alphabetic) => {
                if self.eat('(').is_some() {
                    return self.list(path, ')');
                }
                return self.eat('{').and_then(|()| self.members(path));
            }
            _ => return None,
        };
        self.fields.push(Field { path: path.to_owned(), class, shape: Vec::new() });
        Some(())
    }

    fn members(&mut self, path: &str) -> Option<()> {
        while self.eat('}').is_none() {
            let name = self.word();
            self.eat(':')?;
            let dot = if path.is_empty() { "" } else { "." };
            self.value(&format!("{path}{dot}{name}"))?;
            if self.eat(',').is_none() {
                return self.eat('}');
            }
        }
        Some(())
    }

    /// Elements; those of one shape and class become one field.
    fn list(&mut self, path: &str, close: char) -> Option<()> {
        let before = self.fields.len();
        let mut count = 0;
        let mut single = true;
        while self.eat(close).is_none() {
            let first = self.fields.len();
            self.value(&format!("{path}[{count}]"))?;
            single &= self.fields.len() == first + 1;
            count += 1;
            if self.eat(',').is_none() {
                self.eat(close)?;
                break;
            }
        }
        let list = &self.fields[before..];
        let alike = |field: &Field| field.class == list[0].class && field.shape == list[0].shape;
        if single && count > 0 && list.iter().all(alike) && list[0].path == format!("{path}[0]") {
            let Field { class, shape, .. } = list[0].clone();
            let shape = std::iter::once(count).chain(shape).collect();
            self.fields.truncate(before);
            self.fields.push(Field { path: path.to_owned(), class, shape });
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, Debug)]
    #[allow(dead_code, reason = "read through Debug")]
    struct Inner {
        at: [f32; 2],
        id: u32,
    }

    #[derive(Clone, Copy, Debug)]
    #[allow(dead_code, reason = "read through Debug")]
    struct Outer {
        normal: [f32; 3],
        turned: [[f32; 2]; 2],
        parts: [Inner; 2],
        count: i32,
    }

    #[test]
    fn derived_debug_tells_names_shapes_and_offsets() {
        let inner = Inner { at: [f32::NAN, -1e-9], id: 7 };
        let outer =
            Outer { normal: [0.0, f32::INFINITY, 1e30], turned: [[0.5; 2]; 2], parts: [inner; 2], count: -1 };
        let lines = RustLayout::of(&outer).lines();
        let expected = [
            (0, "normal: [float; 3]"),
            (12, "turned: [[float; 2]; 2]"),
            (28, "parts[0].at: [float; 2]"),
            (36, "parts[0].id: integer"),
            (40, "parts[1].at: [float; 2]"),
            (48, "parts[1].id: integer"),
            (52, "count: integer"),
        ];
        assert_eq!(lines, expected.map(|(offset, text)| (Some(offset), text.to_owned())));
    }

    #[test]
    fn other_texts_tell_nothing() {
        for text in ["#00ff00", "Colour(#00ff00)", "0x12", "a { b: 1", "1 2", "\"text\""] {
            let layout = RustLayout::from_text("T".into(), 4, text);
            assert!(layout.fields.is_empty() && matches!(layout.known, Known::Nothing), "{text}");
        }
        assert_eq!(short("[alloc::vec::Vec<a::B>; 2]"), "[Vec<B>; 2]");
    }

    #[test]
    fn arrays_of_scalars_are_known_by_their_names() {
        let f32s = HostScalar::float("f32", 4);
        assert_eq!(row("[[f32; 4]; 2]"), Some((f32s, vec![2, 4])));
        assert_eq!(row(std::any::type_name::<half::f16>()).map(|row| row.0.name), Some("f16"));
        assert_eq!(row(std::any::type_name::<half::bf16>()).map(|row| row.0.name), Some("bf16"));
        assert_eq!(row("a::f32"), None);
        let slice = RustLayout::of_slice(&[[1.0f64; 2]; 3]);
        assert_eq!((slice.name.as_str(), slice.size, slice.element), ("[[f64; 2]; 3]", 48, 16));
        assert!(matches!(RustLayout::of(&[7u8; 4]).known, Known::Bytes));
    }
}
