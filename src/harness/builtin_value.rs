//! Builtins set by name.

use crate::error::{Error, ErrorKind, Result};
use crate::ops::builtin::{self, Builtin, Shape};
use crate::scene::read::nearest;

/// A Rust value that a builtin can be set to.
pub trait BuiltinValue {
    /// The words in the order of the scalars, matrices column by column.
    fn words(&self) -> Vec<u32>;
    /// What kind of scalars they are.
    fn kind(&self) -> ScalarKind;
}

/// What kind of scalars a builtin is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScalarKind {
    /// `bool`
    Bool,
    /// 32-bit integers of either sign.
    Int,
    /// `f32`
    Float,
}

macro_rules! builtin_values {
    ($($ty:ty, $kind:ident, |$value:ident| $word:expr;)*) => {$(
        impl BuiltinValue for $ty {
            fn words(&self) -> Vec<u32> {
                let $value = *self;
                vec![$word]
            }
            fn kind(&self) -> ScalarKind {
                ScalarKind::$kind
            }
        }
    )*};
}

builtin_values! {
    u32, Int, |value| value;
    i32, Int, |value| value as u32;
    f32, Float, |value| value.to_bits();
    bool, Bool, |value| u32::from(value);
}

/// Vectors, arrays, and matrices as arrays of columns.
impl<T: BuiltinValue, const N: usize> BuiltinValue for [T; N] {
    fn words(&self) -> Vec<u32> {
        self.iter().flat_map(BuiltinValue::words).collect()
    }
    fn kind(&self) -> ScalarKind {
        self.first().map_or(ScalarKind::Int, BuiltinValue::kind)
    }
}

/// The builtin with a name, and the words of a value for it.
///
/// # Errors
/// `InvalidArgument` where there is no such builtin, or it has another type.
pub(super) fn words_of(name: &str, value: &impl BuiltinValue) -> Result<(&'static Builtin, Vec<u32>)> {
    let Some(builtin) = builtin::find_by_name(name) else {
        let near = nearest(name, builtin::BUILTINS.iter().map(|builtin| builtin.name));
        let error = Error::new(ErrorKind::InvalidArgument, format!("there is no builtin `{name}`"));
        return Err(near.map_or(error.clone(), |near| error.note(format!("did you mean `{near}`?"))));
    };
    let kind = match builtin.shape {
        Shape::Bool => ScalarKind::Bool,
        Shape::Int | Shape::Int2 | Shape::Int3 | Shape::Int4 => ScalarKind::Int,
        _ => ScalarKind::Float,
    };
    let count = builtin.shape.words() as usize;
    let words = value.words();
    if value.kind() != kind || words.len() != count {
        let given = format!("{} scalars of kind {:?}", words.len(), value.kind());
        let message = format!("{} is {}, not {given}", builtin.name, builtin.shape.describe());
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    Ok((builtin, words))
}
