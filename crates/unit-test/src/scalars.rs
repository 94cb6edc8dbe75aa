//! Rust values that builtins, and members of payloads, records and buffers, can be set to.

use anyhit_base::error::names::nearest;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::module::Module;
use anyhit_engine::module::scalar_value::ScalarValue;
use anyhit_engine::module::ty::Type;
use anyhit_engine::ops::builtin::{self, Builtin, ValueShape};
use anyhit_engine::reflect::Layout;

/// Scalars in the nesting of arrays: a vector is a list of its components, a matrix a list of its
/// columns.
#[derive(Clone, Debug, PartialEq)]
pub enum NestedScalars {
    /// One scalar.
    One(ScalarValue),
    /// An array, a slice or a vector.
    Many(Vec<NestedScalars>),
}

/// A Rust value made of scalars: `bool`, integers and floats of every width, and arrays, slices and
/// `Vec`s of them. Vectors are arrays of their components, matrices are arrays of columns.
///
/// docs/testing.md, "Value conversions", has the table of the values that they become.
pub trait Scalars {
    /// Its scalars in their nesting.
    fn nested(&self) -> NestedScalars;
}

macro_rules! scalars {
    ($($ty:ty),*) => {$(
        impl Scalars for $ty {
            fn nested(&self) -> NestedScalars {
                NestedScalars::One((*self).into())
            }
        }
    )*};
}

scalars!(bool, u8, u16, u32, u64, usize, i8, i16, i32, i64, half::f16, half::bf16, f32, f64, ScalarValue);

/// Vectors, arrays, and matrices as arrays of columns.
impl<T: Scalars, const N: usize> Scalars for [T; N] {
    fn nested(&self) -> NestedScalars {
        self[..].nested()
    }
}

impl<T: Scalars> Scalars for [T] {
    fn nested(&self) -> NestedScalars {
        NestedScalars::Many(self.iter().map(Scalars::nested).collect())
    }
}

impl<T: Scalars> Scalars for Vec<T> {
    fn nested(&self) -> NestedScalars {
        self[..].nested()
    }
}

impl<T: Scalars + ?Sized> Scalars for &T {
    fn nested(&self) -> NestedScalars {
        (**self).nested()
    }
}

impl Scalars for NestedScalars {
    fn nested(&self) -> NestedScalars {
        self.clone()
    }
}

impl NestedScalars {
    fn has_negative(&self) -> bool {
        match self {
            Self::One(ScalarValue::Int(value)) => *value < 0,
            Self::One(ScalarValue::Whole(value)) => *value < 0,
            Self::One(_) => false,
            Self::Many(list) => list.iter().any(Self::has_negative),
        }
    }

    /// The type as Rust writes it, by the first element of each list: `[[float; 2]; 3]`.
    fn describe(&self) -> String {
        match self {
            Self::One(scalar) => scalar.kind().to_owned(),
            Self::Many(list) => {
                let element = list.first().map_or_else(|| "nothing".to_owned(), Self::describe);
                format!("[{element}; {}]", list.len())
            }
        }
    }
}

/// A scalar of a shader's value that is set: its place in bytes, its bits and their size.
type Placed = (usize, u64, usize);

/// Lays scalars out as a value of a shader.
struct Placement<'a> {
    /// What is set, for errors.
    what: &'a str,
    placed: Vec<Placed>,
}

impl Placement<'_> {
    /// Adds the scalars of a part that begins at an offset.
    fn add(&mut self, layout: Layout<'_>, offset: usize, value: &NestedScalars, path: &str) -> Result<()> {
        let module = layout.module;
        match (module.ty(layout.ty), value) {
            (Type::Struct { members, .. }, _) => match &members[..] {
                // A block of one member is used like the member.
                [_] => {
                    let (at, member) = layout.member(0);
                    self.add(member, offset + at, value, path)
                }
                _ => Err(self.is_struct(layout, path)),
            },
            (Type::RuntimeArray { element, .. }, NestedScalars::Many(list)) => {
                let part = Layout { ty: *element, ..layout };
                list.iter().enumerate().try_for_each(|(index, one)| {
                    self.add(part, offset + index * layout.stride(), one, &format!("{path}[{index}]"))
                })
            }
            (
                Type::Bool | Type::Int { .. } | Type::Float { .. } | Type::Pointer { .. },
                NestedScalars::One(scalar),
            ) => {
                // Compilers store the bools of a buffer as 32-bit integers.
                let bits = match (*scalar, module.ty(layout.ty)) {
                    (ScalarValue::Bool(value), Type::Int { width: 32, .. }) if layout.explicit() => {
                        Ok(value.into())
                    }
                    (scalar, ty) => scalar.bits(ty),
                };
                let bits = bits.map_err(|why| invalid(format!("{}{path}: {why}", self.what)))?;
                self.placed.push((offset, bits, layout.size()));
                Ok(())
            }
            (_, NestedScalars::Many(list)) if list.len() == layout.parts().len() && !list.is_empty() => {
                layout.parts().into_iter().zip(list).enumerate().try_for_each(|(index, ((at, part), one))| {
                    self.add(part, offset + at, one, &format!("{path}[{index}]"))
                })
            }
            _ => {
                let (ty, wanted) = (module.describe_type(layout.ty), rust_type(layout));
                let message = format!("{}{path} is {ty}, which requires {wanted}", self.what);
                Err(invalid(format!("{message}, not {}", value.describe())))
            }
        }
    }

    fn is_struct(&self, layout: Layout<'_>, path: &str) -> Error {
        let name = layout.module.describe_type(layout.ty);
        let message = format!("{}{path} is the struct {name}: set its members by their paths", self.what);
        invalid(message)
    }
}

