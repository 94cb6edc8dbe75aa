//! Values for serde: numbers, lists, and maps by the names of members.

use serde::{Serialize, Serializer};

use crate::value::{Content, Number, Value};

/// A number or truth value; a list for vectors, matrices (their columns) and arrays; a map for
/// structs. Infinities and NaN are the texts `inf`, `-inf` and `NaN`, as JSON has no such numbers,
/// and what has no content is nothing.
impl Serialize for Value {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match &self.content {
            Content::Scalar(Number::Bool(value)) => to.serialize_bool(*value),
            Content::Scalar(Number::Int(value)) => to.serialize_i64(*value),
            Content::Scalar(Number::Uint(value)) => to.serialize_u64(*value),
            Content::Scalar(Number::Float(value)) if !value.is_finite() => to.collect_str(value),
            Content::Scalar(Number::Float(value)) if self.bytes.len() == 4 => to.serialize_f32(*value as f32),
            Content::Scalar(Number::Float(value)) => to.serialize_f64(*value),
            Content::List(elements) => to.collect_seq(elements),
            Content::Struct(fields) => to.collect_map(fields.iter().map(|(name, value)| (name, value))),
            Content::Opaque => to.serialize_unit(),
        }
    }
}
