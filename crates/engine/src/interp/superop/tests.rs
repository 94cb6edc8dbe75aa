use super::*;
use crate::machine::Reg;
use crate::math::lane_ops::CpuTier;
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::superop::ResultUse;
use crate::ops::superop::function::{PairShape, has_operand, opcode};
use crate::ops::superop::tests::{ROUNDS, SPECIAL, operands, registers};
use crate::ops::{arithmetic, glsl, memory};

fn kernel(kernel: &'static LaneKernel, to: u32, from: [u32; 3]) -> Op {
    Op::LaneKernel { kernel, to: Reg(to), from: from.map(Reg) }
}

fn copy(to: u32, from: u32) -> Op {
    Op::Memory(memory::MemoryOp::Move { to: Reg(to), from: Reg(from) })
}

/// The superinstructions of operations that form one superblock.
fn superops(ops: &[Op], uses: &[ResultUse]) -> SuperCode {
    with_constants(ops, uses, &[])
}

fn with_constants(ops: &[Op], uses: &[ResultUse], constants: &[(Reg, u32)]) -> SuperCode {
    SuperCode::of(ops, std::iter::once(0..ops.len()), uses, constants)
}

/// Runs superinstructions on every tier that the processor has and checks that the results agree.
fn run(
    code: &SuperCode,
    registers: &mut Registers<64>,
    ops: &[Op],
    range: Range<u32>,
    mask: Mask<64>,
) -> u32 {
    let wide = CpuTier::available().into_iter().filter(|(_, cpu_tier)| cpu_tier.is_wide());
    let mut results = wide.map(|(level, cpu_tier)| {
        let mut ran = registers.clone().with_cpu_tier(cpu_tier);
        let end = super::run(code, &mut ran, ops, range.clone(), mask);
        (level, ran, end)
    });
    let (narrowest, mut first, end) = results.next().expect("a processor that runs superinstructions");
    for (level, mut other, other_end) in results {
        assert_eq!((first.all_mut(), end), (other.all_mut(), other_end), "{level} beside {narrowest}");
    }
    *registers = first;
    end
}

/// The registers after the operations ran one by one.
fn one_by_one(ops: &[Op], round: u32) -> Registers<64> {
    let mut registers = registers(round);
    for op in ops {
        match op {
            Op::LaneKernel { kernel, to, from } => Width::<64>::run(*kernel, &mut registers, *to, from),
            Op::Memory(memory::MemoryOp::Move { to, from }) => registers.copy(*to, *from, Mask::ALL),
            _ => unreachable!("a regular operation"),
        }
    }
    registers
}

/// A result that only the next operation reads, which may observe the payload of a NaN or not.
const fn once(nan_payload_observed: bool) -> ResultUse {
    ResultUse { reads: Some(1), nan_payload_observed }
}

/// Makes the words of boolean operands 0 or 1.
fn make_boolean(kernel: &LaneKernel, registers: &mut Registers<64>) {
    let boolean = match kernel.name {
        "SelectWord" => 0..1,
        name if name.starts_with("Logical") => 0..2,
        _ => return,
    };
    for at in boolean {
        registers[Reg(at)].0.iter_mut().for_each(|word| *word &= 1);
    }
}

#[test]
fn every_function_gives_what_its_kernel_gives_from_registers_and_from_the_accumulator() {
    let kernels = Function::kernels();
    assert!(kernels.len() > 60, "{}", kernels.len());
    for (function, _) in kernels {
        for at in 0..=operands(function) {
            // A copy runs first, and its result is operand `at`: stored, or not.
            let mut from = [0, 1, 2];
            let mut ops = Vec::new();
            if at > 0 {
                ops.push(copy(4, at as u32 - 1));
                from[at - 1] = 4;
            }
            ops.push(kernel(function, 5, from));
            for result_use in [ResultUse::UNKNOWN, once(true)] {
                let code =
                    superops(&ops, &[vec![result_use; ops.len() - 1], vec![ResultUse::UNKNOWN]].concat());
                for round in 0..ROUNDS {
                    let mut ran = registers(round);
                    make_boolean(function, &mut ran);
                    let mut expected = ran.clone();
                    let ended = run(&code, &mut ran, &ops, 0..ops.len() as u32, Mask::ALL);
                    assert_eq!(ended, ops.len() as u32);
                    Width::<64>::run(function, &mut expected, Reg(5), &[Reg(0), Reg(1), Reg(2)]);
                    assert_eq!(
                        ran[Reg(5)],
                        expected[Reg(5)],
                        "{function:?} with operand {at} in the accumulator"
                    );
                }
            }
        }
    }
}

