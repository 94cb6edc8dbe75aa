use super::*;
use crate::ops::lane_kernel::OpFamily;
use crate::ops::memory;
use crate::ops::{arithmetic, bit, glsl};

fn kernel(family: &'static OpFamily, to: u32, from: [u32; 3]) -> Op {
    let kernel = family.kernel(32).expect("a kernel of 32 bits");
    Op::LaneKernel { kernel, to: Reg(to), from: from.map(Reg) }
}

fn subtract(to: u32, a: u32, b: u32) -> Op {
    kernel(&arithmetic::ISub, to, [a, b, b])
}

fn copy(to: u32, from: u32) -> Op {
    Op::Memory(memory::MemoryOp::Move { to: Reg(to), from: Reg(from) })
}

fn store(to: u32, from: u32) -> Op {
    Op::Memory(memory::MemoryOp::MoveMasked { to: Reg(to), from: Reg(from) })
}

/// The opcodes for operations that form one superblock. `reads` says how often each result is read,
/// where it is known; no float's NaN payload is observed.
fn opcodes<const N: usize>(ops: [Op; N], reads: [Option<u32>; N], constants: &[(Reg, u32)]) -> Vec<u16> {
    let uses = reads.map(|reads| ResultUse { reads, nan_payload_observed: false });
    let code = SuperCode::of(&ops, std::iter::once(0..N), &uses, constants);
    code.superops.iter().map(|superop| superop.opcode).collect()
}

#[test]
fn a_constant_in_the_accumulator_is_no_uniform_operand() {
    // Register 9 holds a constant, which a store leaves in the accumulator. Opcodes with a uniform
    // second operand have at most the first one in the accumulator.
    let constants = [(Reg(9), 5)];
    let found = opcodes([store(4, 9), subtract(5, 0, 9)], [None; 2], &constants);
    let move_masked = opcode(Function::MoveMasked, false, 0, true);
    assert_eq!(found, [move_masked, opcode(Function::ISub, false, 2, true)]);
    let found = opcodes([store(4, 0), subtract(5, 0, 9)], [None; 2], &constants);
    assert_eq!(found, [move_masked, opcode(Function::ISub, true, 1, true)]);
}

#[test]
fn any_of_three_operands_may_be_in_the_accumulator_and_only_the_first_of_a_chain() {
    let copied = opcode(Function::Move, false, 0, true);
    for (at, from) in [[3, 1, 2], [0, 3, 2], [0, 1, 3]].into_iter().enumerate() {
        let found = opcodes([copy(3, 7), kernel(&glsl::Fma, 5, from)], [None; 2], &[]);
        assert_eq!(found, [copied, opcode(Function::Fma, false, at + 1, true)], "{from:?}");
    }
    // A dot product of two components, whose first two operands may be swapped.
    let times = |to, a, b| kernel(&arithmetic::FMul, to, [a, b, b]);
    for ([a, b, c, d], acc_operand) in
        [([3, 1, 2, 6], 1), ([1, 3, 2, 6], 1), ([1, 2, 3, 6], 0), ([1, 2, 6, 3], 0)]
    {
        let plus = kernel(&arithmetic::FAdd, 12, [11, 10, 10]);
        let ops = [copy(3, 7), times(10, a, b), times(11, c, d), plus];
        let found = opcodes(ops, [None, Some(1), Some(1), None], &[]);
        let product = opcode(Function::DotProduct2, false, acc_operand, true);
        assert_eq!(found, [copied, product], "{a} * {b} + {c} * {d}");
    }
}

