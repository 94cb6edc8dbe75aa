//! Conversion instructions (SPIR-V 3.3.11): a kernel for each pair of widths.
//!
//! A float outside the range of the integer type, which the specification leaves undefined,
//! saturates; a NaN gives 0.

pub mod encoded;

use std::marker::PhantomData;

use half::f16;

use crate::machine::lanes::{Lanes, map1};
use crate::machine::{Reg, Scalar};
use crate::math::float;
#[cfg(target_arch = "x86_64")]
use crate::math::lane_ops::{LaneOps, LaneTask};
use crate::ops::lane_kernel::lane_kernels;
use crate::ops::lane_kernel::{InstructionSet, LaneKernel, LaneLoop, OpFamily, ScalarWidth, Unary};

macro_rules! conversions {
    ($($name:ident: $($from:ty => $to:ty),+;)+) => {$(
        mod $name {
            use super::*;
            pub(super) static KERNELS: &[(u32, LaneKernel)] = &[$((
                <$to as ScalarWidth>::BITS,
                if <$from as ScalarWidth>::FLOAT == 32 && <$to as ScalarWidth>::BITS == 32 && <$to as ScalarWidth>::SIGNED {
                    with_simd_truncation(crate::ops::lane_kernel::lane_kernel!(Convert, &CONVERT, $from, (a: $from), $to, Between<$from, $to>))
                } else {
                    crate::ops::lane_kernel::lane_kernel!(Convert, &CONVERT, $from, (a: $from), $to, Between<$from, $to>)
                },
            )),+];
        }
    )+};
}

/// All conversions, whose kernels are found by their types: see [`kernel`].
pub static CONVERT: OpFamily =
    OpFamily { name: "Convert", set: InstructionSet::Internal, number: u32::MAX, kernels: &[] };

/// The kernel from f32 to i32, with the processor's own conversion for 64 lanes.
const fn with_simd_truncation(kernel: LaneKernel) -> LaneKernel {
    LaneKernel {
        #[cfg(target_arch = "x86_64")]
        eval_64: Some(|simd, registers, to, from| simd.dispatch(Truncate { registers, to, from: from[0] })),
        ..kernel
    }
}

/// Converts f32 to i32.
#[cfg(target_arch = "x86_64")]
struct Truncate<'a> {
    registers: &'a mut [Lanes<64>],
    to: Reg,
    from: Reg,
}

#[cfg(target_arch = "x86_64")]
impl LaneTask for Truncate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: LaneOps>(self, vectors: V) {
        let mut result = [0; 64];
        let from = self.registers[self.from.0 as usize].0.as_chunks::<8>().0;
        for (at, to) in result.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            *to = vectors.truncate_words(&from[at]);
        }
        self.registers[self.to.0 as usize].0 = result;
    }
}

/// A value to be converted; a type of this crate, so that [`To`] can be implemented for every pair.
#[derive(Debug)]
pub struct Convert<A>(A);

/// See [`Convert`].
pub trait To<B> {
    /// The value in the other type.
    fn to(self) -> B;
}

/// The conversion from `A` to `B` as a lane loop and as a scalar function.
#[derive(Debug)]
pub struct Between<A, B> {
    _types: PhantomData<(A, B)>,
}

impl<A: Scalar, B: Scalar> LaneLoop for Between<A, B>
where
    Convert<A>: To<B>,
{
    #[inline(always)]
    fn run<const W: usize>(registers: &mut [Lanes<W>], to: Reg, from: &[Reg; 3]) {
        map1::<W, A, B>(registers, to, from, Self::apply);
    }
}

impl<A: Scalar, B: Scalar> Unary for Between<A, B>
where
    Convert<A>: To<B>,
{
    type A = A;
    type R = B;

    #[inline(always)]
    fn apply(a: A) -> B {
        Convert(a).to()
    }
}

macro_rules! casts {
    ($($from:ty => $($to:ty)+;)+) => {$($(
        impl To<$to> for Convert<$from> {
            #[inline(always)]
            fn to(self) -> $to {
                self.0 as $to
            }
        }
    )+)+};
}

