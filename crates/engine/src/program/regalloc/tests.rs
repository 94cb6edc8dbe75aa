use super::*;
use crate::ops::arithmetic::{FAdd, FMul, IAdd};
use crate::ops::glsl::Ldexp;
use crate::ops::lane_kernel::OpFamily;
use crate::program::written_program::{
    EXIT, add, add_pairs, branch, branch_if, copy, index, load, one_block, output, program, store,
};

#[test]
fn a_shader_has_fewer_registers_and_moves() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../spirv-fixtures/bench/arithmetic.rgen.spv");
    let module = crate::module::Module::open(path).expect("a valid fixture");
    let program = Program::of(&module, "main").expect("a supported fixture");
    assert_eq!(program.optimized.ops.len(), program.ops.len());
    let named = |ops: &[Op]| {
        let mut registers = std::collections::HashSet::new();
        for op in ops.iter().filter(|op| !op.is_noop()) {
            op.accesses(|access| {
                if let Access::Read(first, count) | Access::Write(first, count) = access {
                    registers.extend(first.0..first.0 + count);
                }
            });
        }
        registers.len()
    };
    let (before, after) = (named(&program.ops), named(&program.optimized.ops));
    assert!(after * 2 < before, "{after} registers of {before}");
    let moves = |ops: &[Op]| {
        let is_move = |op: &&Op| op.copy().is_some() && !op.is_noop();
        ops.iter().filter(is_move).count()
    };
    assert!(moves(&program.optimized.ops) < moves(&program.ops));
}

#[test]
fn what_was_shifted_to_the_right_is_converted_as_signed() {
    let shift = bit::ShiftRightLogical.kernel(32).expect("a kernel of 32 bits");
    let [unsigned, signed] = [Conversion::UToF, Conversion::SToF]
        .map(|cast| conversion::kernel(cast, 32, 32).expect("a kernel of 32 bits"));
    let kernel = |kernel, to, from| Op::LaneKernel { kernel, to: Reg(to), from: [Reg(from), Reg(9), Reg(9)] };
    // Shifts by one bit at least and by none, and a register that is written after the shift.
    for (by, between, expected) in [(1, 5, signed), (31, 5, signed), (0, 5, unsigned), (8, 1, unsigned)] {
        let mut ops = [kernel(shift, 1, 0), kernel(unsigned, between, 3), kernel(unsigned, 2, 1)];
        use_signed_conversions(&mut ops, &[(Reg(9), by)]);
        assert_eq!(ops[2], kernel(expected, 2, 1), "by {by}, with {between} written between");
    }
}

