//! What a superinstruction does with registers and the accumulator.

use crate::interp::superop::words::WordFunction;
use crate::machine::Lanes;
use crate::math::lane_ops::LaneOps;
use crate::ops::superop::function::has_operand;
use crate::ops::superop::{DIRECT_REGISTERS, SuperOp};

/// The direct registers.
pub(super) type DirectRegisters<const W: usize> = [Lanes<W>; DIRECT_REGISTERS];

/// Applies a function to registers and puts the result into the accumulator. Operand `ACC_OPERAND`,
/// counted from one, is the accumulator's old value (0 for none); if `STORED`, the result is stored
/// in its register, too. Operands whose bit is set in `UNIFORM` are the same in all lanes: one word
/// is read of each, and kept in a vector register. Those whose bit is set in `SHIFT_AMOUNTS` are
/// shift amounts less than 32.
#[allow(clippy::needless_range_loop, reason = "the shape that is vectorised")]
#[inline(always)]
pub(super) fn apply<
    const W: usize,
    F: WordFunction,
    const ACC_OPERAND: usize,
    const STORED: bool,
    const UNIFORM: u8,
    const SHIFT_AMOUNTS: u8,
>(
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
) {
    // Written out: closures would be compiled anew for each of the many instances of this function.
    let held = Lanes(*accumulator);
    let [a, b, c, d, e, f] = [
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 0) } {
            &registers[usize::from(superop.from[0])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 1) } {
            &registers[usize::from(superop.from[1])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 2) } {
            &registers[usize::from(superop.from[2])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 3) } {
            &registers[usize::from(superop.from[3])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 4) } {
            &registers[usize::from(superop.from[4])]
        } else {
            &held
        },
        if const { reads::<F>(ACC_OPERAND, UNIFORM, 5) } {
            &registers[usize::from(superop.from[5])]
        } else {
            &held
        },
    ];
    let words = [
        if const { has_operand(UNIFORM, 0) } { uniform(registers, superop, 0, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 1) } { uniform(registers, superop, 1, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 2) } { uniform(registers, superop, 2, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 3) } { uniform(registers, superop, 3, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 4) } { uniform(registers, superop, 4, SHIFT_AMOUNTS) } else { 0 },
        if const { has_operand(UNIFORM, 5) } { uniform(registers, superop, 5, SHIFT_AMOUNTS) } else { 0 },
    ];
    let mut result = [0; W];
    for lane in 0..W {
        result[lane] = F::apply([
            if const { has_operand(UNIFORM, 0) } { words[0] } else { a.0[lane] },
            if const { has_operand(UNIFORM, 1) } { words[1] } else { b.0[lane] },
            if const { has_operand(UNIFORM, 2) } { words[2] } else { c.0[lane] },
            if const { has_operand(UNIFORM, 3) } { words[3] } else { d.0[lane] },
            if const { has_operand(UNIFORM, 4) } { words[4] } else { e.0[lane] },
            if const { has_operand(UNIFORM, 5) } { words[5] } else { f.0[lane] },
        ]);
    }
    if STORED {
        registers[usize::from(superop.to)].0 = result;
    }
    *accumulator = result;
}

/// Whether an operand of a function is read lane by lane from its register: if the function has it,
/// and it is neither the accumulator nor uniform.
const fn reads<F: WordFunction>(accumulator: usize, uniform: u8, at: usize) -> bool {
    at < F::OPERANDS && at + 1 != accumulator && !has_operand(uniform, at)
}

/// The word of a uniform operand.
#[inline(always)]
fn uniform<const W: usize>(
    registers: &DirectRegisters<W>,
    superop: &SuperOp,
    at: usize,
    shift_amounts: u8,
) -> u32 {
    // The mask lets the compiler leave out a comparison with 32.
    registers[usize::from(superop.from[at])].0[0] & if has_operand(shift_amounts, at) { 31 } else { !0 }
}

/// Does what [`apply`] does for the conversion of floats to integers: the compiler does not emit
/// the processor's conversion of eight lanes for a loop.
#[inline(always)]
pub(super) fn to_integers<const W: usize, V: LaneOps, const ACC_OPERAND: usize, const STORED: bool>(
    vectors: V,
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
) {
    const { assert!(W.is_multiple_of(8)) }
    let held = *accumulator;
    let floats = if ACC_OPERAND == 0 { &registers[usize::from(superop.from[0])].0 } else { &held };
    let mut result = [0; W];
    for (eight, to) in floats.as_chunks::<8>().0.iter().zip(result.as_chunks_mut::<8>().0) {
        *to = vectors.to_i32(vectors.load(&eight.map(f32::from_bits))).map(|integer| integer as u32);
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
pub(super) fn store<const W: usize, const ACC_OPERAND: usize>(
    accumulator: &mut [u32; W],
    registers: &mut DirectRegisters<W>,
    superop: &SuperOp,
    running: Option<&Lanes<W>>,
) {
    if ACC_OPERAND == 0 {
        *accumulator = registers[usize::from(superop.from[0])].0;
    }
    let to = &mut registers[usize::from(superop.to)];
    match running {
        None => to.0 = *accumulator,
        Some(running) => {
            for lane in 0..W {
                let mask = running.0[lane];
                to.0[lane] = accumulator[lane] & mask | to.0[lane] & !mask;
            }
        }
    }
}
