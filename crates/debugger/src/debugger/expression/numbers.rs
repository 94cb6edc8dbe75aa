//! Scalars, vectors, matrices and short arrays of numbers: what expressions calculate with.

use half::f16;
use smallvec::{SmallVec, smallvec};

use crate::debugger::lane_state::LaneState;
use crate::debugger::variable_place::VariablePlace;
use anyhit_engine::math::float_format::FloatFormat;
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::builtin::{Builtin, ValueShape};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::reflect::value::{FloatValue, TypedValue, ValueContent};

/// The type of a component, with its bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScalarType {
    /// A bool.
    Bool,
    /// A signed integer of 8, 16, 32 or 64 bits.
    Int(u32),
    /// An unsigned integer of 8, 16, 32 or 64 bits.
    Uint(u32),
    /// A float of 16, 32 or 64 bits, of IEEE 754.
    Float(u32),
}

/// How components form a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberShape {
    /// One component.
    Scalar,
    /// A vector of so many.
    Vector(u32),
    /// A list of columns.
    #[allow(missing_docs, reason = "the names say it")]
    Matrix { columns: u32, rows: u32 },
    /// An array of scalars (1 row) or vectors.
    #[allow(missing_docs, reason = "the names say it")]
    Array { elements: u32, rows: u32 },
}

impl NumberShape {
    /// The number of components.
    pub fn components(self) -> u32 {
        match self {
            Self::Scalar => 1,
            Self::Vector(count) => count,
            Self::Matrix { columns: count, rows } | Self::Array { elements: count, rows } => count * rows,
        }
    }

    /// The shape of a part that an index selects, and the number of these parts.
    pub(super) fn part(self) -> Option<(Self, u32)> {
        match self {
            Self::Scalar => None,
            Self::Vector(count) | Self::Array { elements: count, rows: 1 } => Some((Self::Scalar, count)),
            Self::Matrix { columns: count, rows } | Self::Array { elements: count, rows } => {
                Some((Self::Vector(rows), count))
            }
        }
    }
}

/// The bits of the components of a value.
pub(super) type ComponentBits = SmallVec<[u64; 4]>;

/// A calculated value. The bits of a component are those of a float, the low bits of an integer, or
/// 0 or 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CalculatedValue {
    ty: ScalarType,
    shape: NumberShape,
    bits: ComponentBits,
}

/// The result of an operator or function, or the message why there is none.
pub(super) type Calculated = Result<CalculatedValue, String>;

impl CalculatedValue {
    pub(super) fn scalar(ty: ScalarType, bits: u64) -> Self {
        Self { ty, shape: NumberShape::Scalar, bits: smallvec![bits] }
    }

    pub(super) fn of_bool(value: bool) -> Self {
        Self::scalar(ScalarType::Bool, value.into())
    }

    pub(super) fn new(ty: ScalarType, shape: NumberShape, bits: ComponentBits) -> Self {
        debug_assert_eq!(shape.components() as usize, bits.len());
        Self { ty, shape, bits }
    }

    /// The type of its components.
    pub fn ty(&self) -> ScalarType {
        self.ty
    }

    /// How its components form a value.
    pub fn shape(&self) -> NumberShape {
        self.shape
    }

    /// The bits of its components.
    pub fn bits(&self) -> &[u64] {
        &self.bits
    }