/// The type of a value as nested arrays of Rust: `[[float; 3]; 2]`.
fn rust_type(layout: Layout<'_>) -> String {
    match layout.module.ty(layout.ty) {
        Type::Bool => "bool".to_owned(),
        Type::Int { .. } | Type::Pointer { .. } => "integer".to_owned(),
        Type::Float { .. } => "float".to_owned(),
        Type::RuntimeArray { element, .. } => {
            format!("[{}; _]", rust_type(Layout { ty: *element, ..layout }))
        }
        _ => match layout.parts()[..] {
            [] => "nothing".to_owned(),
            ref parts @ [(_, first), ..] => format!("[{}; {}]", rust_type(first), parts.len()),
        },
    }
}

/// The builtin with a name, and the words of a value for it.
///
/// # Errors
/// `InvalidArgument` where there is no such builtin, or it has another type: that of the module's
/// variable, where it has one.
pub(super) fn builtin_words(
    module: &Module,
    name: &str,
    value: &NestedScalars,
) -> Result<(&'static Builtin, Vec<u32>)> {
    let Some(builtin) = builtin::find_by_name(name) else {
        let near = nearest(name, builtin::BUILTINS.iter().map(|builtin| builtin.name));
        let error = invalid(format!("unknown builtin `{name}`"));
        return Err(near.map_or(error.clone(), |near| error.note(format!("did you mean `{near}`?"))));
    };
    let scalar = match builtin.shape {
        ValueShape::Bool => Type::Bool,
        ValueShape::Int | ValueShape::Int2 | ValueShape::Int3 | ValueShape::Int4 => {
            Type::Int { width: 32, signed: is_signed(module, builtin, value) }
        }
        _ => Type::Float { width: 32, encoding: None },
    };
    let mut words = Vec::new();
    match of_shape(value, builtin.shape.lengths(), &scalar, &mut words) {
        Ok(true) => Ok((builtin, words)),
        Ok(false) => {
            let (name, shape) = (builtin.name, builtin.shape.describe());
            Err(invalid(format!("{name} is {shape}, not {}", value.describe())))
        }
        Err(why) => Err(invalid(format!("{}: {why}", builtin.name))),
    }
}

/// Whether a module declares a builtin as a signed integer. Where it does not declare it, either
/// sign is right.
fn is_signed(module: &Module, builtin: &Builtin, value: &NestedScalars) -> bool {
    const BUILT_IN: u32 = 11;
    let declared = module.variables.iter().find_map(|variable| {
        let number = module.decorations.literal(variable.id, BUILT_IN)?;
        let ty = variable.ty?;
        let scalar = match *module.ty(ty) {
            Type::Vector { component, .. } => component,
            _ => ty,
        };
        match *module.ty(scalar) {
            Type::Int { signed, .. } if number == builtin.number => Some(signed),
            _ => None,
        }
    });
    declared.unwrap_or_else(|| value.has_negative())
}

/// Appends the words of a value in nested arrays of these lengths; false for another nesting.
fn of_shape(
    value: &NestedScalars,
    lengths: &[usize],
    ty: &Type,
    words: &mut Vec<u32>,
) -> std::result::Result<bool, String> {
    match (value, lengths) {
        (NestedScalars::One(scalar), []) => {
            words.push(scalar.bits(ty)? as u32);
            Ok(true)
        }
        (NestedScalars::Many(list), [length, inner @ ..]) if list.len() == *length => {
            for part in list {
                if !of_shape(part, inner, ty, words)? {
                    return Ok(false);
                }
            }
            Ok(true)
        }
        _ => Ok(false),
    }
}

/// Writes scalars over the bytes of a value with a layout; all of them, or none where one does not
/// fit.
///
/// # Errors
/// `InvalidArgument` where shape, kinds or ranges are not the layout's.
pub(super) fn write(layout: Layout<'_>, bytes: &mut [u8], what: &str, value: &NestedScalars) -> Result<()> {
    let mut placement = Placement { what, placed: Vec::new() };
    placement.add(layout, 0, value, "")?;
    for (offset, bits, size) in placement.placed {
        if let Some(place) = bytes.get_mut(offset..offset + size) {
            place.copy_from_slice(&bits.to_le_bytes()[..size]);
        }
    }
    Ok(())
}

/// The elements of a list; one for a scalar.
pub(super) fn length(value: &NestedScalars) -> usize {
    match value {
        NestedScalars::One(_) => 1,
        NestedScalars::Many(list) => list.len(),
    }
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
