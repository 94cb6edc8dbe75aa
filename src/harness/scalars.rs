//! Rust values that builtins, and members of payloads, can be set to.

use crate::error::names::nearest;
use crate::error::{Error, ErrorKind, Result};
use crate::harness::layout::Layout;
use crate::math::float_format::FloatFormat;
use crate::module::ty::Type;
use crate::ops::builtin::{self, Builtin, ValueShape};

/// A Rust value made of scalars: `bool`, `u32`, `i32`, `f32`, `u64`, `i64`, `f64`, and arrays of
/// them (vectors; matrices as arrays of columns).
pub trait Scalars {
    /// Its scalars in order, matrices column by column.
    fn scalars(&self) -> Vec<ScalarValue>;
}

/// One scalar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ScalarValue {
    /// `bool`
    Bool(bool),
    /// A signed integer.
    Int(i64),
    /// An unsigned integer.
    Uint(u64),
    /// `f32`
    Float(f32),
    /// `f64`
    Double(f64),
}

impl ScalarValue {
    fn kind(self) -> &'static str {
        match self {
            Self::Bool(_) => "bool",
            Self::Int(_) | Self::Uint(_) => "integer",
            Self::Float(_) | Self::Double(_) => "float",
        }
    }

    /// Its bits as a float of a format; `None` for another kind of scalar.
    fn as_float(self, format: FloatFormat) -> Option<u64> {
        match self {
            // The bits of a NaN stay.
            Self::Float(value) if format == FloatFormat::Binary32 => Some(value.to_bits().into()),
            Self::Float(value) => Some(format.round(value.into())),
            Self::Double(value) => Some(format.round(value)),
            _ => None,
        }
    }

    /// Its bits as an integer of a width and either sign; `None` where it does not fit.
    fn as_integer(self, width: u32) -> Option<u64> {
        let value = match self {
            Self::Int(value) => i128::from(value),
            Self::Uint(value) => i128::from(value),
            _ => return None,
        };
        let most = (1i128 << width) - 1;
        let least = -(1i128 << (width - 1));
        (least..=most).contains(&value).then_some(value as u64 & most as u64)
    }
}

macro_rules! scalars {
    ($($ty:ty => $variant:ident;)*) => {$(
        impl Scalars for $ty {
            fn scalars(&self) -> Vec<ScalarValue> {
                vec![ScalarValue::$variant((*self).into())]
            }
        }
    )*};
}

scalars! {
    bool => Bool;
    u32 => Uint;
    i32 => Int;
    u64 => Uint;
    i64 => Int;
    f32 => Float;
    f64 => Double;
}

/// Vectors, arrays, and matrices as arrays of columns.
impl<T: Scalars, const N: usize> Scalars for [T; N] {
    fn scalars(&self) -> Vec<ScalarValue> {
        self.iter().flat_map(Scalars::scalars).collect()
    }
}

impl Scalars for &[ScalarValue] {
    fn scalars(&self) -> Vec<ScalarValue> {
        self.to_vec()
    }
}

/// The builtin with a name, and the words of a value for it.
///
/// # Errors
/// `InvalidArgument` where there is no such builtin, or it has another type.
pub(super) fn builtin_words(name: &str, value: &impl Scalars) -> Result<(&'static Builtin, Vec<u32>)> {
    let Some(builtin) = builtin::find_by_name(name) else {
        let near = nearest(name, builtin::BUILTINS.iter().map(|builtin| builtin.name));
        let error = invalid(format!("there is no builtin `{name}`"));
        return Err(near.map_or(error.clone(), |near| error.note(format!("did you mean `{near}`?"))));
    };
    let kind = match builtin.shape {
        ValueShape::Bool => "bool",
        ValueShape::Int | ValueShape::Int2 | ValueShape::Int3 | ValueShape::Int4 => "integer",
        _ => "float",
    };
    let count = builtin.shape.words() as usize;
    let scalars = value.scalars();
    let word = |scalar: &ScalarValue| match (*scalar, kind) {
        (ScalarValue::Bool(value), "bool") => Some(u32::from(value)),
        (scalar, "integer") => scalar.as_integer(32).map(|bits| bits as u32),
        (scalar, "float") => scalar.as_float(FloatFormat::Binary32).map(|bits| bits as u32),
        _ => None,
    };
    let words: Option<Vec<u32>> = scalars.iter().map(word).collect();
    words.filter(|words| words.len() == count).map(|words| (builtin, words)).ok_or_else(|| {
        let given = describe(&scalars);
        invalid(format!("{} is {}, not {given}", builtin.name, builtin.shape.describe()))
    })
}

/// Writes scalars over the bytes of a value with a layout.
///
/// # Errors
/// `InvalidArgument` where number or kinds of the scalars are not the layout's.
pub(super) fn write(layout: Layout<'_>, bytes: &mut [u8], what: &str, value: &impl Scalars) -> Result<()> {
    let scalars = value.scalars();
    let places = layout.scalars();
    let wrong = || {
        let ty = layout.module.describe_type(layout.ty);
        invalid(format!("{what} is {ty}, not {}", describe(&scalars)))
    };
    if places.len() != scalars.len() {
        return Err(wrong());
    }
    for (scalar, (offset, part)) in scalars.iter().zip(places) {
        let bits = match (layout.module.ty(part.ty), *scalar) {
            (Type::Bool, ScalarValue::Bool(value)) => Some(u64::from(value)),
            (Type::Pointer { .. }, ScalarValue::Uint(address)) => Some(address),
            (Type::Int { width, .. }, scalar) => scalar.as_integer(*width),
            (ty @ Type::Float { .. }, scalar) => ty.float_format().and_then(|format| scalar.as_float(format)),
            _ => None,
        };
        let bits = bits.ok_or_else(wrong)?.to_le_bytes();
        let size = part.size();
        if let Some(place) = bytes.get_mut(offset..offset + size) {
            place.copy_from_slice(&bits[..size]);
        }
    }
    Ok(())
}

fn describe(scalars: &[ScalarValue]) -> String {
    let kind = scalars.first().map_or("nothing", |scalar| scalar.kind());
    match scalars {
        [only] => format!("the {kind} {}", shown(*only)),
        _ => format!("{} scalars of kind {kind}", scalars.len()),
    }
}

fn shown(scalar: ScalarValue) -> String {
    match scalar {
        ScalarValue::Bool(value) => value.to_string(),
        ScalarValue::Int(value) => value.to_string(),
        ScalarValue::Uint(value) => value.to_string(),
        ScalarValue::Float(value) => format!("{value:?}"),
        ScalarValue::Double(value) => format!("{value:?}"),
    }
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
