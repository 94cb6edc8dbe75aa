//! Values for serde: numbers, lists, and maps by the names of members.

use serde::{Serialize, Serializer};

use crate::value::{Content, Value};
use anyhit_engine::reflect::value::{FloatValue, ScalarContent};

/// A number or truth value; a list for vectors, matrices (their columns) and arrays; a map for
/// structs. Infinities and NaN are the texts `inf`, `-inf` and `NaN`, as JSON has no such numbers,
/// and what has no content is nothing.
impl Serialize for Value {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match &self.content {
            Content::Scalar(ScalarContent::Bool(value)) => to.serialize_bool(*value),
            Content::Scalar(ScalarContent::Int(value)) => to.serialize_i64(*value),
            Content::Scalar(
                ScalarContent::Uint(value) | ScalarContent::Address(value) | ScalarContent::Handle(value),
            ) => to.serialize_u64(*value),
            Content::Scalar(ScalarContent::Float(value)) if !value.as_f64().is_finite() => {
                to.collect_str(value)
            }
            Content::Scalar(ScalarContent::Float(FloatValue::F32(value))) => to.serialize_f32(*value),
            Content::Scalar(ScalarContent::Float(value)) => to.serialize_f64(value.as_f64()),
            Content::List(elements) => to.collect_seq(elements),
            Content::Struct(fields) => to.collect_map(fields.iter().map(|(name, value)| (name, value))),
            Content::Opaque => to.serialize_unit(),
        }
    }
}
