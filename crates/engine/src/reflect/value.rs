//! Values with their types, as text and as JSON.

use std::fmt;

use half::f16;
use serde::ser::{Serialize, Serializer};

use crate::machine::DeviceMemory;
use crate::math::float_format::FloatFormat;
use crate::module::Module;
use crate::module::ty::TypeId;
use crate::ops::builtin::{Builtin, ValueShape};
use crate::reflect::{Layout, Rules};

/// The number of elements that text shows of a list.
const MAX_ELEMENTS: usize = 16;

/// A value with its type.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TypedValue {
    /// The type, as GLSL names it.
    #[serde(rename = "type")]
    pub ty: String,
    /// The value without its type.
    #[serde(rename = "value")]
    pub content: ValueContent,
}

/// A value without its type.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub enum ValueContent {
    /// A bool.
    Bool(bool),
    /// A signed integer.
    Int(i64),
    /// An unsigned integer.
    Uint(u64),
    /// A float.
    Float(FloatValue),
    /// A pointer to device memory.
    Address(AddressValue),
    /// The components of a vector, the columns of a matrix, the elements of an array.
    List(Vec<ValueContent>),
    /// A struct.
    Members(Vec<ValueMember>),
    /// What is told in words: a resource, an array too long to be listed.
    Text(String),
}

/// A scalar.
#[derive(Clone, Copy, Debug)]
pub enum ScalarContent {
    /// A bool.
    Bool(bool),
    /// A signed integer.
    Int(i64),
    /// An unsigned integer.
    Uint(u64),
    /// A float.
    Float(FloatValue),
    /// A device address.
    Address(u64),
    /// The handle of a resource, or another pointer.
    Handle(u64),
}

/// A member of a struct.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ValueMember {
    /// Its name, or `member N`.
    pub name: String,
    /// Its value.
    #[serde(flatten)]
    pub value: TypedValue,
}

/// A float of any width, shown with the fewest digits that read back as the same number.
///
/// JSON has neither infinities nor NaN: they are the strings `"inf"`, `"-inf"` and `"NaN"`.
#[derive(Clone, Copy, Debug)]
pub enum FloatValue {
    /// `binary16`
    F16(f16),
    /// `binary32`
    F32(f32),
    /// `binary64`
    F64(f64),
    /// A number of a format of 8 or 16 bits that is not IEEE 754's.
    Small(FloatFormat, f32),
}

/// A device address: `materials + 0x40` where it lies in a buffer with a name, else a number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AddressValue {
    /// The address.
    pub address: u64,
    /// The place in words, where there are some.
    pub place: Option<String>,
}

impl fmt::Display for AddressValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => f.write_str(place),
            None => write!(f, "{:#x}", self.address),
        }
    }
}

impl Serialize for AddressValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl TypedValue {
    /// The value with the names of the buffers that its addresses lie in.
    #[must_use]
    pub fn with_places(mut self, memory: &DeviceMemory) -> Self {
        self.content.find_places(memory);
        self
    }

    /// Reads a value of a module's type from the words of its registers; missing words are 0.
    pub fn of_type(module: &Module, ty: TypeId, words: &[u32]) -> Self {
        let layout = Layout::new(module, ty, Rules::Packed);
        let size = layout.word_count().map_or(0, |count| count as usize);
        let missing = std::iter::repeat_n(0, size.saturating_sub(words.len()));
        let words = words.iter().copied().chain(missing);
        Self::of_bytes(layout, &words.flat_map(u32::to_le_bytes).collect::<Vec<_>>())
    }

    /// Reads a value from its bytes.
    pub fn of_bytes(layout: Layout<'_>, bytes: &[u8]) -> Self {
        Self { ty: type_name(layout.module, layout.ty), content: layout.read(bytes) }
    }

