//! A shader's value, read by the names that the module keeps.

pub mod leaves;
mod serialize;

use std::fmt;
use std::ops::Index;
use std::sync::Arc;

use bytemuck::AnyBitPattern;

use crate::explain::{Explain, Explanation};
use crate::number::NumberType;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::math::float_format::FloatFormat;
use anyhit_engine::module::ty::{Member, Type};
use anyhit_engine::reflect::value::{FloatValue, ScalarContent};
use anyhit_engine::reflect::{FromParts, Layout};

/// A value that a shader left: a payload, a buffer, a member or an element of one.
///
/// `value["normal"]` and `value[3]` go into structs, arrays, matrices (their columns) and vectors;
/// [`Value::f32`], [`Value::vec3`] and their kin read what is there, and panic with both types
/// where it is something else: they are made for tests.
#[derive(Clone)]
#[must_use]
pub struct Value {
    ty: String,
    bytes: Vec<u8>,
    content: Content,
    /// Where it comes from, for failed assertions.
    explanation: Option<Arc<Explanation>>,
}

/// Values are equal where their type is, and every part prints alike: padding does not count, every
/// NaN is equal to every other, and -0.0 is not 0.0.
impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        (&self.ty, &self.content) == (&other.ty, &other.content)
    }
}

#[derive(Clone, Debug)]
enum Content {
    Scalar(ScalarContent),
    List(Vec<Value>),
    Struct(Vec<(String, Value)>),
    Opaque,
}

impl PartialEq for Content {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Scalar(ScalarContent::Float(one)), Self::Scalar(ScalarContent::Float(two))) => {
                one == two || one.as_f64().is_nan() && two.as_f64().is_nan()
            }
            (Self::Scalar(one), Self::Scalar(two)) => integer(*one) == integer(*two),
            (Self::List(one), Self::List(two)) => one == two,
            (Self::Struct(one), Self::Struct(two)) => one == two,
            (Self::Opaque, Self::Opaque) => true,
            _ => false,
        }
    }
}

/// The number of a scalar that is no float.
fn integer(scalar: ScalarContent) -> Option<i128> {
    match scalar {
        ScalarContent::Bool(value) => Some(value.into()),
        ScalarContent::Int(value) => Some(value.into()),
        ScalarContent::Uint(value) | ScalarContent::Address(value) => Some(value.into()),
        ScalarContent::Float(_) | ScalarContent::Handle(_) => None,
    }
}

impl FromParts for Value {
    fn scalar(layout: Layout<'_>, bytes: &[u8], scalar: ScalarContent) -> Self {
        match scalar {
            ScalarContent::Handle(_) => Self::opaque(layout),
            scalar => Self::new(layout, bytes, Content::Scalar(scalar)),
        }
    }

    fn list(layout: Layout<'_>, bytes: &[u8], parts: Vec<Self>) -> Self {
        Self::new(layout, bytes, Content::List(parts))
    }

    fn structure(layout: Layout<'_>, bytes: &[u8], members: Vec<Self>) -> Self {
        let names: &[Member] = match layout.module.ty(layout.ty) {
            Type::Struct { members, .. } => members,
            _ => &[],
        };
        let named = names.iter().zip(members).enumerate().map(|(index, (member, value))| {
            let name = match member.name.as_str() {
                "" => format!("_{index}"),
                name => name.to_owned(),
            };
            (name, value)
        });
        Self::new(layout, bytes, Content::Struct(named.collect()))
    }

    fn opaque(layout: Layout<'_>) -> Self {
        Self::new(layout, &[], Content::Opaque)
    }
}

impl Value {
    fn new(layout: Layout<'_>, bytes: &[u8], content: Content) -> Self {
        let ty = layout.module.describe_type(layout.ty);
        Self { ty, bytes: bytes.to_vec(), content, explanation: None }
    }

