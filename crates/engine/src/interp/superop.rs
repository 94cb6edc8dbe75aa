//! The loop over superinstructions ([`crate::ops::superop`]).
//!
//! Each opcode is an arm of one `match`, a loop over the lanes, and the `match` is compiled as a
//! whole for the processor's vectors. The accumulator is a local array that the compiler keeps in
//! vector registers from one superinstruction to the next.

mod apply;
mod functions;
mod match_opcode;
mod words;

use std::ops::Range;

use crate::interp::superop::apply::{DirectRegisters, LANES, apply, store, to_integers};
use crate::interp::superop::match_opcode::match_opcode;
use crate::machine::{Lanes, Mask, Registers};
use crate::math::lane_ops::{LaneOps, LaneTask};
use crate::ops::lane_kernel::Width;
use crate::ops::op::Op;
use crate::ops::superop::function::{Function, opcodes};
use crate::ops::superop::table::for_each_superop;
use crate::ops::superop::{SuperCode, SuperOp};

/// Runs a range of operations up to one that is no superinstruction and no lane kernel. Returns
/// that operation, or the end of the range.
#[inline]
pub(super) fn run(
    supercode: &SuperCode,
    registers: &mut Registers<LANES>,
    ops: &[Op],
    range: Range<u32>,
    mask: Mask<LANES>,
) -> u32 {
    let Range { start: mut first, end } = supercode.range(&range);
    let cpu_tier = registers.cpu_tier();
    let running = (!mask.is_all()).then(|| {
        cpu_tier.run_loop(
            #[inline(always)]
            || mask.words(),
        )
    });
    loop {
        first += run_until_exit(registers, &supercode.superops[first..end], running.as_ref());
        let Some(&op) = supercode.op_of[..end].get(first) else { return range.end };
        // A lane kernel that has no opcode is called as a function.
        let Op::LaneKernel { kernel, to, from } = &ops[op as usize] else { return op };
        kernel.run(registers, *to, from);
        first += 1;
    }
}

/// Runs superinstructions. Returns how many ran before one that leaves the loop.
///
/// Not inlined, as the loop would then be compiled in each crate that runs a batch.
fn run_until_exit(
    registers: &mut Registers<LANES>,
    superops: &[SuperOp],
    running: Option<&Lanes<LANES>>,
) -> usize {
    let cpu_tier = registers.cpu_tier();
    let registers = registers.all_mut().first_chunk_mut().expect("every batch has the direct registers");
    let ran = cpu_tier.run_wide(Loop { registers, superops, running });
    ran.expect("superinstructions run on a CPU with wide registers")
}

/// The interpreter loop with its arguments.
struct Loop<'a> {
    registers: &'a mut DirectRegisters,
    superops: &'a [SuperOp],
    /// All ones in the active lanes; `None` if every lane is active.
    running: Option<&'a Lanes<LANES>>,
}

impl LaneTask for Loop<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<V: LaneOps>(self, vectors: V) -> usize {
        run_superops(vectors, self.registers, self.superops, self.running)
    }
}

/// Runs superinstructions. Returns how many ran before one that leaves the loop.
#[inline(always)]
fn run_superops<V: LaneOps>(
    vectors: V,
    registers: &mut DirectRegisters,
    superops: &[SuperOp],
    running: Option<&Lanes<LANES>>,
) -> usize {
    let mut accumulator = [0; LANES];
    let acc = &mut accumulator;
    let mut rest = superops.iter();
    while let Some(superop) = rest.next() {
        // A `match` of the opcode: these arms, and those of the list.
        for_each_superop! { match_opcode (acc, registers, superop) {
            opcodes::Move::NO_ACC => apply::<V, functions::Move, 0, false, 0, 0>(acc, registers, superop),
            opcodes::Move::ACC_FIRST => {}
            opcodes::Move::NO_ACC_STORED => apply::<V, functions::Move, 0, true, 0, 0>(acc, registers, superop),
            opcodes::Move::ACC_FIRST_STORED => apply::<V, functions::Move, 1, true, 0, 0>(acc, registers, superop),
            opcodes::MoveMasked::NO_ACC_STORED => store::<0>(acc, registers, superop, running),
            opcodes::MoveMasked::ACC_FIRST_STORED => store::<1>(acc, registers, superop, running),
            opcodes::CanonicalizeNanMasked::ACC_FIRST_STORED => {
                apply::<V, functions::CanonicalizeNan, 1, false, 0, 0>(acc, registers, superop);
                store::<1>(acc, registers, superop, running);
            }
            opcodes::FToS::NO_ACC => to_integers::<V, 0, false>(vectors, acc, registers, superop),
            opcodes::FToS::NO_ACC_STORED => to_integers::<V, 0, true>(vectors, acc, registers, superop),
            opcodes::FToS::ACC_FIRST => to_integers::<V, 1, false>(vectors, acc, registers, superop),
            opcodes::FToS::ACC_FIRST_STORED => to_integers::<V, 1, true>(vectors, acc, registers, superop),
            opcodes::Square::ACC_FIRST => apply::<V, functions::Square, 1, false, 0, 0>(acc, registers, superop),
            opcodes::Square::ACC_FIRST_STORED => {
                apply::<V, functions::Square, 1, true, 0, 0>(acc, registers, superop);
            }
            opcodes::CanonicalizeNan::ACC_FIRST => {
                apply::<V, functions::CanonicalizeNan, 1, false, 0, 0>(acc, registers, superop);
            }
            opcodes::CanonicalizeNan::ACC_FIRST_STORED => {
                apply::<V, functions::CanonicalizeNan, 1, true, 0, 0>(acc, registers, superop);
            }
        } else {
            return superops.len() - rest.len() - 1
        } }
    }
    superops.len()
}

#[cfg(test)]
mod tests;