casts! {
    f32 => i8 i16 i64 u8 u16 u64 f64;
    f64 => i8 i16 i32 i64 u8 u16 u32 u64 f32;
    i8 => f32 f64 i16 i32 i64;
    i16 => f32 f64 i8 i32 i64;
    i32 => f32 f64 i8 i16 i64;
    i64 => f32 f64 i8 i16 i32;
    u8 => f32 f64 u16 u32 u64;
    u16 => f32 f64 u8 u32 u64;
    u32 => f32 f64 u8 u16 u64;
    u64 => f32 f64 u8 u16 u32;
}

impl To<i32> for Convert<f32> {
    #[inline(always)]
    fn to(self) -> i32 {
        float::to_i32(self.0)
    }
}

impl To<u32> for Convert<f32> {
    #[inline(always)]
    fn to(self) -> u32 {
        float::to_u32(self.0)
    }
}

macro_rules! half_from {
    ($($from:ty)+) => {$(
        impl To<f16> for Convert<$from> {
            #[inline(always)]
            fn to(self) -> f16 {
                // Every f32 and narrow integer is exact in f64; of wide integers only those beyond
                // f16's range are not, and they round to infinity all the same.
                crate::math::float::f64_to_f16(self.0 as f64)
            }
        }
    )+};
}

macro_rules! half_to {
    ($($to:ty)+) => {$(
        impl To<$to> for Convert<f16> {
            #[inline(always)]
            fn to(self) -> $to {
                self.0.to_f64() as $to
            }
        }
    )+};
}

half_from! { f32 f64 i8 i16 i32 i64 u8 u16 u32 u64 }
half_to! { f32 f64 i8 i16 i32 i64 u8 u16 u32 u64 }

conversions! {
    from_float_to_unsigned: f16 => u8, f16 => u16, f16 => u32, f16 => u64, f32 => u8, f32 => u16, f32 => u32,
        f32 => u64, f64 => u8, f64 => u16, f64 => u32, f64 => u64;
    from_float_to_signed: f16 => i8, f16 => i16, f16 => i32, f16 => i64, f32 => i8, f32 => i16, f32 => i32,
        f32 => i64, f64 => i8, f64 => i16, f64 => i32, f64 => i64;
    from_signed_to_float: i8 => f16, i16 => f16, i32 => f16, i64 => f16, i8 => f32, i16 => f32, i32 => f32,
        i64 => f32, i8 => f64, i16 => f64, i32 => f64, i64 => f64;
    from_unsigned_to_float: u8 => f16, u16 => f16, u32 => f16, u64 => f16, u8 => f32, u16 => f32, u32 => f32,
        u64 => f32, u8 => f64, u16 => f64, u32 => f64, u64 => f64;
    between_unsigned: u8 => u16, u8 => u32, u8 => u64, u16 => u8, u16 => u32, u16 => u64, u32 => u8, u32 => u16,
        u32 => u64, u64 => u8, u64 => u16, u64 => u32;
    between_signed: i8 => i16, i8 => i32, i8 => i64, i16 => i8, i16 => i32, i16 => i64, i32 => i8, i32 => i16,
        i32 => i64, i64 => i8, i64 => i16, i64 => i32;
    between_floats: f16 => f32, f16 => f64, f32 => f16, f32 => f64, f64 => f16, f64 => f32;
}

/// The conversion that an opcode stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the specification's")]
pub enum Conversion {
    FToU,
    FToS,
    SToF,
    UToF,
    U,
    S,
    F,
}

/// The kernel that converts between two widths; `None` where they are equal and nothing is to be
/// done, or no such types exist.
#[inline]
pub fn kernel(conversion: Conversion, from: u32, to: u32) -> Option<&'static LaneKernel> {
    let kernels = match conversion {
        Conversion::FToU => from_float_to_unsigned::KERNELS,
        Conversion::FToS => from_float_to_signed::KERNELS,
        Conversion::SToF => from_signed_to_float::KERNELS,
        Conversion::UToF => from_unsigned_to_float::KERNELS,
        Conversion::U => between_unsigned::KERNELS,
        Conversion::S => between_signed::KERNELS,
        Conversion::F => between_floats::KERNELS,
    };
    kernels.iter().find(|(width, kernel)| *width == to && kernel.width == from).map(|(_, kernel)| kernel)
}

