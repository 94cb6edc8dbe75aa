use super::*;
use crate::machine::{Reg, Registers};
use crate::ops::conversion::{self, Conversion};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::superop::function::{Function, has_operand, opcode};

/// Zeros, ordinary numbers, the least and the greatest, infinity, and three NaNs with different
/// bits.
pub(crate) const SPECIAL: [u32; 16] = [
    0,
    0x8000_0000,
    0x3F80_0001,
    0xC120_0000,
    1,
    0x7F7F_FFFF,
    0x7F80_0000,
    0x0000_4321,
    0xFF80_0000,
    0x7FC0_0000,
    0xFFC0_0000,
    0x7FA0_0005,
    0x4EFF_FFFF,
    0xFFFF_FFFF,
    0x3F00_0000,
    0x0000_001F,
];

/// How many rounds bring every combination of three special numbers.
pub(crate) const ROUNDS: u32 = 64;

/// Registers 0 to 2 hold special numbers, in every combination over the lanes of all rounds.
pub(crate) fn registers(round: u32) -> Registers<64> {
    let mut registers = Registers::new(DIRECT_REGISTERS);
    for operand in 0..3u32 {
        for lane in 0..64u32 {
            let pick = (round * 64 + lane) >> (4 * operand) & 15;
            registers[Reg(operand)].0[lane as usize] = SPECIAL[pick as usize];
        }
    }
    registers
}

/// How many operands a kernel has.
pub(crate) fn operands(kernel: &LaneKernel) -> usize {
    kernel.operands.iter().take_while(|&&words| words > 0).count()
}

#[test]
fn a_float_operand_treats_all_nans_alike() {
    const NANS: [u32; 5] = [0x7FC0_0000, 0xFFC0_0000, 0x7FA0_0005, 0xFF80_0001, 0xFFFF_FFFF];
    let families = crate::ops::SECTIONS.iter().flat_map(|section| section.iter().copied());
    let conversions = [Conversion::FToS, Conversion::FToU, Conversion::F]
        .into_iter()
        .flat_map(|kind| [8, 16, 32, 64].into_iter().filter_map(move |to| conversion::kernel(kind, 32, to)));
    let mut count = 0;
    for kernel in families.flat_map(|family| family.kernels).chain(conversions) {
        for operand in (0..operands(kernel)).filter(|&operand| takes_float(kernel, operand)) {
            count += 1;
            for round in 0..ROUNDS {
                // The registers of the operands follow each other.
                let from = [Reg(0), Reg(kernel.operands[0]), Reg(kernel.operands[0] + kernel.operands[1])];
                let results = NANS.map(|nan| {
                    let mut ran = registers(round);
                    ran[from[operand]].0 = [nan; 64];
                    Width::<64>::run(kernel, &mut ran, Reg(8), &from);
                    [ran[Reg(8)], ran[Reg(9)]]
                });
                assert!(results.iter().all(|result| *result == results[0]), "{kernel:?}, operand {operand}");
            }
        }
    }
    assert!(count > 80, "{count}");
}

#[test]
fn an_opcode_has_its_parts_side_by_side() {
    // From the lowest bit: whether it is stored, two bits for the operand, whether some are
    // uniform, and the number of the function, which is 1.
    assert_eq!(opcode(Function::MoveMasked, true, 2, true), 0b11101);
    assert_eq!(opcode(Function::MoveMasked, false, 3, false), 0b10110);
    assert_eq!(opcode(Function::Move, false, 0, false), 0);
    let operands = [(0, 0), (0b10, 0), (0b10, 1), (0b10, 2), (0b101, 2)];
    assert_eq!(operands.map(|(mask, at)| has_operand(mask, at)), [false, false, true, false, true]);
}
