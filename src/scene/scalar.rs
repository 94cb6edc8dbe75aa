//! Scalars as a scene writes them, with their types.

use crate::math::float_format::FloatFormat;
use crate::module::scalar_value::{FloatMisfit, judge_rounding};
use crate::scene::read::{Parse, Table, TomlValue};

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

    /// The little-endian bytes of one value.
    pub(super) fn encode(self, value: TomlValue<'_>, bytes: &mut Vec<u8>) -> Option<()> {
        match self {
            Self::F16 => bytes.extend(float_bytes(value, FloatFormat::Binary16, "f16")?),
            Self::Bf16 => bytes.extend(float_bytes(value, FloatFormat::BFloat16, "bf16")?),
            Self::E4m3 => bytes.extend(float_bytes(value, FloatFormat::E4M3, "e4m3")?),
            Self::E5m2 => bytes.extend(float_bytes(value, FloatFormat::E5M2, "e5m2")?),
            Self::F32 => bytes.extend(float_bytes(value, FloatFormat::Binary32, "f32")?),
            Self::F64 => bytes.extend(float_bytes(value, FloatFormat::Binary64, "f64")?),
            Self::U8 => bytes.extend(u8::parse(value)?.to_le_bytes()),
            Self::I8 => bytes.extend(i8::parse(value)?.to_le_bytes()),
            Self::U16 => bytes.extend(u16::parse(value)?.to_le_bytes()),
            Self::I16 => bytes.extend(i16::parse(value)?.to_le_bytes()),
            Self::U32 => bytes.extend(u32::parse(value)?.to_le_bytes()),
            Self::I32 => bytes.extend(i32::parse(value)?.to_le_bytes()),
            Self::U64 => bytes.extend(u64::parse(value)?.to_le_bytes()),
            Self::I64 => bytes.extend(i64::parse(value)?.to_le_bytes()),
            // VkBool32, which is also how compilers lay out a bool in a buffer.
            Self::Bool => bytes.extend(u32::from(bool::parse(value)?).to_le_bytes()),
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

/// The bits of a float, rounded once from the decimal text; an error of the text's place where it
/// is out of range, or is not 0 and rounds to 0.
///
/// Formats of 8 and 16 bits are rounded by way of f64: 53 bits are more than twice the 11 of a
/// half, plus two, so double rounding has no effect unless the decimal lies within 2^-53 of a tie
/// without being one.
fn float_bits(value: TomlValue<'_>, format: FloatFormat, name: &str) -> Option<u64> {
    let wide = f64::parse(value)?;
    let bits = match format {
        FloatFormat::Binary32 => f32::parse(value)?.to_bits().into(),
        _ => format.round(wide),
    };
    match judge_rounding(wide, bits, format) {
        Ok(bits) => Some(bits),
        Err(FloatMisfit::Overflows) => value.wrong(format!("`{wide}` is beyond the range of {name}")),
        Err(FloatMisfit::Vanishes) => {
            value.wrong(format!("`{wide}` is too small for {name}: it rounds to 0"))
        }
        Err(FloatMisfit::NoInfinity) => value.wrong(format!("{name} has no infinity")),
    }
}

/// The little-endian bytes of [`float_bits`].
pub(super) fn float_bytes(value: TomlValue<'_>, format: FloatFormat, name: &str) -> Option<Vec<u8>> {
    let bits = float_bits(value, format, name)?;
    Some(bits.to_le_bytes()[..format.width() as usize / 8].to_vec())
}