    /// The value of a place, if it is made of numbers; pointers to buffers count as numbers.
    ///
    /// # Errors
    /// The reason why the place cannot be read.
    pub(super) fn of_place(place: &VariablePlace, state: &dyn LaneState) -> Result<Option<Self>, String> {
        let module = place.module();
        let (scalar, shape) = match *module.ty(place.ty()) {
            Type::Vector { component, count } => (component, NumberShape::Vector(count)),
            Type::Matrix { column, count: columns } => match *module.ty(column) {
                Type::Vector { component, count: rows } => (component, NumberShape::Matrix { columns, rows }),
                _ => return Ok(None),
            },
            _ => (place.ty(), NumberShape::Scalar),
        };
        let (ty, small) = match module.ty(scalar) {
            Type::Bool => (ScalarType::Bool, None),
            Type::Int { width, signed: true } => (ScalarType::Int(*width), None),
            Type::Int { width, signed: false } => (ScalarType::Uint(*width), None),
            Type::Float { width, encoding: None } => (ScalarType::Float(*width), None),
            ty @ Type::Float { .. } => (ScalarType::Float(32), ty.float_format()),
            Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. } => {
                (ScalarType::Uint(64), None)
            }
            _ => return Ok(None),
        };
        if place.has_unwritten_part(state) {
            return Err(format!("this {} has not been written yet", place.type_name()));
        }
        let words = place.words(state)?;
        let each = if ty.width() == 64 { 2 } else { 1 };
        let bits = words.chunks(each).map(|words| {
            let bits = u64::from(words[0]) | words.get(1).map_or(0, |&high| u64::from(high) << 32);
            match small {
                // Formats of few bits are calculated with as f32, which holds all of their values.
                Some(format) => u64::from((format.value(bits) as f32).to_bits()),
                None => bits & mask(ty),
            }
        });
        Ok(Some(Self::new(ty, shape, bits.collect())))
    }

    /// The value of a builtin.
    pub(super) fn of_builtin(builtin: &Builtin, words: &[u32]) -> Self {
        let float = ScalarType::Float(32);
        let (ty, shape) = match builtin.shape {
            ValueShape::Bool => (ScalarType::Bool, NumberShape::Scalar),
            ValueShape::Int => (ScalarType::Uint(32), NumberShape::Scalar),
            ValueShape::Int2 => (ScalarType::Uint(32), NumberShape::Vector(2)),
            ValueShape::Int3 => (ScalarType::Uint(32), NumberShape::Vector(3)),
            ValueShape::Int4 => (ScalarType::Uint(32), NumberShape::Vector(4)),
            ValueShape::Float => (float, NumberShape::Scalar),
            ValueShape::Float2 => (float, NumberShape::Vector(2)),
            ValueShape::Float3 => (float, NumberShape::Vector(3)),
            ValueShape::Matrix4x3 => (float, NumberShape::Matrix { columns: 4, rows: 3 }),
            ValueShape::FloatArray2 => (float, NumberShape::Array { elements: 2, rows: 1 }),
            ValueShape::Float3Array2 => (float, NumberShape::Array { elements: 2, rows: 3 }),
            ValueShape::Float3Array3 => (float, NumberShape::Array { elements: 3, rows: 3 }),
        };
        let word = |at: u32| words.get(at as usize).copied().map_or(0, u64::from);
        Self::new(ty, shape, (0..shape.components()).map(word).collect())
    }

    /// The words of the value as one of a module's type, into which it is converted as GLSL does
    /// without being told.
    ///
    /// # Errors
    /// The message where GLSL would have to be told, or has no such conversion.
    pub(super) fn words_as(&self, module: &Module, ty: TypeId) -> Result<Vec<u32>, String> {
        let wrong = || format!("cannot convert {} to {}", self.type_name(), module.describe_type(ty));
        let (scalar, count) = match *module.ty(ty) {
            Type::Vector { component, count } => (component, count),
            Type::Matrix { column, count } => match *module.ty(column) {
                Type::Vector { component, count: rows } => (component, count * rows),
                _ => return Err(wrong()),
            },
            _ => (ty, 1),
        };
        let (to, small) = match module.ty(scalar) {
            Type::Bool => (ScalarType::Bool, None),
            Type::Int { width, signed: true } => (ScalarType::Int(*width), None),
            Type::Int { width, signed: false } => (ScalarType::Uint(*width), None),
            Type::Float { width, encoding: None } => (ScalarType::Float(*width), None),
            ty @ Type::Float { .. } => (ScalarType::Float(64), ty.float_format()),
            Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. } => {
                (ScalarType::Uint(64), None)
            }
            _ => return Err(wrong()),
        };
        // HLSL spreads a scalar over a vector.
        let spread = self.bits.len() == 1 && matches!(module.ty(ty), Type::Vector { .. });
        if self.bits.len() != count as usize && !spread {
            return Err(wrong());
        }
        let implicit = match (self.ty, to) {
            (ScalarType::Bool, to) => to == ScalarType::Bool,
            (_, ScalarType::Bool) => false,
            (ScalarType::Float(_), to) => matches!(to, ScalarType::Float(_)),
            _ => true,
        };
        if !implicit {
            return Err(format!("{}: write {}(...)", wrong(), module.describe_type(ty)));
        }
        let mut words = Vec::new();
        for at in 0..count as usize {
            let bits = convert(self.bits[if spread { 0 } else { at }], self.ty, to);
            let bits = small.map_or(bits, |format| format.round(f64::from_bits(bits)));
            words.push(bits as u32);
            if small.is_none() && to.width() == 64 {
                words.push((bits >> 32) as u32);
            }
        }
        Ok(words)
    }

    /// The value with components of another type.
    pub(super) fn converted(&self, to: ScalarType) -> Self {
        let bits = self.bits.iter().map(|&bits| convert(bits, self.ty, to)).collect();
        Self { ty: to, shape: self.shape, bits }
    }

    /// The value as an index; `None` for what is no integer, or below 0.
    pub(super) fn as_index(&self) -> Option<u64> {
        match (self.shape, self.ty) {
            (NumberShape::Scalar, ScalarType::Uint(_)) => Some(self.bits[0]),
            (NumberShape::Scalar, ScalarType::Int(width)) => u64::try_from(signed(self.bits[0], width)).ok(),
            _ => None,
        }
    }

    /// Whether a scalar is not zero.
    pub(super) fn as_bool(&self) -> Option<bool> {
        let is_true = || convert(self.bits[0], self.ty, ScalarType::Bool) != 0;
        matches!(self.shape, NumberShape::Scalar).then(is_true)
    }

    /// The part at an index.
    pub(super) fn part(&self, at: u64) -> Option<Self> {
        let (shape, count) = self.shape.part()?;
        let size = shape.components() as usize;
        let first = usize::try_from(at).ok().filter(|&at| at < count as usize)? * size;
        Some(Self::new(self.ty, shape, self.bits[first..first + size].into()))
    }

    /// The name of its type, as GLSL has it.
    pub fn type_name(&self) -> String {
        let vector = |rows: u32| match rows {
            1 => self.ty.name().to_owned(),
            rows => format!("{}vec{rows}", self.ty.prefix()),
        };
        match self.shape {
            NumberShape::Scalar => vector(1),
            NumberShape::Vector(count) => vector(count),
            NumberShape::Matrix { columns, rows } if columns == rows => {
                format!("{}mat{columns}", self.ty.prefix())
            }
            NumberShape::Matrix { columns, rows } => format!("{}mat{columns}x{rows}", self.ty.prefix()),
            NumberShape::Array { elements, rows } => format!("{}[{elements}]", vector(rows)),
        }
    }

    /// The value for a reader.
    pub fn typed_value(&self) -> TypedValue {
        TypedValue { ty: self.type_name(), content: self.content() }
    }

    fn content(&self) -> ValueContent {
        let Some((_, count)) = self.shape.part() else { return content(self.bits[0], self.ty) };
        let parts = (0..count.into()).filter_map(|at| self.part(at));
        ValueContent::List(parts.map(|part| part.content()).collect())
    }
}

