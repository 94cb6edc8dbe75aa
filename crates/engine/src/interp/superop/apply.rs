//! What a superinstruction does with registers and the accumulator.

use crate::interp::superop::words::WordFunction;
use crate::machine::Lanes;
use crate::math::lane_ops::LaneOps;
use crate::ops::superop::function::has_operand;
use crate::ops::superop::{DIRECT_REGISTERS, Operands, SuperOp};

/// Lanes of a batch that runs superinstructions.
pub(super) const LANES: usize = 64;

/// The direct registers.
pub(super) type DirectRegisters = [Lanes<LANES>; DIRECT_REGISTERS];

/// Applies a function to registers and puts the result into the accumulator. Operand `ACC_OPERAND`,
/// counted from one, is the accumulator's old value (0 for none); if `STORED`, the result is stored
/// in its register, too. Operands whose bit is set in `UNIFORM` are the same in all lanes: one word
/// is read of each, and kept in a vector register. Those whose bit is set in `SHIFT_AMOUNTS` are
/// shift amounts less than 32.
///
/// The loop over superinstructions is the only caller of each instance, one for each `V`: so it is
/// inlined without `always`, after its own loops were optimised. Inlined before, each pass over
/// each of them looks at the loop with all its arms, which took a quarter of a debug build.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[allow(clippy::extra_unused_type_parameters, reason = "an instance for each caller")]
#[inline]
pub(super) fn apply<
    V: LaneOps,
    F: WordFunction,
    const ACC_OPERAND: usize,
    const STORED: bool,
    const UNIFORM: u8,
    const SHIFT_AMOUNTS: u8,
>(
    accumulator: &mut [u32; LANES],
    registers: &mut DirectRegisters,
    superop: &SuperOp,
) {
    // The loops over operands are unrolled. Closures, or each operand by itself, would be a
    // multiple of the code for each of the many instances of this function.
    let held = Lanes(*accumulator);
    let mut rows: Operands<_> = [&held; 6];
    let mut uniform = [0; _];
    for at in 0..F::OPERANDS {
        if has_operand(UNIFORM, at) {
            // The mask lets the compiler leave out a comparison with 32.
            let mask = if has_operand(SHIFT_AMOUNTS, at) { 31 } else { !0 };
            uniform[at] = registers[usize::from(superop.from[at])].0[0] & mask;
        } else if at + 1 != ACC_OPERAND {
            rows[at] = &registers[usize::from(superop.from[at])];
        }
    }
    let mut result = [0; LANES];
    for lane in 0..LANES {
        let mut words = uniform;
        for at in 0..F::OPERANDS {
            if !has_operand(UNIFORM, at) {
                words[at] = rows[at].0[lane];
            }
        }
        result[lane] = F::apply(words);
    }
    if STORED {
        registers[usize::from(superop.to)].0 = result;
    }
    *accumulator = result;
}

/// Does what [`apply`] does for the conversion of floats to integers: the compiler does not emit
/// the processor's conversion of eight lanes for a loop.
#[inline(always)]
pub(super) fn to_integers<V: LaneOps, const ACC_OPERAND: usize, const STORED: bool>(
    vectors: V,
    accumulator: &mut [u32; LANES],
    registers: &mut DirectRegisters,
    superop: &SuperOp,
) {
    const { assert!(LANES.is_multiple_of(8)) }
    let held = *accumulator;
    let floats = if ACC_OPERAND == 0 { &registers[usize::from(superop.from[0])].0 } else { &held };
    let mut result = [0; LANES];
    let floats = floats.as_chunks::<8>().0;
    for (at, to) in result.as_chunks_mut::<8>().0.iter_mut().enumerate() {
        *to = vectors.truncate_words(&floats[at]);
    }
    if STORED {
        registers[usize::from(superop.to)].0 = result;
    }
    *accumulator = result;
}

/// Stores the accumulator, or a register; if not every lane is active, only in the lanes whose word
/// in `running` is all ones.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline(always)]
pub(super) fn store<const ACC_OPERAND: usize>(
    accumulator: &mut [u32; LANES],
    registers: &mut DirectRegisters,
    superop: &SuperOp,
    running: Option<&Lanes<LANES>>,
) {
    if ACC_OPERAND == 0 {
        *accumulator = registers[usize::from(superop.from[0])].0;
    }
    let to = &mut registers[usize::from(superop.to)];
    match running {
        None => to.0 = *accumulator,
        Some(running) => {
            for lane in 0..LANES {
                let mask = running.0[lane];
                to.0[lane] = accumulator[lane] & mask | to.0[lane] & !mask;
            }
        }
    }
}