    /// The value of a builtin from its words.
    pub fn of_builtin(builtin: &Builtin, words: &[u32]) -> Self {
        let (ty, content) = match builtin.shape {
            ValueShape::Bool => ("bool", ValueContent::Bool(words.first().is_some_and(|&word| word != 0))),
            ValueShape::Int => ("uint", ValueContent::Uint(words.first().copied().unwrap_or(0).into())),
            ValueShape::Int2 => ("uvec2", uints(words)),
            ValueShape::Int3 => ("uvec3", uints(words)),
            ValueShape::Int4 => ("uvec4", uints(words)),
            ValueShape::Float => {
                ("float", ValueContent::f32(words.first().map_or(0.0, |&word| f32::from_bits(word))))
            }
            ValueShape::Float2 => ("vec2", floats(words)),
            ValueShape::Float3 => ("vec3", floats(words)),
            ValueShape::Matrix4x3 => ("mat4x3", vec3s(words)),
            ValueShape::FloatArray2 => ("float[2]", floats(words)),
            ValueShape::Float3Array2 => ("vec3[2]", vec3s(words)),
            ValueShape::Float3Array3 => ("vec3[3]", vec3s(words)),
        };
        Self { ty: ty.to_owned(), content }
    }

    /// The members that are no structs, each with its path (`hit.t`); the value itself, with an
    /// empty path, if it is no struct.
    pub fn parts(&self) -> Vec<(String, &TypedValue)> {
        let mut parts = Vec::new();
        self.collect_parts(String::new(), &mut parts);
        parts
    }

    fn collect_parts<'a>(&'a self, path: String, parts: &mut Vec<(String, &'a TypedValue)>) {
        let ValueContent::Members(members) = &self.content else {
            parts.push((path, self));
            return;
        };
        for ValueMember { name, value } in members {
            let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            value.collect_parts(path, parts);
        }
    }
}

impl ValueContent {
    fn find_places(&mut self, memory: &DeviceMemory) {
        match self {
            Self::Address(value) => value.place = memory.describe(value.address),
            Self::List(items) => items.iter_mut().for_each(|item| item.find_places(memory)),
            Self::Members(members) => {
                members.iter_mut().for_each(|member| member.value.content.find_places(memory));
            }
            Self::Bool(_) | Self::Int(_) | Self::Uint(_) | Self::Float(_) | Self::Text(_) => {}
        }
    }

    /// Whether a float in it is a NaN.
    pub fn has_nan(&self) -> bool {
        match self {
            Self::Float(value) => value.as_f64().is_nan(),
            Self::List(items) => items.iter().any(Self::has_nan),
            Self::Members(members) => members.iter().any(|member| member.value.content.has_nan()),
            _ => false,
        }
    }

    /// The numbers of a vector of three floats.
    pub fn as_vec3(&self) -> Option<[f64; 3]> {
        let Self::List(items) = self else { return None };
        let number = |item: &Self| match item {
            Self::Float(value) => Some(value.as_f64()),
            _ => None,
        };
        let numbers: Option<Vec<f64>> = items.iter().map(number).collect();
        numbers?.try_into().ok()
    }

    /// A float of 32 bits.
    pub fn f32(value: f32) -> Self {
        Self::Float(FloatValue::F32(value))
    }

    /// A vector of floats of 32 bits.
    pub fn vector<const N: usize>(values: [f32; N]) -> Self {
        Self::List(values.into_iter().map(Self::f32).collect())
    }
}

/// `vec3(0, 0.5, 1)`, `float 0.5`, `Payload { colour: vec3(0, 0, 0) }`.
impl fmt::Display for TypedValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.content {
            ValueContent::List(_) | ValueContent::Members(_) => write!(f, "{}{}", self.ty, self.content),
            _ => write!(f, "{} {}", self.ty, self.content),
        }
    }
}

impl fmt::Display for ValueContent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => write!(f, "{value}"),
            Self::Int(value) => write!(f, "{value}"),
            Self::Uint(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
            Self::Address(value) => write!(f, "{value}"),
            Self::Text(text) => f.write_str(text),
            Self::List(items) => {
                f.write_str("(")?;
                for (at, item) in items.iter().take(MAX_ELEMENTS).enumerate() {
                    write!(f, "{}{item}", if at == 0 { "" } else { ", " })?;
                }
                if items.len() > MAX_ELEMENTS {
                    write!(f, ", ... {} in all", items.len())?;
                }
                f.write_str(")")
            }
            Self::Members(members) => {
                f.write_str(" {")?;
                for (at, ValueMember { name, value }) in members.iter().enumerate() {
                    write!(f, "{} {name}: {value}", if at == 0 { "" } else { "," })?;
                }
                f.write_str(" }")
            }
        }
    }
}

