use super::*;
use crate::ops::op::Op;
use crate::program::written_program::{
    EXIT, add, add_pairs, branch, branch_if, call, copy, index, one_block, output, program, store,
};

#[test]
fn a_copy_is_read_from_its_original_within_its_block() {
    let switch = |selector: u32, wide| Terminator::Switch {
        selector: Reg(selector),
        wide,
        cases: Box::new([(1, BlockIndex(3))]),
        default: BlockIndex(3),
    };
    // Register 1 is a variable; 10, 20 and 30 are its copies. A buffer's operand is not renamed,
    // nor is a selector of two registers, nor what another block reads.
    let blocks = |ten: u32, twenty: u32| {
        let ops = vec![
            copy(10, 1),
            add(11, ten, ten),
            store(2, ten),
            copy(12, ten),
            index(13, Some(ten), ten),
            output(10, 1, None),
        ];
        vec![
            (ops, branch_if(ten, 1, 2)),
            (vec![copy(20, 1)], switch(twenty, false)),
            (vec![copy(30, 1)], switch(30, true)),
            (vec![add(40, 10, 20)], EXIT),
        ]
    };
    let mut found = program(50, blocks(10, 20));
    propagate_copies(&mut found, &[]);
    let expected = program(50, blocks(1, 1));
    assert_eq!((found.ops, found.blocks), (expected.ops, expected.blocks));
}

#[test]
fn a_copy_that_may_differ_from_its_original_is_read_itself() {
    let unchanged = |what: &str, ops: Vec<Op>, addressed: &[(Reg, u32)]| {
        let mut found = one_block(20, ops.clone());
        propagate_copies(&mut found, addressed);
        assert_eq!(found.ops, ops, "{what}");
    };
    let read = || add(11, 10, 10);
    unchanged("the original is written", vec![copy(10, 1), add(1, 2, 2), read()], &[]);
    unchanged("the original is the second of two", vec![copy(10, 1), add_pairs(0, 4, 6), read()], &[]);
    unchanged("two copies", vec![copy(10, 1), read(), copy(10, 2), read()], &[]);
    unchanged("the original is addressed", vec![copy(10, 1), read()], &[(Reg(1), 1)]);
    unchanged("the copy is addressed", vec![copy(10, 1), read()], &[(Reg(10), 1)]);
}

#[test]
fn a_store_that_nothing_reads_before_the_next_one_is_dead() {
    // Registers 1 and 2 are variables. Nothing reads them after the end; so the store to 2 is dead,
    // and with it its read of 1.
    let ops = vec![store(1, 5), store(1, 6), add(10, 1, 1), store(1, 7), store(2, 1), store(1, 8)];
    let stores = live_stores(&one_block(20, ops), &[]);
    assert_eq!(stores, Some(vec![false, true, true, false, false, false]));
    // A copy in all lanes is a write, too, and the terminator reads.
    let blocks =
        vec![(vec![store(1, 5), copy(1, 6), store(2, 5), store(1, 2)], branch_if(1, 1, 1)), (vec![], EXIT)];
    assert_eq!(live_stores(&program(20, blocks), &[]), Some(vec![false, true, true, true]));
    // What a computed register number may name is left alone, and so is a program without stores.
    let addressed = [(Reg(1), 1)];
    let ops = vec![store(1, 5), store(2, 5)];
    assert_eq!(live_stores(&one_block(20, ops), &addressed), Some(vec![true, false]));
    assert_eq!(live_stores(&one_block(20, vec![store(1, 5)]), &addressed), None);
    assert_eq!(live_stores(&one_block(20, vec![copy(1, 5)]), &[]), None);
}

#[test]
fn a_store_is_live_where_the_next_turn_of_a_loop_reads_it() {
    // Block 1 is the loop's header, block 4 branches back to it. The accesses stand in blocks
    // between them.
    for (read, written) in [(2, 3), (2, 4), (1, 3), (1, 4)] {
        let ops = |block| {
            let read = (block == read).then(|| output(1, 1, None));
            read.into_iter().chain((block == written).then(|| store(1, 9))).collect()
        };
        let mut blocks: Vec<_> = (0..5).map(|at| (ops(at), branch(at + 1))).collect();
        blocks[4].1 = branch_if(0, 1, 5);
        blocks.push((Vec::new(), EXIT));
        assert_eq!(live_stores(&program(20, blocks), &[]), Some(vec![true, true]), "{read}, {written}");
    }
}

