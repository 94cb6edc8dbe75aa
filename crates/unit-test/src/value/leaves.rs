//! The scalars in a value, one after the other with their paths.

use super::{Content, Value, integer};
use anyhit_engine::reflect::value::ScalarContent;

/// A scalar in a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leaf {
    /// A float of any width.
    Float(f64),
    /// An integer, or a bool as 0 or 1.
    Integer(i128),
}

impl Leaf {
    /// The number of a scalar; `None` for a handle.
    #[must_use]
    pub fn of(scalar: ScalarContent) -> Option<Self> {
        match scalar {
            ScalarContent::Float(value) => Some(Self::Float(value.as_f64())),
            scalar => integer(scalar).map(Self::Integer),
        }
    }
}

impl Value {
    /// Visits every scalar in it, with its path from `path` on: `path.normal[2]`.
    #[doc(hidden)]
    pub fn scalars(&self, path: &mut String, visit: &mut dyn FnMut(&str, Leaf)) {
        let length = path.len();
        match &self.content {
            Content::Scalar(scalar) => {
                if let Some(leaf) = Leaf::of(*scalar) {
                    visit(path, leaf);
                }
            }
            Content::List(elements) => {
                for (at, element) in elements.iter().enumerate() {
                    path.push_str(&format!("[{at}]"));
                    element.scalars(path, visit);
                    path.truncate(length);
                }
            }
            Content::Struct(fields) => {
                for (name, field) in fields {
                    if length > 0 {
                        path.push('.');
                    }
                    path.push_str(name);
                    field.scalars(path, visit);
                    path.truncate(length);
                }
            }
            Content::Opaque => {}
        }
    }
}