impl FloatValue {
    /// The float of a format with these bits.
    pub fn of_bits(format: FloatFormat, bits: u64) -> Self {
        match format {
            FloatFormat::Binary16 => Self::F16(f16::from_bits(bits as u16)),
            FloatFormat::Binary32 => Self::F32(f32::from_bits(bits as u32)),
            FloatFormat::Binary64 => Self::F64(f64::from_bits(bits)),
            _ => Self::Small(format, format.value(bits) as f32),
        }
    }

    /// The number.
    pub fn as_f64(self) -> f64 {
        match self {
            Self::F16(value) => value.into(),
            Self::F32(value) | Self::Small(_, value) => value.into(),
            Self::F64(value) => value,
        }
    }
}

/// The shortest digits that read back as the same number, with an exponent for very small and very
/// large numbers.
impl fmt::Display for FloatValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plain = |size: f64| size == 0.0 || !size.is_finite() || (1e-4..1e9).contains(&size);
        match *self {
            Self::F16(value) => write!(f, "{value}"),
            Self::F32(value) if plain(value.abs().into()) => write!(f, "{value}"),
            Self::F32(value) => write!(f, "{value:e}"),
            Self::F64(value) if plain(value.abs()) => write!(f, "{value}"),
            Self::F64(value) => write!(f, "{value:e}"),
            Self::Small(format, value) => f.write_str(&shortest(format, value)),
        }
    }
}

/// Compares bit for bit, so that NaN equals itself and 0 differs from -0.
impl PartialEq for FloatValue {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::F16(a), Self::F16(b)) => a.to_bits() == b.to_bits(),
            (Self::F32(a), Self::F32(b)) => a.to_bits() == b.to_bits(),
            (Self::F64(a), Self::F64(b)) => a.to_bits() == b.to_bits(),
            (Self::Small(a, x), Self::Small(b, y)) => a == b && x.to_bits() == y.to_bits(),
            _ => false,
        }
    }
}

impl Serialize for FloatValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let finite = match self {
            Self::F16(value) => value.is_finite(),
            Self::F32(value) => value.is_finite(),
            Self::F64(value) => value.is_finite(),
            Self::Small(_, value) => value.is_finite(),
        };
        match *self {
            _ if !finite => serializer.serialize_str(&self.to_string()),
            Self::F16(value) => serializer.serialize_f32(value.to_f32()),
            Self::F32(value) => serializer.serialize_f32(value),
            Self::F64(value) => serializer.serialize_f64(value),
            Self::Small(_, value) => serializer.serialize_f32(value),
        }
    }
}

/// The shortest digits that a format reads back as the same number.
fn shortest(format: FloatFormat, value: f32) -> String {
    let reads_back =
        |near: &f32| format.value(format.round((*near).into())).to_bits() == f64::from(value).to_bits();
    let shorter = (0..9).filter_map(|digits| format!("{value:.digits$e}").parse::<f32>().ok());
    let near = shorter.filter(|_| value.is_finite()).find(reads_back).unwrap_or(value);
    FloatValue::F32(near).to_string()
}

/// The name of a type, for a struct without the word `struct`.
pub fn type_name(module: &Module, ty: TypeId) -> String {
    let described = module.describe_type(ty);
    described.strip_prefix("struct ").map_or_else(|| described.clone(), str::to_owned)
}

fn uints(words: &[u32]) -> ValueContent {
    ValueContent::List(words.iter().map(|&word| ValueContent::Uint(word.into())).collect())
}

fn floats(words: &[u32]) -> ValueContent {
    ValueContent::List(words.iter().map(|&word| ValueContent::f32(f32::from_bits(word))).collect())
}