#[test]
fn the_register_of_a_constant_is_not_written() {
    // Superinstructions read one lane of it for all. Code with observers does write registers
    // that renamed constants took, but runs in batches of its own.
    let folder = format!("{}/spirv-fixtures/bench", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let mut programs = 0;
    for file in std::fs::read_dir(folder).expect("the fixtures' folder") {
        let path = file.expect("a fixture").path();
        let module = crate::module::Module::open(&path).expect("a valid fixture");
        let program = Program::of(&module, "main").expect("a supported fixture");
        programs += 1;
        for op in program.optimized.ops.iter().filter(|op| !op.is_noop()) {
            op.accesses(|access| {
                let Access::Write(first, count) = access else { return };
                let written = first.0..first.0 + count;
                let constant = program.constants.iter().find(|(reg, _)| written.contains(&reg.0));
                assert_eq!(constant, None, "{op:?} of {}", path.display());
            });
        }
    }
    assert!(programs > 10, "{programs}");
}

/// The superblocks of a program, with the blocks at which they begin.
fn starts(program: &Program) -> Vec<(BlockIndex, Superblock)> {
    superblock_starts(program, &superblocks(program))
}

fn local_values(program: &Program, addressed: &[(Reg, u32)]) -> LocalValues {
    let aliased = AliasedRegisters::of(program, addressed);
    LocalValues::of(program, &mut program.ops.clone(), &starts(program), &aliased)
}

#[test]
fn blocks_that_only_follow_one_another_form_a_superblock() {
    let block = |terminator| (vec![add(1, 2, 2)], terminator);
    // Block 2 falls through to block 3, which block 1 branches to, too; block 4 loops.
    let mut found = program(
        10,
        vec![
            block(branch(1)),
            block(branch_if(1, 2, 3)),
            block(branch(3)),
            block(branch(4)),
            block(branch(4)),
        ],
    );
    let superblock = |end, last| Superblock { end: OpIndex(end), last: BlockIndex(last) };
    let own = [superblock(2, 1), superblock(2, 1), superblock(3, 2), superblock(4, 3), superblock(5, 4)];
    assert_eq!(superblocks(&found), own);
    let begins: Vec<u32> = starts(&found).iter().map(|(block, _)| block.0).collect();
    assert_eq!(begins, [0, 2, 3, 4]);
    // Three in a row, and two that follow one another while their operations do not.
    found = program(10, vec![block(branch(1)), block(branch(2)), block(EXIT)]);
    assert_eq!(superblocks(&found), [superblock(3, 2); 3]);
    (found.blocks[1].first, found.blocks[1].end) = (OpIndex(2), OpIndex(3));
    (found.blocks[2].first, found.blocks[2].end) = (OpIndex(1), OpIndex(2));
    assert_eq!(superblocks(&found), [superblock(1, 0), superblock(3, 1), superblock(2, 2)]);
}

#[test]
fn a_local_value_is_written_and_then_read_in_one_superblock() {
    let first = vec![
        add(10, 1, 1),
        add(11, 10, 10),
        // Nothing reads it.
        add(12, 1, 1),
        // It holds a value from before.
        add(30, 13, 13),
        add(13, 1, 1),
        add(14, 1, 1),
        // Registers 15 and 16 are one operand.
        add(15, 1, 1),
        add(16, 1, 1),
        output(15, 2, None),
        add(17, 1, 1),
        add(18, 1, 1),
        add(20, 1, 1),
        add(20, 20, 1),
    ];
    let blocks = vec![(first, branch_if(11, 1, 2)), (vec![add(14, 2, 2)], EXIT), (Vec::new(), EXIT)];
    let mut found = program(40, blocks);
    found.constants = vec![(Reg(17), 1)];
    let values = local_values(&found, &[(Reg(18), 1)]);
    // Registers 11, 14, 17 and 18 are read by a terminator, written in two superblocks, constant,
    // and named by computed numbers. Register 19 is not accessed.
    let local = [10, 12, 20, 30];
    let freed: Vec<u32> = values.freed_registers().iter().map(|reg| reg.0).collect();
    assert_eq!(freed, [30, 20, 12, 10]);
    for reg in 10..19 {
        assert_eq!(values.is_local(Reg(reg)), local.contains(&reg), "r{reg}");
    }
    assert!(!values.is_local(Reg(40)));
    let written_once = [10, 20, 14].map(|reg| values.is_written_once(Reg(reg)));
    assert_eq!(written_once, [true, false, false]);
    let renameable = [10, 11, 13, 15, 16].map(|reg| values.is_renameable(Reg(reg)));
    assert_eq!(renameable, [true, true, true, false, false]);
}

#[test]
fn operands_of_one_register_may_be_renamed() {
    let visited = |mut op: Op| {
        let mut visited = Vec::new();
        op.visit_single_registers(|reg, kind| visited.push((reg.0, kind == OperandKind::Def)));
        visited
    };
    let (read, written) = (false, true);
    assert_eq!(visited(add(12, 10, 11)), [(10, read), (11, read), (12, written)]);
    assert_eq!(visited(add_pairs(14, 10, 12)), []);
    assert_eq!(visited(copy(12, 10)), [(10, read), (12, written)]);
    assert_eq!(visited(store(12, 10)), [(10, read), (12, written)]);
    assert_eq!(visited(index(12, None, 11)), [(11, read), (12, written)]);
    assert_eq!(visited(index(12, Some(10), 11)), [(11, read), (10, read), (12, written)]);
    assert_eq!(visited(load(12, 1, 10)), [(10, read), (12, written)]);
    assert_eq!(visited(load(12, 2, 10)), [(10, read)]);
    assert_eq!(visited(output(12, 1, Some(10))), [(10, read), (12, read)]);
    assert_eq!(visited(output(12, 2, Some(10))), [(10, read)]);
    assert_eq!(visited(Op::Barrier), []);
}

#[test]
fn a_pool_gives_the_register_that_was_freed_last_and_then_new_ones() {
    let mut pool = RegisterPool::new(10, vec![Reg(7), Reg(5), Reg(3)]);
    assert_eq!(pool.take(), Reg(3));
    pool.free.push(Reg(3));
    assert_eq!(pool.never_taken(), [Reg(7), Reg(5)]);
    assert_eq!([(); 3].map(|()| pool.take()), [Reg(3), Reg(5), Reg(7)]);
    assert_eq!([(); 2].map(|()| pool.take()), [Reg(10), Reg(11)]);
    assert_eq!(pool.never_taken(), []);
    assert_eq!(
        [3, 4, 5, 7, 9, 10, 11].map(|reg| pool.is_pooled(Reg(reg))),
        [true, false, true, true, false, true, true]
    );
}

/// The operations of one superblock after its copies are propagated.
fn propagated(ops: &[Op], addressed: &[(Reg, u32)]) -> Vec<Op> {
    let program = one_block(20, ops.to_vec());
    let values = local_values(&program, addressed);
    let aliased = AliasedRegisters::of(&program, addressed);
    let (mut ops, mut written) = (ops.to_vec(), vec![0; 20]);
    propagate_local_copies(
        &mut ops,
        0..program.ops.len(),
        &values,
        &aliased,
        &mut written,
        &mut Copies::new(20),
    );
    ops
}

#[test]
fn copies_of_local_values_become_no_ops() {
    let becomes = |ops: &[Op], expected: &[Op]| assert_eq!(propagated(ops, &[]), expected, "{ops:?}");
    // Register 1 comes from elsewhere. A copy of a copy is one of the original.
    becomes(&[copy(10, 1), add(12, 10, 10)], &[copy(1, 1), add(12, 1, 1)]);
    becomes(&[copy(10, 1), copy(11, 10), add(12, 11, 11)], &[copy(1, 1), copy(1, 1), add(12, 1, 1)]);
    // The original changes after the last read, or before the copy.
    becomes(&[copy(10, 1), add(12, 10, 10), add(1, 2, 2)], &[copy(1, 1), add(12, 1, 1), add(1, 2, 2)]);
    becomes(&[add(1, 2, 2), copy(10, 1), add(12, 10, 10)], &[add(1, 2, 2), copy(1, 1), add(12, 1, 1)]);
    // The pipeline writes no local value, and has stopped before the copy.
    becomes(
        &[add(9, 1, 1), copy(10, 9), Op::Barrier, add(12, 10, 10)],
        &[add(9, 1, 1), copy(9, 9), Op::Barrier, add(12, 9, 9)],
    );
    becomes(
        &[add(8, 2, 2), Op::Barrier, copy(10, 1), add(12, 10, 10)],
        &[add(8, 2, 2), Op::Barrier, copy(1, 1), add(12, 1, 1)],
    );
}

#[test]
fn copies_that_may_differ_from_their_originals_stay() {
    let stays = |ops: &[Op], addressed: &[(Reg, u32)]| assert_eq!(propagated(ops, addressed), ops);
    let read = || add(12, 10, 10);
    // The original is written, by itself or as the second of two registers; once more it is read
    // before that, too.
    stays(&[copy(10, 1), add(1, 2, 2), read()], &[]);
    stays(&[copy(10, 1), add_pairs(0, 4, 6), read()], &[]);
    stays(&[copy(10, 1), add(11, 10, 10), add(1, 2, 2), read()], &[]);
    // The pipeline may write the original.
    stays(&[copy(10, 1), Op::Barrier, read()], &[]);
    // Two copies in one register.
    stays(&[copy(10, 1), read(), copy(10, 2), add(13, 10, 10)], &[]);
    stays(&[copy(10, 1), read()], &[(Reg(1), 1)]);
    // A copy of a copy that stays is its copy.
    assert_eq!(
        propagated(&[copy(10, 1), add(1, 2, 2), copy(11, 10), add(12, 11, 11)], &[]),
        [copy(10, 1), add(1, 2, 2), copy(10, 10), add(12, 10, 10)]
    );
}

#[test]
fn results_are_used_until_their_register_is_written_again() {
    let kernel = |family: &'static OpFamily, to, a, b| {
        let kernel = family.kernel(32).expect("a kernel of 32 bits");
        Op::LaneKernel { kernel, to: Reg(to), from: [Reg(a), Reg(b), Reg(b)] }
    };
    let mut ops = vec![
        kernel(&FAdd, 1, 8, 9),
        kernel(&FMul, 2, 1, 1),
        kernel(&IAdd, 3, 2, 7),
        kernel(&FAdd, 1, 8, 8),
        // Reads its second operand as an integer. Its own register is none of the pool.
        kernel(&Ldexp, 6, 9, 1),
        load(3, 1, 8),
        output(3, 1, None),
        copy(4, 8),
    ];
    let program = one_block(10, ops.clone());
    let mut pool = RegisterPool::new(10, vec![Reg(4), Reg(3), Reg(2), Reg(1)]);
    for reg in 1..=4 {
        assert_eq!(pool.take(), Reg(reg));
    }
    let used = |reads, nan_payload_observed| ResultUse { reads: Some(reads), nan_payload_observed };
    assert_eq!(
        result_uses(&program, &mut ops, &starts(&program), &pool),
        [
            used(2, false),
            used(1, true),
            used(0, false),
            used(1, true),
            ResultUse::UNKNOWN,
            ResultUse::UNKNOWN,
            ResultUse::UNKNOWN,
            used(0, false),
        ]
    );
}