    /// A value of no type: what a shader without a payload leaves.
    #[doc(hidden)]
    pub fn nothing() -> Self {
        Self { ty: "nothing".into(), bytes: Vec::new(), content: Content::Opaque, explanation: None }
    }

    /// Gives the value and its parts the explanation of the run that made them.
    pub(super) fn explained_by(&mut self, explanation: &Arc<Explanation>) {
        self.explanation = Some(explanation.clone());
        match &mut self.content {
            Content::List(elements) => {
                elements.iter_mut().for_each(|element| element.explained_by(explanation))
            }
            Content::Struct(fields) => {
                fields.iter_mut().for_each(|(_, value)| value.explained_by(explanation))
            }
            Content::Scalar(_) | Content::Opaque => {}
        }
    }

    /// Every scalar in it that is a number, with its bytes' kind: `f32`, `u16`, ...
    pub(super) fn numbers(&self) -> Vec<(NumberType, u64)> {
        match &self.content {
            Content::Scalar(scalar) => {
                let kind = match (*scalar, self.bytes.len()) {
                    (ScalarContent::Float(FloatValue::F64(_)), _) => NumberType::F64,
                    (ScalarContent::Float(FloatValue::F32(_)), _) => NumberType::F32,
                    (ScalarContent::Float(FloatValue::F16(_)), _) => NumberType::F16,
                    (ScalarContent::Float(FloatValue::Small(format, _)), _) => match format {
                        FloatFormat::BFloat16 => NumberType::Bf16,
                        FloatFormat::E4M3 => NumberType::E4m3,
                        FloatFormat::E5M2 => NumberType::E5m2,
                        _ => NumberType::F16,
                    },
                    (ScalarContent::Int(_), 1) => NumberType::I8,
                    (ScalarContent::Int(_), 2) => NumberType::I16,
                    (ScalarContent::Int(_), 8) => NumberType::I64,
                    (ScalarContent::Int(_), _) => NumberType::I32,
                    (_, 1) => NumberType::U8,
                    (_, 2) => NumberType::U16,
                    (_, 8) => NumberType::U64,
                    _ => NumberType::U32,
                };
                vec![(kind, bits_of(&self.bytes))]
            }
            Content::List(elements) => elements.iter().flat_map(Self::numbers).collect(),
            Content::Struct(fields) => fields.iter().flat_map(|(_, value)| value.numbers()).collect(),
            Content::Opaque => Vec::new(),
        }
    }

    /// Its type in GLSL's words.
    #[must_use]
    pub fn ty(&self) -> &str {
        &self.ty
    }

    /// Its bytes, little-endian, laid out as the module says.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The value as a plain Rust type of the same size; or, where its scalars lie apart, of the
    /// size that they have without gaps: a `mat3` is `[[f32; 3]; 3]`, whatever its stride.
    ///
    /// # Errors
    /// `InvalidArgument` where the sizes differ; it shows both types.
    pub fn read<T: AnyBitPattern>(&self) -> Result<T> {
        if let Ok(value) = bytemuck::try_pod_read_unaligned(&self.bytes) {
            return Ok(value);
        }
        let mut packed = Vec::new();
        self.pack(&mut packed);
        bytemuck::try_pod_read_unaligned(&packed).map_err(|_| self.mismatch::<T>("one"))
    }

    /// Appends its scalars without gaps.
    fn pack(&self, packed: &mut Vec<u8>) {
        match &self.content {
            Content::Scalar(_) | Content::Opaque => packed.extend_from_slice(&self.bytes),
            Content::List(elements) => elements.iter().for_each(|element| element.pack(packed)),
            Content::Struct(fields) => fields.iter().for_each(|(_, value)| value.pack(packed)),
        }
    }