/// A list of vectors of three components.
fn vec3s(words: &[u32]) -> ValueContent {
    ValueContent::List(words.chunks(3).map(floats).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_told_by_the_buffer_it_lies_in() {
        let mut memory = DeviceMemory::default();
        memory.add_buffer_at(0x2_0000_0000, &crate::machine::Buffer::zeroed(64), Some("materials")).unwrap();
        let text = |address| {
            let content = ValueContent::Address(AddressValue { address, place: None });
            let members =
                vec![ValueMember { name: "m".into(), value: TypedValue { ty: "p".into(), content } }];
            let value = TypedValue { ty: "S".into(), content: ValueContent::Members(members) };
            value.with_places(&memory).to_string()
        };
        assert_eq!(text(0x2_0000_0010), "S { m: p materials + 0x10 }");
        assert_eq!(text(0x2_0000_0041), "S { m: p 0x200000041 }");
    }

    fn text(value: f32) -> String {
        FloatValue::F32(value).to_string()
    }

    #[test]
    fn floats_are_short_and_read_back() {
        assert_eq!(text(0.1), "0.1");
        assert_eq!(text(0.0), "0");
        assert_eq!(text(-0.0), "-0");
        assert_eq!(text(10000.0), "10000");
        assert_eq!(text(1e-7), "1e-7");
        assert_eq!(text(f32::INFINITY), "inf");
        assert_eq!(text(f32::NAN), "NaN");
        assert_eq!(text(16_777_217.5), "16777218");
        for value in [1.0 / 3.0, f32::MIN_POSITIVE, f32::MAX, 123_456_790.0] {
            assert_eq!(text(value).parse(), Ok(value));
        }
    }

    #[test]
    fn floats_of_few_bits_are_shown_with_few_digits() {
        let bfloat = |bits: u64| {
            let format = FloatFormat::BFloat16;
            FloatValue::Small(format, format.value(bits) as f32).to_string()
        };
        // 0x3DCD is 0.10009765625, the bfloat16 nearest to 0.1.
        assert_eq!(bfloat(0x3DCD), "0.1");
        assert_eq!(bfloat(0x8000), "-0");
        assert_eq!([0x7F80, 0x7FC0].map(bfloat), ["inf", "NaN"]);
        for bits in (0..0x7F80).chain(0x8000..0xFF80) {
            let shown: f64 = bfloat(bits).parse().unwrap();
            assert_eq!(FloatFormat::BFloat16.round(shown), bits);
        }
    }

    #[test]
    fn json_has_numbers_where_it_can() {
        let json = |value| serde_json::to_string(&ValueContent::vector([value, 0.1])).unwrap();
        assert_eq!(json(0.25), "[0.25,0.1]");
        assert_eq!(json(f32::NEG_INFINITY), "[\"-inf\",0.1]");
        assert_eq!(json(f32::NAN), "[\"NaN\",0.1]");
    }

    #[test]
    fn structs_are_shown_by_member_and_taken_apart_by_path() {
        let scalar = |name: &str, value: u64| ValueMember {
            name: name.into(),
            value: TypedValue { ty: "uint".into(), content: ValueContent::Uint(value) },
        };
        let inner = TypedValue { ty: "Hit".into(), content: ValueContent::Members(vec![scalar("t", 7)]) };
        let outer = TypedValue {
            ty: "Payload".into(),
            content: ValueContent::Members(vec![
                scalar("seen", 1),
                ValueMember { name: "hit".into(), value: inner },
            ]),
        };
        assert_eq!(outer.to_string(), "Payload { seen: uint 1, hit: Hit { t: uint 7 } }");
        let paths: Vec<String> = outer.parts().into_iter().map(|(path, _)| path).collect();
        assert_eq!(paths, ["seen", "hit.t"]);
        assert_eq!(
            serde_json::to_string(&outer).unwrap(),
            r#"{"type":"Payload","value":[{"name":"seen","type":"uint","value":1},{"name":"hit","type":"Hit","value":[{"name":"t","type":"uint","value":7}]}]}"#
        );
    }

    #[test]
    fn builtins_have_their_shapes() {
        let builtin = crate::ops::builtin::find_by_name("HitLSSPositionsNV").unwrap();
        let words = [0.0f32, 1.0, 2.0, 3.0, 4.0, 5.5].map(f32::to_bits);
        assert_eq!(TypedValue::of_builtin(builtin, &words).to_string(), "vec3[2]((0, 1, 2), (3, 4, 5.5))");
    }
}