impl ScalarType {
    /// The bits of a component.
    pub(super) fn width(self) -> u32 {
        match self {
            Self::Bool => 1,
            Self::Int(width) | Self::Uint(width) | Self::Float(width) => width,
        }
    }

    /// The name as GLSL has it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::Int(8) => "int8_t",
            Self::Int(16) => "int16_t",
            Self::Int(64) => "int64_t",
            Self::Int(_) => "int",
            Self::Uint(8) => "uint8_t",
            Self::Uint(16) => "uint16_t",
            Self::Uint(64) => "uint64_t",
            Self::Uint(_) => "uint",
            Self::Float(16) => "float16_t",
            Self::Float(64) => "double",
            Self::Float(_) => "float",
        }
    }

    /// What stands before `vec`.
    fn prefix(self) -> &'static str {
        match self {
            Self::Bool => "b",
            Self::Int(8) => "i8",
            Self::Int(16) => "i16",
            Self::Int(64) => "i64",
            Self::Int(_) => "i",
            Self::Uint(8) => "u8",
            Self::Uint(16) => "u16",
            Self::Uint(64) => "u64",
            Self::Uint(_) => "u",
            Self::Float(16) => "f16",
            Self::Float(64) => "d",
            Self::Float(_) => "",
        }
    }
}