#[test]
fn the_span_of_a_word_has_the_loops_around_its_accesses() {
    // By case: the first and the last block that store, the loops (header and the block that
    // branches back), and both ends of the span.
    type Case = ((u32, u32), &'static [(u32, u32)], (u32, u32));
    const CASES: [Case; 12] = [
        ((2, 3), &[(1, 4)], (1, 4)),
        ((2, 4), &[(1, 4)], (1, 4)),
        ((1, 3), &[(1, 4)], (1, 4)),
        ((1, 4), &[(1, 4)], (1, 4)),
        // Loops that contain no access.
        ((5, 6), &[(1, 4)], (5, 6)),
        ((2, 3), &[(4, 6)], (2, 3)),
        // Loops that contain some of the blocks, the last or the first of them.
        ((2, 4), &[(4, 6)], (2, 6)),
        ((6, 7), &[(4, 6)], (4, 7)),
        ((2, 5), &[(3, 4)], (2, 5)),
        ((3, 3), &[(3, 3)], (3, 3)),
        // A loop that the span has only with another one.
        ((5, 5), &[(1, 3), (3, 5)], (1, 5)),
        ((2, 2), &[], (2, 2)),
    ];
    for ((first, last), loops, (start, end)) in CASES {
        let block = |at: u32| {
            let ops = if at == first || at == last { vec![store(1, 9)] } else { Vec::new() };
            match loops.iter().find(|&&(_, latch)| latch == at) {
                Some(&(header, _)) => (ops, branch_if(0, header, at + 1)),
                None => (ops, branch(at + 1)),
            }
        };
        let mut blocks: Vec<_> = (0..9).map(block).collect();
        blocks.push((Vec::new(), EXIT));
        let program = program(20, blocks);
        let stores = Stores::of(&program, &AliasedRegisters::of(&program, &[])).expect("stores");
        let live_in = LiveInSets::of(&program, &stores, &vec![SmallVec::new(); program.blocks.len()]);
        let expected = [(BlockIndex(start), BlockIndex(end))];
        assert_eq!(live_in.spans, expected, "stores in {first} and {last}, loops {loops:?}");
    }
}

#[test]
fn functions_read_the_registers_of_their_callers() {
    // Block 2 calls the function in block 3, and continues at block 4. Block 0 stores the registers
    // of one word of the sets; no other block accesses them.
    let blocks = |called: Terminator| {
        vec![
            ((1..=64).map(|reg| store(reg, 0)).collect(), branch(1)),
            (Vec::new(), branch(2)),
            (Vec::new(), called),
            (vec![store(70, 0)], Terminator::Return),
            (vec![store(71, 0)], EXIT),
        ]
    };
    let needed = |called| live_stores(&program(80, blocks(called)), &[]).expect("stores");
    assert_eq!(needed(call(3, 4)), [vec![true; 65], vec![false]].concat());
    assert_eq!(needed(branch(4)), [vec![false; 64], vec![true, false]].concat());
}

#[test]
fn bits_are_told_apart_beyond_one_word() {
    // 130 variables are stored, and every second one is read in the next block.
    let stores = (1..=130).map(|reg| store(reg, 0)).collect();
    let reads = (1..=130).step_by(2).map(|reg| output(reg, 1, None)).collect();
    let program = program(200, vec![(stores, branch(1)), (reads, EXIT)]);
    let expected: Vec<bool> = (1..=130).map(|reg| reg % 2 == 1).chain([true; 65]).collect();
    assert_eq!(live_stores(&program, &[]), Some(expected));
}

#[test]
fn liveness_of_too_many_bits_is_not_computed() {
    // 2048 blocks with 64 stores each: 2^11 blocks times 2^17 bits. One bit more takes a further
    // word.
    let blocks: Vec<_> = (0..2048)
        .map(|at| {
            let stores = (0..64).map(|reg| store(1 + 64 * at + reg, 0)).collect();
            (stores, if at == 2047 { EXIT } else { branch(at + 1) })
        })
        .collect();
    let mut program = program(140_000, blocks);
    assert_eq!(live_stores(&program, &[]), Some(vec![false; 64 * 2048]));
    program.ops[0] = store(139_999, 0);
    program.ops.push(store(1, 0));
    program.blocks[2047].end = OpIndex::new(program.ops.len());
    assert_eq!(live_stores(&program, &[]), None);
}
