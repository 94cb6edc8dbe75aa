//! The scalars in a value, one after the other with their paths.

use super::{Content, Number, Value};

/// A scalar in a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leaf {
    /// A float of any width.
    Float(f64),
    /// An integer, or a bool as 0 or 1.
    Integer(i128),
}

impl Value {
    /// Visits every scalar in it, with its path from `path` on: `path.normal[2]`.
    #[doc(hidden)]
    pub fn scalars(&self, path: &mut String, visit: &mut dyn FnMut(&str, Leaf)) {
        let length = path.len();
        match &self.content {
            Content::Scalar(Number::Float(number)) => visit(path, Leaf::Float(*number)),
            Content::Scalar(Number::Bool(flag)) => visit(path, Leaf::Integer(i128::from(*flag))),
            Content::Scalar(Number::Int(number)) => visit(path, Leaf::Integer((*number).into())),
            Content::Scalar(Number::Uint(number)) => visit(path, Leaf::Integer((*number).into())),
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
