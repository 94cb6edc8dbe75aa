//! The layout of a Rust type, as far as its `Debug` text shows it.
//!
//! bytemuck's traits promise plain bytes and name no fields. `#[derive(Debug)]` does: `Payload {
//! normal: [0.0, 0.0, 1.0], hits: 3 }` is three floats and an integer, in the order of the fields.
//! So an error can show both layouts, and floats where the shader has integers are found. A text of
//! another form, from a `Debug` written by hand, tells nothing and is not held against the type.

use std::fmt::Debug;

use crate::module::ty::Type;
use crate::program::layout::Layout;

/// What kind of scalar a number in the text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
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

/// A Rust type: name, size, and its fields as far as they are known.
#[derive(Clone, Debug)]
pub struct RustLayout {
    /// The type's name, without the paths of modules.
    pub name: String,
    /// The size in bytes.
    pub size: usize,
    /// Its fields in order; empty where the text shows none.
    fields: Vec<Field>,
    /// Whether the fields have names: a row of numbers makes no claim about types.
    named: bool,
    /// Bytes of each scalar, where they fill the type without gaps.
    scalar: Option<usize>,
}

impl RustLayout {
    /// The layout of a value's type.
    pub fn of<T: Debug>(value: &T) -> Self {
        Self::from_text(short(std::any::type_name::<T>()), size_of::<T>(), &format!("{value:?}"))
    }

    /// A type whose fields are of no interest.
    pub fn opaque<T: ?Sized>(size: usize) -> Self {
        Self::untold(short(std::any::type_name::<T>()), size)
    }

    /// Bytes by any name.
    pub fn untold(name: String, size: usize) -> Self {
        Self { name, size, fields: Vec::new(), named: false, scalar: None }
    }

    fn from_text(name: String, size: usize, text: &str) -> Self {
        let mut parser = Parser { rest: text, fields: Vec::new() };
        let whole = parser.value("").is_some() && parser.rest.trim().is_empty();
        let fields = if whole { parser.fields } else { Vec::new() };
        let count: usize = fields.iter().map(Field::count).sum();
        let scalar = [4, 8, 2].into_iter().find(|scalar| count > 0 && count * scalar == size);
        let named = text.trim_start().starts_with(|first: char| first.is_alphabetic()) && text.contains('{');
        Self { name, size, fields, named, scalar }
    }

    /// Whether a field is of another kind of scalar than what the shader has at its place.
    pub fn contradicts(&self, layout: Layout<'_>) -> bool {
        let (true, Some(4)) = (self.named, self.scalar) else { return false };
        let classes: Vec<Class> =
            self.fields.iter().flat_map(|field| std::iter::repeat_n(field.class, field.count())).collect();
        layout.scalars().iter().any(|(offset, part)| {
            let class = match layout.module.ty(part.ty) {
                Type::Float { width: 32, .. } => Class::Float,
                Type::Int { width: 32, .. } | Type::Bool => Class::Integer,
                _ => return false,
            };
            offset % 4 == 0 && classes.get(offset / 4).is_some_and(|known| *known != class)
        })
    }

    /// Offset and text of each field; the offset only where it is known.
    pub fn lines(&self) -> Vec<(Option<usize>, String)> {
        let mut at = 0;
        let line = |field: &Field| {
            let offset = self.scalar.map(|scalar| at * scalar);
            at += field.count();
            (offset, field.describe())
        };
        self.fields.iter().map(line).collect()
    }
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
            assert!(RustLayout::from_text("T".into(), 4, text).fields.is_empty(), "{text}");
        }
        assert_eq!(short("[alloc::vec::Vec<a::B>; 2]"), "[Vec<B>; 2]");
    }
}