/// A kernel with its function: a function that no kernel has is that of a pair.
type KernelFunction = (&'static LaneKernel, Function);

/// Both functions of a pair, and how they are composed.
fn functions_of_pair(pair: Function) -> (Function, Function, PairShape) {
    let &(first, second, shape, _) =
        Function::PAIRS.iter().find(|known| known.3 == pair).expect("a pair, as it is no kernel");
    (first, second, shape)
}

/// How many operands a function has.
fn count(function: Function, kernels: &[KernelFunction]) -> usize {
    if let Some(&(single, _)) = kernels.iter().find(|known| known.1 == function) {
        return operands(single);
    }
    let (first, second, shape) = functions_of_pair(function);
    match shape {
        PairShape::WithItself => count(first, kernels),
        _ => count(first, kernels) + count(second, kernels) - 1,
    }
}

/// Appends the operations that a function is composed of, and returns the register of the result.
fn parts(function: Function, from: &[u32], kernels: &[KernelFunction], ops: &mut Vec<Op>) -> u32 {
    if let Some(&(single, _)) = kernels.iter().find(|known| known.1 == function) {
        let to = ops.len() as u32 + 3;
        ops.push(kernel(single, to, [0, 1, 2].map(|at| from[at.min(from.len() - 1)])));
        return to;
    }
    let (first, second, shape) = functions_of_pair(function);
    let (before, rest) = from.split_at(count(first, kernels));
    let first_result = parts(first, before, kernels, ops);
    let operands = match shape {
        PairShape::Then | PairShape::ThenWith | PairShape::Chain => [&[first_result], rest].concat(),
        PairShape::After | PairShape::Last => [rest, &[first_result]].concat(),
        PairShape::WithItself => vec![from[0], first_result],
    };
    parts(second, &operands, kernels, ops)
}

/// The uses of the results of operations that [`parts`] appended, of which only the last result is
/// observed.
fn uses(ops: &[Op]) -> Vec<ResultUse> {
    let reads = |of: Reg| {
        let named = ops.iter().map(|op| match op {
            Op::LaneKernel { kernel, from, .. } => {
                from[..operands(kernel)].iter().filter(|&&from| from == of).count()
            }
            _ => 0,
        });
        named.sum::<usize>() as u32
    };
    let mut uses: Vec<ResultUse> = (0..ops.len() as u32)
        .map(|at| ResultUse { reads: Some(reads(Reg(at + 3))), nan_payload_observed: false })
        .collect();
    uses[ops.len() - 1] = ResultUse::UNKNOWN;
    uses
}

#[test]
fn a_pair_is_its_operations() {
    let kernels = Function::kernels();
    for &(.., pair) in Function::PAIRS {
        let mut ops = Vec::new();
        let from: Vec<u32> = (0..count(pair, &kernels) as u32).map(|at| at % 3).collect();
        let last = Reg(parts(pair, &from, &kernels, &mut ops));
        let code = superops(&ops, &uses(&ops));
        assert_eq!((code.superops[0].opcode >> 4, code.superops.len() <= 2), (pair as u16, true), "{ops:?}");
        for round in 0..ROUNDS {
            let mut ran = registers(round);
            run(&code, &mut ran, &ops, 0..ops.len() as u32, Mask::ALL);
            assert_eq!(ran[last], one_by_one(&ops, round)[last], "{ops:?}");
        }
    }
}

#[test]
fn uniform_operands_give_what_their_registers_give() {
    const AMOUNT: Reg = Reg(14);
    const OTHER: Reg = Reg(15);
    let kernels = Function::kernels();
    let pairs = Function::PAIRS.iter().map(|pair| pair.3);
    let functions = kernels.iter().map(|&(_, function)| function).chain(pairs);
    let mut count_uniform = 0;
    for function in functions.filter(|function| function.uniform() != 0) {
        let boolean =
            kernels.iter().any(|&(kernel, of)| of == function && kernel.name.starts_with("Logical"));
        for (at, special) in SPECIAL.into_iter().enumerate() {
            // Shifts by 0, 1 and 31 bits; an amount of 32 is no uniform operand and is read per
            // lane.
            let amount = [0, 1, 31, 32][at % 4];
            let constants = [(AMOUNT, amount), (OTHER, if boolean { special & 1 } else { special })];
            let of = |operand: usize| match (
                has_operand(function.shift_amounts(), operand),
                has_operand(function.uniform(), operand),
            ) {
                (true, _) => AMOUNT.0,
                (_, true) => OTHER.0,
                _ => operand as u32 % 3,
            };
            let mut from: Vec<u32> = (0..count(function, &kernels)).map(of).collect();
            for in_accumulator in [false, true] {
                let mut ops = Vec::new();
                if in_accumulator {
                    ops.push(copy(3, 0));
                    from[0] = 3;
                }
                let last = Reg(parts(function, &from, &kernels, &mut ops));
                let code = with_constants(&ops, &uses(&ops), &constants);
                let found = code.superops[usize::from(in_accumulator)].opcode;
                let uniform = amount < 32 || function.shift_amounts() == 0;
                let expected = opcode(function, uniform, usize::from(in_accumulator), false);
                assert_eq!(found & !1, expected, "{function:?} of {ops:?}");
                count_uniform += u32::from(uniform);
                for round in 0..ROUNDS {
                    let mut ran = registers(round);
                    constants.iter().for_each(|&(reg, word)| ran[reg].0 = [word; 64]);
                    if boolean {
                        (0..3)
                            .for_each(|register| ran[Reg(register)].0.iter_mut().for_each(|word| *word &= 1));
                    }
                    let mut one_by_one = ran.clone();
                    for op in &ops {
                        match op {
                            Op::LaneKernel { kernel, to, from } => {
                                Width::<64>::run(*kernel, &mut one_by_one, *to, from)
                            }
                            _ => one_by_one.copy(Reg(3), Reg(0), Mask::ALL),
                        }
                    }
                    run(&code, &mut ran, &ops, 0..ops.len() as u32, Mask::ALL);
                    assert_eq!(ran[last], one_by_one[last], "{function:?} of {ops:?}, {constants:x?}");
                }
            }
        }
    }
    assert!(count_uniform > 1000, "{count_uniform}");
}

#[test]
fn a_constant_factor_becomes_the_second_operand() {
    // 2.5 x, with x = 3. Only the first lane of a constant's register is read.
    let times = arithmetic::FMul.kernel(32).expect("a kernel");
    let ops = [kernel(times, 3, [4, 0, 4])];
    let code = with_constants(&ops, &[ResultUse::UNKNOWN], &[(Reg(4), 2.5f32.to_bits())]);
    assert_eq!(code.superops[0].opcode, opcode(Function::FMul, true, 0, false));
    assert_eq!(code.superops[0].from[..2], [0, 4]);
    let mut ran = registers(0);
    ran[Reg(0)].0 = [3f32.to_bits(); 64];
    ran[Reg(4)].0 = [f32::NAN.to_bits(); 64];
    ran[Reg(4)].0[0] = 2.5f32.to_bits();
    run(&code, &mut ran, &ops, 0..1, Mask::ALL);
    assert_eq!(ran[Reg(3)].0, [7.5f32.to_bits(); 64]);
}

#[test]
fn a_square_reads_no_register() {
    // (x - y)^2 with x = 3 and y = 5; the difference is not stored.
    let [minus, times] =
        [&arithmetic::FSub, &arithmetic::FMul].map(|family| family.kernel(32).expect("a kernel"));
    let ops = [kernel(minus, 3, [0, 1, 0]), kernel(times, 4, [3, 3, 3])];
    let twice = ResultUse { reads: Some(2), nan_payload_observed: false };
    let code = superops(&ops, &[twice, ResultUse::UNKNOWN]);
    let codes: Vec<u16> = code.superops.iter().map(|superop| superop.opcode).collect();
    let expected =
        [(Function::FSub, 0, false), (Function::Square, 1, false), (Function::CanonicalizeNan, 1, true)];
    assert_eq!(codes, expected.map(|(function, at, stored)| opcode(function, false, at, stored)));
    let mut ran = registers(0);
    ran[Reg(0)].0 = [3f32.to_bits(); 64];
    ran[Reg(1)].0 = [5f32.to_bits(); 64];
    run(&code, &mut ran, &ops, 0..2, Mask::ALL);
    assert_eq!(ran[Reg(4)].0, [4f32.to_bits(); 64]);
}

#[test]
fn a_clamp_is_a_greater_and_a_lesser_of_two() {
    let families = [&glsl::FClamp, &glsl::NClamp, &glsl::UClamp, &glsl::SClamp];
    for clamp in families.map(|family| family.kernel(32).expect("a kernel")) {
        let ops = [kernel(clamp, 3, [0, 1, 2])];
        let code = superops(&ops, &[ResultUse::UNKNOWN]);
        assert!(code.superops.iter().all(|superop| superop.opcode >> 4 != Function::Other as u16));
        for round in 0..ROUNDS {
            let mut ran = registers(round);
            run(&code, &mut ran, &ops, 0..1, Mask::ALL);
            assert_eq!(ran[Reg(3)], one_by_one(&ops, round)[Reg(3)], "{clamp:?}");
        }
    }
}

#[test]
fn a_result_that_only_the_next_superop_reads_is_not_stored() {
    let [add, times] =
        [&arithmetic::FSub, &arithmetic::FDiv].map(|family| family.kernel(32).expect("a kernel"));
    let ops = [kernel(add, 3, [0, 1, 0]), kernel(times, 4, [3, 2, 3]), kernel(add, 5, [2, 4, 2])];
    let code = superops(&ops, &[once(false), once(false), ResultUse::UNKNOWN]);
    for round in 0..ROUNDS {
        let mut ran = registers(round);
        run(&code, &mut ran, &ops, 0..3, Mask::ALL);
        assert_eq!(ran[Reg(5)], one_by_one(&ops, round)[Reg(5)]);
        assert_eq!([ran[Reg(3)].0, ran[Reg(4)].0], [[0; 64]; 2]);
    }
}

#[test]
fn a_nan_whose_payload_is_observed_is_canonical() {
    // Infinity minus itself, stored, or read as a float: quiet, positive, no payload.
    let subtract = arithmetic::FSub.kernel(32).expect("a kernel");
    let ops = [kernel(subtract, 3, [0, 0, 0]), kernel(subtract, 4, [3, 1, 3])];
    for nan_payload_observed in [true, false] {
        let code = superops(&ops, &[ResultUse { reads: None, nan_payload_observed }, ResultUse::UNKNOWN]);
        let mut ran = registers(0);
        ran[Reg(0)].0 = [0x7F80_0000; 64];
        run(&code, &mut ran, &ops, 0..2, Mask::ALL);
        assert_eq!(ran[Reg(4)].0, [0x7FC0_0000; 64]);
        if nan_payload_observed {
            assert_eq!(ran[Reg(3)].0, [0x7FC0_0000; 64]);
        }
    }
}

#[test]
fn a_masked_store_leaves_inactive_lanes_unchanged() {
    let ops = [
        copy(4, 0),
        Op::Memory(memory::MemoryOp::MoveMasked { to: Reg(5), from: Reg(4) }),
        kernel(arithmetic::IAdd.kernel(32).expect("a kernel"), 6, [5, 4, 5]),
    ];
    let code = superops(
        &ops,
        &[ResultUse { reads: Some(2), nan_payload_observed: true }, ResultUse::UNKNOWN, ResultUse::UNKNOWN],
    );
    let mut ran = registers(1);
    ran[Reg(5)].0 = [7; 64];
    run(&code, &mut ran, &ops, 0..3, Mask::first(3));
    for lane in 0..64 {
        let word = ran[Reg(0)].0[lane];
        let stored = if lane < 3 { word } else { 7 };
        assert_eq!((ran[Reg(5)].0[lane], ran[Reg(6)].0[lane]), (stored, stored.wrapping_add(word)));
    }
}

#[test]
fn a_float_is_canonicalized_and_stored_by_one_superop() {
    // Infinity minus itself is stored to a variable only, in the active lanes: positive, no
    // payload.
    let subtract = arithmetic::FSub.kernel(32).expect("a kernel");
    let ops = [
        kernel(subtract, 3, [0, 0, 0]),
        Op::Memory(memory::MemoryOp::MoveMasked { to: Reg(4), from: Reg(3) }),
        kernel(arithmetic::IAdd.kernel(32).expect("a kernel"), 5, [4, 4, 4]),
    ];
    let code = superops(&ops, &[once(true), ResultUse::UNKNOWN, ResultUse::UNKNOWN]);
    assert_eq!(code.superops.len(), 3);
    let mut ran = registers(0);
    ran[Reg(0)].0 = [0xFF80_0000; 64];
    ran[Reg(4)].0 = [7; 64];
    run(&code, &mut ran, &ops, 0..3, Mask::first(5));
    for lane in 0..64 {
        let stored: u32 = if lane < 5 { 0x7FC0_0000 } else { 7 };
        assert_eq!((ran[Reg(4)].0[lane], ran[Reg(5)].0[lane]), (stored, stored.wrapping_add(stored)));
    }
}

#[test]
fn superops_end_before_an_irregular_operation_and_leave_out_moves_to_the_same_register() {
    let ops = [copy(5, 0), copy(1, 1), copy(2, 2), copy(6, 5), Op::Barrier, copy(7, 6)];
    let code = superops(&ops, &[ResultUse::UNKNOWN; 6]);
    assert_eq!(code.superops.len(), 4);
    let mut ran = registers(0);
    assert_eq!(run(&code, &mut ran, &ops, 0..6, Mask::ALL), 4);
    assert_eq!(ran[Reg(6)], ran[Reg(0)]);
    assert_eq!(ran[Reg(7)].0, [0; 64]);
    assert_eq!(run(&code, &mut ran, &ops, 5..6, Mask::ALL), 6);
    assert_eq!(ran[Reg(7)], ran[Reg(0)]);
}
