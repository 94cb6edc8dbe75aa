use super::*;
use crate::machine::BlockIndex;
use crate::ops::atomic::{AtomicKind, AtomicOp, AtomicTarget};
use crate::ops::builtin::BUILTINS;
use crate::ops::translate::InputRegisters;
use crate::program::Terminator;
use crate::program::written_program::{
    EXIT, add, branch_if, chunk, copy, index, one_block, output, program, store,
};

#[test]
fn what_no_effect_needs_is_removed() {
    // Registers 10 to 12 lead to an effect, 13 to a branch; 14 and 15 are read by what is dead.
    let first = vec![add(10, 1, 1), add(14, 10, 10), add(13, 2, 2), add(15, 14, 14)];
    let second = vec![add(11, 10, 3), add(16, 15, 11), copy(12, 11), output(12, 1, None)];
    let ends =
        |first, second| vec![(first, branch_if(13, 1, 2)), (second, EXIT), (vec![add(17, 1, 1)], EXIT)];
    let mut found = program(20, ends(first.clone(), second.clone()));
    found.origins.iter_mut().zip(0..).for_each(|(origin, offset)| origin.offset = offset);
    eliminate_dead_code(&mut found, &[], None);
    let live = |ops: Vec<Op>, at: &[usize]| at.iter().map(|&at| ops[at].clone()).collect();
    let mut expected = program(20, ends(live(first, &[0, 2]), live(second, &[0, 2, 3])));
    expected.ops.pop();
    expected.blocks[2].end = expected.blocks[2].first;
    assert_eq!((found.ops, found.blocks), (expected.ops, expected.blocks));
    // Nine operations, then the terminators of three blocks.
    let origins: Vec<u32> = found.origins.iter().map(|origin| origin.offset).collect();
    assert_eq!(origins, [0, 2, 4, 6, 7, 9, 10, 11]);
}

#[test]
fn a_switch_on_64_bits_reads_two_registers() {
    let switch = |wide| Terminator::Switch {
        selector: Reg(10),
        wide,
        cases: Box::new([(1, BlockIndex(1))]),
        default: BlockIndex(1),
    };
    for (wide, count) in [(false, 1), (true, 2)] {
        let ops = vec![add(10, 1, 1), add(11, 1, 1), add(12, 1, 1)];
        let mut found = program(20, vec![(ops.clone(), switch(wide)), (Vec::new(), EXIT)]);
        eliminate_dead_code(&mut found, &[], None);
        assert_eq!(found.ops, ops[..count]);
    }
}

#[test]
fn stores_that_are_known_to_be_dead_need_nothing() {
    let ops = vec![add(10, 1, 1), store(2, 10), add(11, 1, 1), store(2, 11), output(2, 1, None)];
    let mut found = one_block(20, ops.clone());
    eliminate_dead_code(&mut found, &[], Some(&[true, false, true, true, true]));
    assert_eq!(found.ops, ops[2..]);
}

#[test]
fn a_computed_index_reads_its_whole_variable() {
    // The second of two variables, which begins where the first one ends.
    let ops = vec![copy(2, 1), copy(4, 1), copy(5, 1), copy(6, 1), copy(7, 1)];
    let mut found = one_block(20, ops.clone());
    found.variables = vec![(Reg(2), 3), (Reg(5), 2)];
    eliminate_dead_code(&mut found, &[(Reg(5), 1)], None);
    assert_eq!(found.ops, ops[2..4]);
    // A pointer into the middle of a variable.
    let mut found = one_block(20, ops.clone());
    found.variables = vec![(Reg(2), 3), (Reg(5), 2)];
    eliminate_dead_code(&mut found, &[(Reg(4), 1)], None);
    assert_eq!(found.ops, ops[..2]);
}

#[test]
fn an_input_stays_where_one_of_its_registers_is_read() {
    let mut found = one_block(40, vec![index(30, Some(21), 25), output(30, 1, None)]);
    found.inputs = [(20, 2), (22, 3), (25, 1)]
        .map(|(first, count)| InputRegisters { builtin: &BUILTINS[0], first: Reg(first), count })
        .to_vec();
    eliminate_dead_code(&mut found, &[], None);
    let kept: Vec<u32> = found.inputs.iter().map(|input| input.first.0).collect();
    assert_eq!(kept, [20, 25]);
}

#[test]
fn an_atomic_result_that_is_read_depends_on_the_order() {
    // Additions commute, so only what they return may differ: two registers of 64 bits.
    let atomic = Op::Atomic(Box::new(AtomicOp {
        kind: AtomicKind::Add,
        width: 64,
        component: (0, 1),
        alignment: 8,
        target: AtomicTarget::Buffer(chunk(None, 1)),
        to: Reg(20),
        value: Reg(10),
        comparator: Reg(12),
    }));
    for (read, expected) in [(19, false), (20, true), (21, true), (22, false)] {
        let mut found = one_block(40, vec![atomic.clone(), output(read, 1, None)]);
        eliminate_dead_code(&mut found, &[], None);
        assert_eq!((found.order_dependent, found.ops.len()), (expected, 2), "r{read} is read");
    }
}