/// The kernel that converts an f64 to the integer type to which this one converts a narrower float.
pub fn f64_counterpart(kernel: &'static LaneKernel) -> Option<&'static LaneKernel> {
    let lists = [from_float_to_signed::KERNELS, from_float_to_unsigned::KERNELS];
    lists.into_iter().find_map(|kernels| {
        let (to, _) = kernels.iter().find(|(_, known)| known == kernel)?;
        kernels.iter().find(|(width, known)| width == to && known.width == 64).map(|(_, kernel)| kernel)
    })
}

lane_kernels! {
    /// To the nearest f16 and back.
    QuantizeToF16 Core [f32] (a: f32) -> f32 {
        // A result that would be a denormal of f16 is a zero of the same sign.
        let half = f16::from_f32(a);
        if half.is_normal() || a.is_nan() || half.is_infinite() { half.to_f32() } else { 0f32.copysign(a) }
    }
    SatConvertSToU Core [i8 i16 i32 i64] (a: T) -> T { a.max(0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::lane_kernel::tests::{check, check_kernel};

    fn convert(conversion: Conversion, from: u32, to: u32, value: u64, expected: u64) {
        check_kernel(kernel(conversion, from, to).expect("a kernel"), &[value], expected);
    }

    #[test]
    fn vectors() {
        use Conversion::{F, FToS, FToU, S, SToF, U, UToF};
        convert(FToS, 32, 32, (-1.9f32).to_bits().into(), 0xFFFF_FFFF);
        convert(FToU, 32, 32, 3e9f32.to_bits().into(), 3_000_000_000);
        convert(FToS, 32, 32, f32::NAN.to_bits().into(), 0);
        convert(FToS, 32, 32, 0xFFC0_0001, 0);
        convert(FToS, 32, 32, 2_147_483_648f32.to_bits().into(), 0x7FFF_FFFF);
        convert(FToS, 32, 32, f32::INFINITY.to_bits().into(), 0x7FFF_FFFF);
        convert(FToS, 32, 32, 2_147_483_520f32.to_bits().into(), 2_147_483_520);
        convert(FToS, 32, 32, (-2_147_483_648f32).to_bits().into(), 0x8000_0000);
        convert(FToS, 32, 32, f32::NEG_INFINITY.to_bits().into(), 0x8000_0000);
        convert(FToS, 32, 32, (-0.99f32).to_bits().into(), 0);
        convert(FToS, 32, 8, 300f32.to_bits().into(), 0x7F);
        convert(FToU, 16, 32, 0x4248, 3); // 3.140625
        convert(SToF, 32, 32, 0xFFFF_FFFF, 0xBF80_0000);
        convert(UToF, 32, 32, 0xFFFF_FFFF, 0x4F80_0000); // rounds up to 2^32
        convert(UToF, 32, 32, 16_777_217, 0x4B80_0000); // 2^24 + 1 is a tie: to even
        convert(SToF, 64, 64, u64::MAX, (-1f64).to_bits());
        convert(UToF, 32, 16, 70_000, 0x7C00);
        convert(S, 8, 32, 0x80, 0xFFFF_FF80);
        convert(U, 8, 32, 0x80, 0x80);
        convert(S, 32, 64, 0x8000_0000, 0xFFFF_FFFF_8000_0000);
        convert(U, 64, 16, 0x1_2345, 0x2345);
        convert(F, 32, 16, 65_520f32.to_bits().into(), 0x7C00);
        convert(F, 32, 16, 65_519f32.to_bits().into(), 0x7BFF);
        convert(F, 16, 32, 1, 0x3380_0000); // the smallest denormal is 2^-24
        convert(F, 64, 32, 0.1f64.to_bits(), 0x3DCC_CCCD);
        check(&QuantizeToF16, 32, &[0x3DCC_CCCD], 0x3DCC_C000);
        check(&QuantizeToF16, 32, &[0x8000_0001], 0x8000_0000);
        assert!(kernel(U, 32, 32).is_none());
    }
}