#[test]
fn freed_registers_take_values_that_live_longer() {
    // Registers 5 and 6 hold local values, one after the other, so 6 is free for one extended
    // register: not for 294 and 295, which are one operand, nor for 296, on which the program
    // branches. 299 comes first of the others.
    let first = vec![
        add(5, 1, 1),
        output(5, 1, None),
        add(6, 2, 2),
        output(6, 1, None),
        add(294, 1, 1),
        add(295, 1, 2),
        add(296, 1, 3),
        add(299, 2, 1),
        add(298, 2, 2),
    ];
    let second = vec![output(294, 2, None), output(298, 1, None), output(299, 1, None)];
    let blocks = vec![(first.clone(), branch_if(296, 1, 2)), (second.clone(), EXIT), (Vec::new(), EXIT)];
    let mut found = program(300, blocks);
    found.watched = [5, 7, 298, 299].map(Reg).into();
    let renamed = allocate_registers(&mut found, &[]);
    let mut expected = [first, second].concat();
    expected[2] = add(5, 2, 2);
    expected[3] = output(5, 1, None);
    expected[7] = add(6, 2, 1);
    expected[11] = output(6, 1, None);
    assert_eq!(found.optimized.ops, expected);
    let moved: Vec<(u32, u32)> =
        (0..).zip(&renamed).map(|(from, to)| (from, to.0)).filter(|(from, to)| from != to).collect();
    assert_eq!((moved, found.register_count), (vec![(299, 6)], 300));
    assert_eq!(found.optimized.reassigned, [Reg(5), Reg(299)]);
}