/// The bits that a component has.
pub(super) fn mask(ty: ScalarType) -> u64 {
    u64::MAX >> (64 - ty.width())
}

/// A signed integer from its low bits.
pub(super) fn signed(bits: u64, width: u32) -> i64 {
    (bits << (64 - width)) as i64 >> (64 - width)
}

/// The value of a float's bits.
pub(super) fn float(bits: u64, width: u32) -> f64 {
    format(width).value(bits)
}

/// The bits of the float nearest to a value.
pub(super) fn float_bits(value: f64, width: u32) -> u64 {
    format(width).round(value)
}

fn format(width: u32) -> FloatFormat {
    match width {
        16 => FloatFormat::Binary16,
        64 => FloatFormat::Binary64,
        _ => FloatFormat::Binary32,
    }
}

/// Converts a component as a constructor does: towards zero from floats to integers, the nearest
/// value where an integer does not hold it.
pub(super) fn convert(bits: u64, from: ScalarType, to: ScalarType) -> u64 {
    let integer: i128 = match from {
        ScalarType::Int(width) => signed(bits, width).into(),
        ScalarType::Bool | ScalarType::Uint(_) => bits.into(),
        ScalarType::Float(width) => {
            let value = float(bits, width);
            return match to {
                ScalarType::Bool => u64::from(value != 0.0),
                ScalarType::Int(width) => {
                    let most = i128::from(i64::MAX >> (64 - width));
                    (value as i128).clamp(-most - 1, most) as u64 & mask(to)
                }
                ScalarType::Uint(_) => (value as i128).clamp(0, mask(to).into()) as u64,
                ScalarType::Float(width) if from == to => bits & (u64::MAX >> (64 - width)),
                ScalarType::Float(width) => float_bits(value, width),
            };
        }
    };
    match to {
        ScalarType::Bool => u64::from(integer != 0),
        ScalarType::Int(_) | ScalarType::Uint(_) => integer as u64 & mask(to),
        ScalarType::Float(32) => (integer as f32).to_bits().into(),
        ScalarType::Float(width) => float_bits(integer as f64, width),
    }
}

/// The content of a scalar.
fn content(bits: u64, ty: ScalarType) -> ValueContent {
    match ty {
        ScalarType::Bool => ValueContent::Bool(bits != 0),
        ScalarType::Int(width) => ValueContent::Int(signed(bits, width)),
        ScalarType::Uint(_) => ValueContent::Uint(bits),
        ScalarType::Float(16) => ValueContent::Float(FloatValue::F16(f16::from_bits(bits as u16))),
        ScalarType::Float(64) => ValueContent::Float(FloatValue::F64(f64::from_bits(bits))),
        ScalarType::Float(_) => ValueContent::f32(f32::from_bits(bits as u32)),
    }
}
