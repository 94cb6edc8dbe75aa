use super::*;
use crate::ops::arithmetic::{FAdd, FMul};
use crate::ops::memory;

fn kernel(family: &'static crate::ops::lane_kernel::OpFamily, to: u32, a: u32, b: u32) -> Op {
    let kernel = family.kernel(32).expect("a kernel of 32 bits");
    Op::LaneKernel { kernel, to: Reg(to), from: [Reg(a), Reg(b), Reg(a)] }
}

fn store(to: u32, from: u32) -> Op {
    Op::Memory(memory::MemoryOp::MoveMasked { to: Reg(to), from: Reg(from) })
}

#[test]
fn an_operation_follows_the_one_whose_result_it_reads() {
    // x * x + z and y * y + z, as a compiler emits them component by component.
    let mut ops = [
        kernel(&FMul, 10, 0, 0),
        kernel(&FMul, 11, 1, 1),
        kernel(&FAdd, 12, 10, 2),
        kernel(&FAdd, 13, 11, 2),
    ];
    let expected = [ops[0].clone(), ops[2].clone(), ops[1].clone(), ops[3].clone()];
    ListScheduler::new(20).order(&mut ops);
    assert_eq!(ops, expected);
}

#[test]
fn reads_and_writes_of_a_register_keep_their_order() {
    // Register 1 is a variable: its read before the store stays before the store.
    let mut ops = [kernel(&FMul, 10, 0, 0), kernel(&FAdd, 11, 1, 1), store(1, 10), kernel(&FAdd, 12, 1, 11)];
    let expected = [ops[0].clone(), ops[1].clone(), ops[2].clone(), ops[3].clone()];
    ListScheduler::new(20).order(&mut ops);
    assert_eq!(ops, expected);
}

#[test]
fn irregular_operations_stay_where_they_are() {
    let mut ops = [
        kernel(&FMul, 10, 0, 0),
        kernel(&FMul, 11, 1, 1),
        Op::Barrier,
        kernel(&FAdd, 12, 10, 2),
        kernel(&FAdd, 13, 11, 2),
    ];
    let expected = ops.clone();
    ListScheduler::new(20).order(&mut ops);
    assert_eq!(ops, expected);
}

/// Orders operations on fewer than twenty registers; returns where each was before.
fn order(ops: &[Op]) -> Vec<usize> {
    let mut ordered = ops.to_vec();
    ListScheduler::new(20).order(&mut ordered);
    let place = |op: &Op| ops.iter().position(|before| before == op).expect("an operation from before");
    ordered.iter().map(place).collect()
}

fn copy(to: u32, from: u32) -> Op {
    Op::copy_of(Reg(to), Reg(from))
}

#[test]
fn a_chain_goes_on_from_the_operation_that_was_chained() {
    // 2 reads the result of 0, and 3 that of 2.
    let ops = [
        kernel(&FMul, 10, 0, 0),
        kernel(&FMul, 11, 1, 1),
        kernel(&FAdd, 12, 10, 1),
        kernel(&FAdd, 13, 12, 1),
    ];
    assert_eq!(order(&ops), [0, 2, 3, 1]);
}

#[test]
fn a_copy_is_followed_by_what_reads_it() {
    let ops = [copy(10, 0), kernel(&FMul, 11, 1, 1), kernel(&FAdd, 12, 10, 2)];
    assert_eq!(order(&ops), [0, 2, 1]);
}

#[test]
fn what_is_stored_stays_in_the_accumulator() {
    // The store is the first reader of 10; the addition reads 10, too, and not the variable.
    let ops = [kernel(&FMul, 10, 0, 0), store(1, 10), kernel(&FMul, 11, 2, 2), kernel(&FAdd, 12, 10, 3)];
    assert_eq!(order(&ops), [0, 1, 3, 2]);
    // The addition comes after the store, as it reads the variable, and reads what was stored.
    let ops = [store(1, 5), kernel(&FMul, 11, 2, 2), kernel(&FAdd, 12, 5, 1)];
    assert_eq!(order(&ops), [0, 2, 1]);
    // The variable itself is not in the accumulator.
    let ops = [store(1, 5), kernel(&FMul, 11, 2, 2), kernel(&FAdd, 12, 1, 3)];
    assert_eq!(order(&ops), [0, 1, 2]);
}

#[test]
fn only_what_reads_a_result_is_chained_to_it() {
    // 2 comes after 0 because it overwrites what 0 reads, and does not read the result of 0.
    let ops = [kernel(&FMul, 10, 0, 0), kernel(&FMul, 11, 2, 2), kernel(&FMul, 0, 3, 3)];
    assert_eq!(order(&ops), [0, 1, 2]);
}
