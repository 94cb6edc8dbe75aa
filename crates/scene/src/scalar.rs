//! Scalars as a scene writes them, with their types.

use crate::read::{Parse, Table, TomlValue};
use crate::tree::Toml;
use anyhit_engine::math::float_format::FloatFormat;
use anyhit_engine::module::decimal::{decimal_bits, whole_bits};
use anyhit_engine::module::ty::Type;

/// A type of scalar as a scene names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    F16,
    F32,
    F64,
    Bf16,
    E4m3,
    E5m2,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    Bool,
}

/// Bytes for the rows of a table.
#[derive(Clone, Debug)]
pub(super) enum Rows {
    /// Those of every row.
    Every(Vec<u8>),
    /// Those of each row.
    Each(Vec<Vec<u8>>),
}

impl Scalar {
    pub(super) const ALL: [Self; 15] = [
        Self::F16,
        Self::F32,
        Self::F64,
        Self::Bf16,
        Self::E4m3,
        Self::E5m2,
        Self::U8,
        Self::I8,
        Self::U16,
        Self::I16,
        Self::U32,
        Self::I32,
        Self::U64,
        Self::I64,
        Self::Bool,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::F16 => "f16",
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::Bf16 => "bf16",
            Self::E4m3 => "e4m3",
            Self::E5m2 => "e5m2",
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::Bool => "bool",
        }
    }

    /// The size in bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 | Self::E4m3 | Self::E5m2 => 1,
            Self::F16 | Self::Bf16 | Self::U16 | Self::I16 => 2,
            Self::F32 | Self::U32 | Self::I32 | Self::Bool => 4,
            Self::F64 | Self::U64 | Self::I64 => 8,
        }
    }

    fn format(self) -> Option<FloatFormat> {
        Some(match self {
            Self::F16 => FloatFormat::Binary16,
            Self::Bf16 => FloatFormat::BFloat16,
            Self::E4m3 => FloatFormat::E4M3,
            Self::E5m2 => FloatFormat::E5M2,
            Self::F32 => FloatFormat::Binary32,
            Self::F64 => FloatFormat::Binary64,
            _ => return None,
        })
    }

    fn is_signed(self) -> bool {
        matches!(self, Self::I8 | Self::I16 | Self::I32 | Self::I64)
    }

    /// The scalar type of a shader's type.
    pub(super) fn of(ty: &Type) -> Option<Self> {
        let is_it = |one: &Self| match *ty {
            Type::Int { width, signed } => {
                *one != Self::Bool
                    && one.format().is_none()
                    && (one.size() * 8, one.is_signed()) == (width as usize, signed)
            }
            Type::Float { .. } => one.format().is_some() && one.format() == ty.float_format(),
            Type::Bool => *one == Self::Bool,
            Type::Pointer { .. } => *one == Self::U64,
            _ => false,
        };
        Self::ALL.into_iter().find(is_it)
    }

    /// Whether bits of this type have the same value in a shader's type of the same size and kind.
    pub(super) fn fits(self, bits: u64, ty: &Type) -> bool {
        let Some(own) = Self::of(ty) else { return false };
        let is_integer = |one: Self| one.format().is_none() && one != Self::Bool;
        match (self, own) {
            // Compilers store the bools of a buffer as 32-bit integers.
            (Self::Bool, Self::Bool | Self::U32 | Self::I32) => true,
            _ if is_integer(self) && is_integer(own) && self.size() == own.size() => {
                self.is_signed() == own.is_signed() || bits >> (8 * self.size() - 1) == 0
            }
            _ => self == own,
        }
    }

    /// The number of bits of this type.
    pub(super) fn text(self, bits: u64) -> String {
        let unused = 64 - 8 * self.size() as u32;
        match (self.format(), self) {
            (Some(FloatFormat::Binary64), _) => format!("{:?}", f64::from_bits(bits)),
            (Some(format), _) => format!("{:?}", format.value(bits) as f32),
            (None, Self::Bool) => (bits != 0).to_string(),
            (None, _) if self.is_signed() => ((bits << unused) as i64 >> unused).to_string(),
            (None, _) => bits.to_string(),
        }
    }

    /// The little-endian bytes of one value.
    pub(super) fn encode(self, value: TomlValue<'_>, bytes: &mut Vec<u8>) -> Option<()> {
        if let Some(format) = self.format() {
            bytes.extend(float_bytes(value, format, self.name())?);
            return Some(());
        }
        match self {
            Self::U8 => bytes.extend(u8::parse(value)?.to_le_bytes()),
            Self::I8 => bytes.extend(i8::parse(value)?.to_le_bytes()),
            Self::U16 => bytes.extend(u16::parse(value)?.to_le_bytes()),
            Self::I16 => bytes.extend(i16::parse(value)?.to_le_bytes()),
            Self::U32 => bytes.extend(u32::parse(value)?.to_le_bytes()),
            Self::I32 => bytes.extend(i32::parse(value)?.to_le_bytes()),
            Self::U64 => bytes.extend(u64::parse(value)?.to_le_bytes()),
            Self::I64 => bytes.extend(i64::parse(value)?.to_le_bytes()),
            // VkBool32, which is also how compilers lay out a bool in a buffer.
            _ => bytes.extend(u32::from(bool::parse(value)?).to_le_bytes()),
        }
        Some(())
    }

    /// The values under this type's key, flattened.
    pub(super) fn column(self, table: &Table<'_>) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        self.flatten(table.value(self.name())?, &mut bytes)?;
        Some(bytes)
    }

    /// The values under this type's key as rows: those of each element of a list, or one for all.
    pub(super) fn rows(self, table: &Table<'_>) -> Option<Rows> {
        let value = table.value(self.name())?;
        let Some(elements) = value.elements() else {
            let mut bytes = Vec::new();
            self.encode(value, &mut bytes)?;
            return Some(Rows::Every(bytes));
        };
        let mut rows: Option<Vec<Vec<u8>>> = Some(Vec::new());
        for element in elements {
            let mut bytes = Vec::new();
            let read = self.flatten(element, &mut bytes);
            rows = rows.zip(read).map(|(mut rows, ())| {
                rows.push(bytes);
                rows
            });
        }
        let rows = rows?;
        if rows.iter().any(|row| row.len() != rows[0].len()) {
            return value.wrong("all rows of a column must have the same number of values");
        }
        Some(Rows::Each(rows))
    }

    fn flatten(self, value: TomlValue<'_>, bytes: &mut Vec<u8>) -> Option<()> {
        let Some(elements) = value.elements() else { return self.encode(value, bytes) };
        let mut all_good = true;
        for element in elements {
            all_good &= self.flatten(element, bytes).is_some();
        }
        all_good.then_some(())
    }
}

/// The bits of a float, rounded once from the decimal text; an error of the text's place where the
/// format has no such number.
pub fn float_bits(value: TomlValue<'_>, format: FloatFormat, name: &str) -> Option<u64> {
    let (bits, text) = match value.toml() {
        Toml::Float(text) => (decimal_bits(text, format), text),
        Toml::Integer(digits, 10) => (whole_bits(digits, format), digits),
        Toml::Integer(..) => {
            let span = value.span();
            let message = format!("{name} is a float, which must be written in decimal");
            let help = "help: write the number in decimal, or its bits as bytes: `hex = \"0000803f\"`";
            value.report().push(span.error_with(message, "this is an integer of another base").note(help));
            return None;
        }
        _ => return value.expected("a number"),
    };
    bits.map_or_else(|misfit| value.wrong(misfit.describe(&format!("`{text}`"), name)), Some)
}

/// The little-endian bytes of [`float_bits`].
pub(super) fn float_bytes(value: TomlValue<'_>, format: FloatFormat, name: &str) -> Option<Vec<u8>> {
    let bits = float_bits(value, format, name)?;
    Some(bits.to_le_bytes()[..format.width() as usize / 8].to_vec())
}