    /// The value as a row of a plain Rust type that fills it.
    ///
    /// # Errors
    /// `InvalidArgument` where the size is no multiple.
    pub fn read_all<T: AnyBitPattern>(&self) -> Result<Vec<T>> {
        let size = size_of::<T>();
        if size == 0 || !self.bytes.len().is_multiple_of(size) {
            return Err(self.mismatch::<T>("a row"));
        }
        Ok(self.bytes.chunks_exact(size).map(bytemuck::pod_read_unaligned).collect())
    }

    fn mismatch<T>(&self, what: &str) -> Error {
        let (name, size) = (std::any::type_name::<T>(), size_of::<T>());
        let message = format!(
            "{what} of `{name}`, of {size} bytes, does not match the {} of {}",
            self.ty,
            self.bytes.len()
        );
        let error = Error::new(ErrorKind::InvalidArgument, message);
        error.note(format!("{name} in Rust: {size} bytes")).note(format!("in the shader: {self:?}"))
    }

    /// A member of a struct by name; of a vector also `x`, `y`, `z` and `w`.
    #[must_use]
    pub fn field(&self, name: &str) -> Option<&Self> {
        match &self.content {
            Content::List(elements) if elements.iter().all(|element| element.as_scalar().is_some()) => {
                elements.get(["x", "y", "z", "w"].iter().position(|known| *known == name)?)
            }
            Content::Struct(fields) => fields.iter().find(|(known, _)| known == name).map(|(_, value)| value),
            _ => None,
        }
    }

    /// The members of a struct with their names; empty for anything else.
    #[must_use]
    pub fn fields(&self) -> impl Iterator<Item = (&str, &Self)> {
        let fields = match &self.content {
            Content::Struct(fields) => &fields[..],
            _ => &[],
        };
        fields.iter().map(|(name, value)| (name.as_str(), value))
    }

    /// The elements of an array, the columns of a matrix, the components of a vector; empty for
    /// anything else.
    #[must_use]
    pub fn elements(&self) -> &[Self] {
        match &self.content {
            Content::List(elements) => elements,
            _ => &[],
        }
    }

    fn as_scalar(&self) -> Option<ScalarContent> {
        match &self.content {
            Content::Scalar(scalar) => Some(*scalar),
            // A block of one member is used like the member.
            Content::Struct(fields) if fields.len() == 1 => fields[0].1.as_scalar(),
            _ => None,
        }
    }

    #[track_caller]
    fn is_not(&self, wanted: &str) -> ! {
        panic!("this is not {wanted} but {self:?}")
    }

    /// A `float` (a `float16_t` too).
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn f32(&self) -> f32 {
        match self.as_scalar() {
            Some(ScalarContent::Float(FloatValue::F64(_))) | None => self.is_not("a float"),
            Some(ScalarContent::Float(value)) => value.as_f64() as f32,
            Some(_) => self.is_not("a float"),
        }
    }