#[test]
fn a_pair_that_reads_an_operand_twice_counts_two_reads_of_the_accumulator() {
    // `x ^ (x >> y)`. The copy in register 4 is x, then y: read by nothing else, so not stored.
    let shift_xor = |x, y| {
        [copy(4, 0), kernel(&bit::ShiftRightLogical, 5, [x, y, y]), kernel(&bit::BitwiseXor, 6, [x, 5, 5])]
    };
    for (x, y, reads) in [(4, 1, 2), (1, 4, 1)] {
        for (reads, stored) in [(reads, false), (reads + 1, true)] {
            let found = opcodes(shift_xor(x, y), [Some(reads), Some(1), None], &[]);
            let pair = opcode(Function::ShiftXor, false, if x == 4 { 1 } else { 2 }, true);
            assert_eq!(found, [opcode(Function::Move, false, 0, stored), pair], "{x} {y}, {reads} reads");
        }
    }
    // `z ^ (x >> y)` is no pair.
    let shift = kernel(&bit::ShiftRightLogical, 5, [0, 1, 1]);
    let found = opcodes([shift, kernel(&bit::BitwiseXor, 6, [2, 5, 5])], [Some(1), None], &[]);
    let single = |function, acc_operand, stored| opcode(function, false, acc_operand, stored);
    assert_eq!(
        found,
        [single(Function::ShiftRightLogical, 0, false), single(Function::BitwiseXor, 1, true),]
    );
}

#[test]
fn the_accumulator_holds_nothing_after_an_irregular_operation() {
    let other = opcode(Function::Other, false, 0, true);
    let found = opcodes([copy(3, 7), Op::Barrier, subtract(5, 0, 3)], [Some(1), Some(1), None], &[]);
    assert_eq!(
        found,
        [opcode(Function::Move, false, 0, true), other, opcode(Function::ISub, false, 0, true),]
    );
}

#[test]
fn a_store_keeps_the_accumulator_or_fills_it() {
    let masked = |acc_operand| opcode(Function::MoveMasked, false, acc_operand, true);
    let difference = opcode(Function::ISub, false, 1, true);
    let found = opcodes([store(4, 0), subtract(5, 0, 1)], [None; 2], &[]);
    assert_eq!(found, [masked(0), difference]);
    // Both reads of the copy are from the accumulator: it is not stored.
    let found = opcodes([copy(3, 0), store(4, 3), subtract(5, 3, 1)], [Some(2), None, None], &[]);
    assert_eq!(found, [opcode(Function::Move, false, 0, false), masked(1), difference]);
}

#[test]
fn operands_that_a_kernel_does_not_have_may_be_extended() {
    let single = |op| opcodes([op], [None], &[])[0];
    let other = opcode(Function::Other, false, 0, true);
    assert_eq!(
        single(kernel(&arithmetic::SNegate, 5, [0, 300, 300])),
        opcode(Function::SNegate, false, 0, true)
    );
    assert_eq!(single(kernel(&arithmetic::ISub, 5, [0, 1, 300])), opcode(Function::ISub, false, 0, true));
    for [to, a, b] in [[5, 0, 256], [5, 256, 0], [256, 0, 1]] {
        assert_eq!(single(subtract(to, a, b)), other, "{to} {a} {b}");
    }
    assert_eq!(single(subtract(255, 255, 255)), opcode(Function::ISub, false, 0, true));
}

#[test]
fn a_chain_reads_its_first_operand_as_often_as_its_first_function_does() {
    let result_use = ResultUse { reads: Some(1), nan_payload_observed: false };
    let planned = |function, to, from, operands, reads_first_twice| {
        let from = super::operands(from);
        Planned { function, to, from, operands, result_use, reads_first_twice, float: true, op: 0 }
    };
    for reads_first_twice in [false, true] {
        let first = planned(Function::NegMulAdd, 10, [0, 1, 2], 3, reads_first_twice);
        let both = pair(&first, &planned(Function::FMul, 11, [10, 3, 3], 2, false)).expect("a chain");
        assert_eq!((both.function, &both.from[..both.operands]), (Function::NegMulAddMul, &[0, 1, 2, 3][..]));
        assert_eq!(both.reads_first_twice, reads_first_twice);
    }
}
