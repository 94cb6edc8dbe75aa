use super::*;
use crate::ops::superop::ResultUse;
use crate::program::written_program::{
    EXIT, add, add_pairs, branch, branch_if, call, copy, one_block, output, program, store,
};

/// What the check says of a pass that makes `after` of a program, with the same registers.
fn compared(before: &Program, after: &Program) -> Result<(), String> {
    renamed(before, after, &[])
}

/// What the check says of a pass that renames registers that are live beyond a superblock.
fn renamed(before: &Program, after: &Program, names: &[(u32, u32)]) -> Result<(), String> {
    let verifier = Verifier::new(before, &[], None).expect("a small program");
    let renamed = |reg: Reg| names.iter().find(|known| known.0 == reg.0).map_or(reg, |known| Reg(known.1));
    verifier.compare(&Version::of(after), &renamed)
}

fn expect_problem(found: Result<(), String>, problem: &str) {
    let error = found.expect_err(problem);
    assert!(error.contains(problem), "{error}");
}

#[test]
fn an_effect_has_its_operands() {
    let before = one_block(20, vec![add(10, 1, 2), output(10, 1, Some(4))]);
    assert_eq!(compared(&before, &before), Ok(()));
    // A value that lives within the superblock may have any register.
    let elsewhere = one_block(20, vec![add(13, 1, 2), output(13, 1, Some(4))]);
    assert_eq!(compared(&before, &elsewhere), Ok(()));
    // The offset is the first operand, what is written is the second.
    let other_value = one_block(20, vec![add(10, 1, 3), output(10, 1, Some(4))]);
    expect_problem(compared(&before, &other_value), "effect 0, operand Some(1): ");
    let other_offset = one_block(20, vec![add(10, 1, 2), output(10, 1, Some(5))]);
    expect_problem(compared(&before, &other_offset), "effect 0, operand Some(0): ");
    expect_problem(compared(&before, &one_block(20, vec![add(10, 1, 2)])), "0 effects, not 1");
}

#[test]
fn what_the_next_superblock_reads_is_the_same() {
    // Block 1 reads register 10 for its effect. It writes 11 itself, and reads 12 for nothing.
    let with = |written: [u32; 3]| {
        let first = (10..).zip(written).map(|(to, operand)| add(to, 1, operand)).collect();
        let second = vec![add(14, 12, 12), add(11, 10, 10), output(11, 1, None)];
        program(20, vec![(first, branch(1)), (second, EXIT)])
    };
    let before = with([2, 3, 4]);
    assert_eq!(compared(&before, &before), Ok(()));
    assert_eq!(compared(&before, &with([2, 5, 6])), Ok(()));
    let error = compared(&before, &with([5, 3, 4])).expect_err("another value");
    assert!(error.starts_with("blocks (0, 0): r10 (r10 now) holds "), "{error}");
}

#[test]
fn what_a_function_leaves_is_read_where_it_returns() {
    let with = |operand| {
        let function = (vec![add(10, 1, operand)], Terminator::Return);
        program(20, vec![(Vec::new(), call(1, 2)), function, (vec![output(10, 1, None)], EXIT)])
    };
    assert_eq!(compared(&with(2), &with(2)), Ok(()));
    expect_problem(compared(&with(2), &with(3)), "blocks (1, 1): r10 (r10 now) holds ");
}

#[test]
fn a_branch_depends_on_the_same_value() {
    let with = |condition| {
        let blocks = vec![(Vec::new(), branch_if(condition, 1, 2)), (Vec::new(), EXIT), (Vec::new(), EXIT)];
        program(20, blocks)
    };
    assert_eq!(compared(&with(2), &with(2)), Ok(()));
    expect_problem(compared(&with(2), &with(3)), "the terminator's operand holds ");
}

#[test]
fn a_register_that_lives_longer_has_one_new_name() {
    // Register 3 is a variable, and 5 a constant. Block 1 reads 3, 10 and 11.
    let with = |ten: u32, eleven: u32, three: u32| {
        let first = vec![add(ten, 1, 1), add(eleven, 2, 2)];
        let second = [three, ten, eleven].map(|reg| output(reg, 1, None)).to_vec();
        let mut program = program(20, vec![(first, branch(1)), (second, EXIT)]);
        program.variables = vec![(Reg(3), 1)];
        program.constants = vec![(Reg(5), 7)];
        program
    };
    let before = with(10, 11, 3);
    assert_eq!(renamed(&before, &before, &[]), Ok(()));
    assert_eq!(renamed(&before, &with(12, 11, 3), &[(10, 12)]), Ok(()));
    assert_eq!(renamed(&before, &with(11, 10, 3), &[(10, 11), (11, 10)]), Ok(()));
    expect_problem(renamed(&before, &with(10, 10, 3), &[(11, 10)]), "r10 holds both r");
    expect_problem(renamed(&before, &with(10, 5, 3), &[(11, 5)]), "r5 holds r11 and a constant");
    let moved = renamed(&before, &with(10, 11, 4), &[(3, 4)]);
    expect_problem(moved, "r3 begins with a value and is r4 now");
}

#[test]
fn a_constant_stays() {
    let with = |ops| {
        let mut program = one_block(20, ops);
        program.constants = vec![(Reg(5), 7)];
        program
    };
    let before = with(vec![add(10, 1, 2), output(10, 1, None)]);
    assert_eq!(compared(&before, &with(vec![add(10, 1, 2), copy(5, 5), output(10, 1, None)])), Ok(()));
    let after = with(vec![add(5, 1, 2), output(5, 1, None)]);
    expect_problem(compared(&before, &after), "writes r5, which holds a constant");
    // As the second register of a result.
    let after = with(vec![add_pairs(4, 0, 2), add(10, 1, 2), output(10, 1, None)]);
    expect_problem(compared(&before, &after), "writes r5, which holds a constant");
}

#[test]
fn lanes_that_wait_keep_their_values() {
    let with = |op| program(20, vec![(vec![op], branch(1)), (vec![output(10, 1, None)], EXIT)]);
    assert_eq!(compared(&with(store(10, 1)), &with(store(10, 1))), Ok(()));
    assert_eq!(compared(&with(copy(10, 1)), &with(copy(10, 1))), Ok(()));
    expect_problem(compared(&with(store(10, 1)), &with(copy(10, 1))), "r10 is written in all lanes");
}

#[test]
fn superinstructions_are_compared_by_superblock() {
    let before = program(
        20,
        vec![(Vec::new(), branch(1)), (vec![add(10, 1, 2)], branch(2)), (vec![output(10, 1, None)], EXIT)],
    );
    let ranges = before.blocks.iter().map(Block::ops);
    let mut code = SuperCode::of(&before.ops, ranges, &[ResultUse::UNKNOWN; 2], &[]);
    let verifier = Verifier::new(&before, &[], None).expect("a small program");
    let compared = |code: &SuperCode| verifier.compare_supercode(&Version::of(&before), &|reg| reg, code);
    assert_eq!(compared(&code), Ok(()));
    code.superops[0].from[0] = 3;
    let error = compared(&code).expect_err("another operand");
    assert!(error.starts_with("blocks (1, 1): r10 holds "), "{error}");
}

#[test]
fn the_registers_that_an_operation_names_are_counted() {
    let named = [add(10, 1, 2), add_pairs(10, 1, 2), output(10, 4, Some(1)), copy(1, 2), Op::Barrier];
    assert_eq!(named.each_ref().map(accessed_registers), [3, 6, 5, 2, 0]);
}