    /// A float of any width.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn f64(&self) -> f64 {
        match self.as_scalar() {
            Some(ScalarContent::Float(value)) => value.as_f64(),
            _ => self.is_not("a float"),
        }
    }

    /// An unsigned integer of up to 32 bits.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn u32(&self) -> u32 {
        match self.as_scalar() {
            Some(ScalarContent::Uint(value) | ScalarContent::Address(value)) => {
                u32::try_from(value).unwrap_or_else(|_| self.is_not("a uint"))
            }
            _ => self.is_not("a uint"),
        }
    }

    /// A signed integer of up to 32 bits.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn i32(&self) -> i32 {
        match self.as_scalar() {
            Some(ScalarContent::Int(value)) => i32::try_from(value).unwrap_or_else(|_| self.is_not("an int")),
            _ => self.is_not("an int"),
        }
    }

    /// An integer of any width and sign.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn integer(&self) -> i128 {
        match self.as_scalar() {
            Some(scalar) if !matches!(scalar, ScalarContent::Bool(_)) => integer(scalar),
            _ => None,
        }
        .unwrap_or_else(|| self.is_not("an integer"))
    }

    /// A `bool`.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn bool(&self) -> bool {
        match self.as_scalar() {
            Some(ScalarContent::Bool(value)) => value,
            _ => self.is_not("a bool"),
        }
    }

    #[track_caller]
    fn exactly<const N: usize, T>(&self, wanted: &str, read: impl Fn(&Self) -> T) -> [T; N] {
        let elements = match &self.content {
            Content::Struct(fields) if fields.len() == 1 => fields[0].1.elements(),
            _ => self.elements(),
        };
        let Ok(elements) = <&[Self; N]>::try_from(elements) else { self.is_not(wanted) };
        elements.each_ref().map(read)
    }

    /// A `vec2`.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn vec2(&self) -> [f32; 2] {
        self.exactly("a vec2", Self::f32)
    }

    /// A `vec3`.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn vec3(&self) -> [f32; 3] {
        self.exactly("a vec3", Self::f32)
    }

    /// A `vec4`.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn vec4(&self) -> [f32; 4] {
        self.exactly("a vec4", Self::f32)
    }

    /// A vector of N unsigned integers.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn uvec<const N: usize>(&self) -> [u32; N] {
        self.exactly("a vector of so many uint", Self::u32)
    }

    /// A vector of N signed integers.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn ivec<const N: usize>(&self) -> [i32; N] {
        self.exactly("a vector of so many int", Self::i32)
    }

    /// A matrix of `C` columns with `R` rows.
    ///
    /// # Panics
    /// Where it is something else.
    #[track_caller]
    #[must_use]
    pub fn matrix<const C: usize, const R: usize>(&self) -> [[f32; R]; C] {
        self.exactly("a matrix of this shape", |column| column.exactly("a column of this size", Self::f32))
    }
}

/// At most eight little-endian bytes.
pub(super) fn bits_of(bytes: &[u8]) -> u64 {
    let mut word = [0; 8];
    let count = bytes.len().min(8);
    word[..count].copy_from_slice(&bytes[..count]);
    u64::from_le_bytes(word)
}

impl Index<&str> for Value {
    type Output = Value;

    /// # Panics
    /// Where there is no such member; it lists those that there are.
    #[track_caller]
    fn index(&self, name: &str) -> &Value {
        self.field(name).unwrap_or_else(|| panic!("no member `{name}` in {self:?}"))
    }
}

impl Index<usize> for Value {
    type Output = Value;

    /// # Panics
    /// Where there is no such element.
    #[track_caller]
    fn index(&self, index: usize) -> &Value {
        self.elements().get(index).unwrap_or_else(|| panic!("no element {index} in {self:?}"))
    }
}

/// What the ray or the shader did that left it; nothing for a value of a buffer.
impl Explain for Value {
    fn explain(&self) -> String {
        self.explanation.as_ref().map_or_else(String::new, |explanation| explanation.text())
    }
}

/// Type and content, a line for each member of a struct.
impl fmt::Debug for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.content {
            Content::Scalar(ScalarContent::Bool(value)) => write!(f, "{value}"),
            Content::Scalar(ScalarContent::Int(value)) => write!(f, "{value}"),
            Content::Scalar(
                ScalarContent::Uint(value) | ScalarContent::Address(value) | ScalarContent::Handle(value),
            ) => {
                write!(f, "{value}u")
            }
            Content::Scalar(ScalarContent::Float(FloatValue::F64(value))) => write!(f, "{value:?}"),
            Content::Scalar(ScalarContent::Float(value)) => write!(f, "{:?}", value.as_f64() as f32),
            Content::List(elements) => {
                write!(f, "{} ", self.ty)?;
                f.debug_list().entries(elements.iter().take(64)).finish()
            }
            Content::Struct(fields) => {
                let mut out = f.debug_struct(&self.ty);
                for (name, value) in fields {
                    out.field(name, value);
                }
                out.finish()
            }
            Content::Opaque => f.write_str(&self.ty),
        }
    }
}
