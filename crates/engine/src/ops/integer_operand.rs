//! Integer operands whose width is free (shift amounts, bit-field offsets, exponents, indices,
//! texel coordinates), as one word each.
//!
//! Integers of 8 and 16 bits lie zero-extended in their register; those of 64 bits saturate, so
//! that a value out of range stays out of range.

use crate::machine::Reg;
use crate::module::Id;
use crate::module::ty::Type;
use crate::ops::conversion::{self, Conversion};
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// Kernels that convert an integer to one word.
pub mod saturate {
    use crate::ops::lane_kernel::lane_kernels;

    lane_kernels! {
        /// The nearest unsigned number of 32 bits.
        ToUnsigned Internal [u64] (a: u64) -> u32 { u32::try_from(a).unwrap_or(u32::MAX) }
        /// The nearest signed number of 32 bits.
        ToSigned Internal [i64] (a: i64) -> i32 { a.clamp(i32::MIN.into(), i32::MAX.into()) as i32 }
        /// The nearest signed number of 32 bits, of an unsigned one.
        UnsignedToSigned Internal [u32 u64] (a: T) -> i32 { i32::try_from(a).unwrap_or(i32::MAX) }
    }
}

/// How an integer is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadAs {
    /// As an unsigned number, whatever its type (SPIR-V, `OpShiftLeftLogical`: "Shift is consumed
    /// as an unsigned value").
    Unsigned,
    /// As the number that it is in its own type, as a signed word.
    Number,
    /// As a signed number, whatever its type (SPIR-V, `OpAccessChain`: "is treated as signed");
    /// what is negative becomes huge.
    Index,
    /// As a coordinate: [`ReadAs::Number`], but that 32 bits stay as they are, as what is too
    /// large for a signed word is outside of every image either way.
    Coordinate,
}

impl Translator<'_> {
    /// The components of an integer scalar or vector, one word each.
    ///
    /// # Errors
    /// `InvalidModule` for what is no integer.
    pub fn integers(&mut self, id: Id, read_as: ReadAs) -> Result<Words> {
        let ty = self.type_of(id)?;
        let scalar = match *self.module.ty(ty) {
            Type::Vector { component, .. } => component,
            _ => ty,
        };
        let Type::Int { width, signed } = *self.module.ty(scalar) else {
            let name = self.module.describe_type(ty);
            return Err(self.invalid(format!("%{} is of type {name} instead of an integer type", id.0)));
        };
        let components = self.components_of(id, width)?;
        let Some(kernel) = kernel(read_as, width, signed) else { return Ok(components) };
        components.iter().map(|&component| self.emit_kernel(kernel, &[component])).collect()
    }

    /// The one word of an integer scalar.
    ///
    /// # Errors
    /// As [`Translator::integers`], and for a vector.
    pub fn integer(&mut self, id: Id, read_as: ReadAs) -> Result<Reg> {
        match self.integers(id, read_as)?[..] {
            [word] => Ok(word),
            _ => Err(self.invalid(format!("%{} is a vector instead of a scalar integer", id.0))),
        }
    }
}

/// The kernel that converts an integer to the word to read; `None` where its word is that already.
fn kernel(read_as: ReadAs, width: u32, signed: bool) -> Option<&'static LaneKernel> {
    use saturate::{ToSigned, ToUnsigned, UnsignedToSigned};
    match (read_as, width, signed) {
        (ReadAs::Index, 8 | 16, _) | (ReadAs::Number | ReadAs::Coordinate, 8 | 16, true) => {
            conversion::kernel(Conversion::S, width, 32)
        }
        (ReadAs::Unsigned | ReadAs::Index, 64, _) => Some(&ToUnsigned.kernels[0]),
        (ReadAs::Number | ReadAs::Coordinate, 64, true) => Some(&ToSigned.kernels[0]),
        (ReadAs::Number | ReadAs::Coordinate, 64, false) | (ReadAs::Number, 32, false) => {
            UnsignedToSigned.kernel(width)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::saturate::{ToSigned, ToUnsigned, UnsignedToSigned};
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn what_does_not_fit_becomes_the_nearest_number() {
        check(&ToUnsigned, 64, &[7], 7);
        check(&ToUnsigned, 64, &[1 << 32], 0xFFFF_FFFF);
        check(&ToSigned, 64, &[-5i64 as u64], -5i32 as u32 as u64);
        check(&ToSigned, 64, &[1 << 31], 0x7FFF_FFFF);
        check(&ToSigned, 64, &[1 << 63], 0x8000_0000);
        check(&UnsignedToSigned, 32, &[0x8000_0000], 0x7FFF_FFFF);
        check(&UnsignedToSigned, 64, &[u64::MAX], 0x7FFF_FFFF);
        check(&UnsignedToSigned, 64, &[41], 41);
    }
}
