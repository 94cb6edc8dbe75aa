//! Integers that pass through floats: `int2(float2(gl_LaunchIDEXT.xy))`, also with 0.5 added (the
//! centre of a pixel) or rounded down on the way.
//!
//! **Why the way there and back changes nothing.** An f32 has 24 bits of significand, so that every
//! integer from 0 to 2^24 is one exactly: its conversion rounds nothing, in any rounding mode, from
//! signed and unsigned integers alike. Clamping to a range around these changes none. Truncating or
//! rounding down an integer gives it back, and so does the conversion to a signed or an unsigned
//! integer. In f32 the numbers from 2^22 up to 2^23 are 1/2 apart, and smaller ones closer: for an
//! integer n below 2^23 the sum n + 0.5 is exact, too, and its integral part is n. From 2^23 on
//! numbers are 1 apart, and n + 0.5 rounds to an even one: 2^23 + 1.5 to 2^23 + 2. Above 2^24 two
//! integers have one float: 2^24 + 1 becomes 2^24.
//!
//! How large the integer gets is decided by the size of the launch, which bounds its indices. So a
//! range keeps its *bounds*, and [`LaunchExtent::keeps_bounds`] checks them once the size is known.

use super::affine::AffineRange;
use super::{AffineExpr, LaunchExtent, Symbol, ValueTracking, is};
use crate::machine::{Binding, Reg};
use crate::ops::arithmetic::FAdd;
use crate::ops::conversion::{self, Conversion};
use crate::ops::glsl::{FClamp, Floor, NClamp, Trunc};
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::op::Op;

/// An integer in a float.
#[derive(Clone, Copy, Debug)]
pub(super) struct Converted {
    /// The integer that was converted to the float.
    pub integer: Reg,
    /// What the integer must be below for the float's integral part to be it.
    limit: u32,
}

/// Integers below this are exact as f32.
const EXACT_BELOW: u32 = 1 << 24;
/// Integers below this are exact as f32 with 0.5 added.
const EXACT_WITH_HALF_BELOW: u32 = 1 << 23;

/// The most operations between an integer and the integer that is made of it again.
const MAX_OPERATIONS: usize = 16;

impl Converted {
    /// The range of the integer that the float gives, made of that of the integer before.
    pub(super) fn back(self, mut range: AffineRange) -> Option<AffineRange> {
        if range.count != 1 {
            return None;
        }
        let bound = (range.from.clone(), self.limit);
        range.bounds = super::both(range.bounds, &[bound].into_iter().collect())?;
        Some(range)
    }
}

/// Whether a kernel converts an f32 to an integer of 32 bits.
pub(super) fn gives_integer(kernel: &LaneKernel) -> bool {
    converts(kernel, [Conversion::FToS, Conversion::FToU])
}

fn converts(kernel: &LaneKernel, conversions: [Conversion; 2]) -> bool {
    conversions.into_iter().any(|conversion| is(kernel, conversion::kernel(conversion, 32, 32)))
}

impl ValueTracking<'_> {
    /// The integer that a float is made of, if its integral part is that integer.
    pub(super) fn converted(&self, mut float: Reg) -> Option<Converted> {
        let mut limit = EXACT_BELOW;
        for _ in 0..MAX_OPERATIONS {
            if self.input_of(float).is_some() {
                return None;
            }
            let writer = self.writer(float)?;
            if let Some(copy) = writer.copy() {
                float = copy.from;
                continue;
            }
            float = match *writer {
                Op::LaneKernel { kernel, from: [a, ..], .. }
                    if converts(kernel, [Conversion::SToF, Conversion::UToF]) =>
                {
                    return Some(Converted { integer: a, limit });
                }
                Op::LaneKernel { kernel, from: [a, ..], .. }
                    if is(kernel, Floor.kernel(32)) || is(kernel, Trunc.kernel(32)) =>
                {
                    a
                }
                // WGSL keeps to what the integer type holds before it converts.
                Op::LaneKernel { kernel, from: [a, low, high], .. }
                    if is(kernel, FClamp.kernel(32)) || is(kernel, NClamp.kernel(32)) =>
                {
                    let number = |reg: Reg| self.constants.get(&reg).map(|&bits| f32::from_bits(bits));
                    if !(number(low)? <= 0.0 && number(high)? >= EXACT_BELOW as f32) {
                        return None;
                    }
                    a
                }
                // The half is added once: two of them are the next integer.
                Op::LaneKernel { kernel, from: [a, b, _], .. }
                    if is(kernel, FAdd.kernel(32)) && limit == EXACT_BELOW =>
                {
                    limit = EXACT_WITH_HALF_BELOW;
                    let half = |reg: Reg| self.constants.get(&reg) == Some(&0.5_f32.to_bits());
                    match (half(a), half(b)) {
                        (false, true) => a,
                        (true, false) => b,
                        _ => return None,
                    }
                }
                _ => return None,
            };
        }
        None
    }
}

impl LaunchExtent<'_> {
    /// Whether the bounds of a range hold for every invocation; `stored` returns whether a binding
    /// may be stored to.
    pub(super) fn keeps_bounds(&self, range: &AffineRange, stored: &impl Fn(Binding) -> bool) -> bool {
        range.bounds.iter().all(|(sum, limit)| {
            self.least_and_greatest(sum, stored)
                .is_some_and(|(least, greatest)| least >= 0 && greatest < i64::from(*limit))
        })
    }

    /// Bounds of the values of an expression; `None` where they are not known.
    fn least_and_greatest(&self, sum: &AffineExpr, stored: &impl Fn(Binding) -> bool) -> Option<(i64, i64)> {
        let (mut least, mut greatest) = (0_i64, 0_i64);
        for (symbols, factor) in &sum.0 {
            let (mut product, mut varies) = (*factor, false);
            for symbol in symbols {
                let of = |dimensions: [u32; 3], axis: u8| dimensions[usize::from(axis)];
                let (value, is_index) = match *symbol {
                    Symbol::Index(axis) => (of(self.count, axis).saturating_sub(1), true),
                    Symbol::Local(axis) => (of(self.local, axis).saturating_sub(1), true),
                    Symbol::Size(axis) => (of(self.count, axis), false),
                    Symbol::Word(Some((binding, _)), _) if stored(binding) => return None,
                    Symbol::Word(place, offset) => (self.word(place, offset)?, false),
                };
                product = product.checked_mul(value.into())?;
                varies |= is_index;
            }
            // An index goes from 0 up to its greatest value.
            let other = if varies { 0 } else { product };
            least = least.checked_add(product.min(other))?;
            greatest = greatest.checked_add(product.max(other))?;
        }
        Some((least, greatest))
    }
}
