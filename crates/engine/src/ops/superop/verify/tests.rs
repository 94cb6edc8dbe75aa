use super::*;
use crate::ops::lane_kernel::OpFamily;
use crate::ops::memory::{BufferRef, Chunk, MemoryOp};
use crate::ops::superop::ResultUse;
use crate::ops::superop::function::opcode;
use crate::ops::symbolic::ImplicitRegisters;
use crate::ops::{arithmetic, bit};

fn kernel(family: &'static OpFamily, to: u32, a: u32, b: u32) -> Op {
    let kernel = family.kernel(32).expect("a kernel of 32 bits");
    Op::LaneKernel { kernel, to: Reg(to), from: [Reg(a), Reg(b), Reg(b)] }
}

fn copy(to: u32, from: u32) -> Op {
    Op::Memory(MemoryOp::Move { to: Reg(to), from: Reg(from) })
}

/// Writes a register to a buffer.
fn output(from: u32) -> Op {
    let chunk =
        Chunk { buffer: BufferRef::Handle(0), offset: 0, index: None, width: 32, count: 1, alignment: 4 };
    Op::Memory(MemoryOp::BufferStore { from: Reg(from), chunk })
}

/// What the check says of superinstructions for operations that form one superblock, after `change`
/// changed them. Registers below `observed` are, and so are NaN payloads.
fn changed(
    ops: &[Op],
    constants: &[(Reg, u32)],
    observed: u32,
    change: impl FnOnce(&mut [SuperOp]),
) -> Result<(), String> {
    let uses = vec![ResultUse::UNKNOWN; ops.len()];
    let mut code = SuperCode::of(ops, std::iter::once(0..ops.len()), &uses, constants);
    change(&mut code.superops);
    let begin = |reg: Reg, table: &mut ValueTable| match constants.iter().find(|known| known.0 == reg) {
        Some(&(_, word)) => table.constant(word),
        None => table.initial(reg),
    };
    let implicit = ImplicitRegisters::default();
    let state = State::new(&begin, &implicit);
    code.verify(ops, 0..ops.len(), &state, &mut ValueTable::new(), &|reg| reg.0 < observed)
}

/// What the check says where the first operand of a superinstruction is another register.
fn reading(ops: &[Op], observed: u32, superop: usize, register: u8) -> Result<(), String> {
    changed(ops, &[], observed, |superops| superops[superop].from[0] = register)
}

#[test]
fn what_selection_gives_is_accepted() {
    let ops = [
        kernel(&arithmetic::FSub, 5, 0, 1),
        copy(6, 5),
        output(6),
        kernel(&arithmetic::ISub, 7, 5, 6),
        Op::Barrier,
        kernel(&bit::BitwiseXor, 8, 7, 5),
    ];
    assert_eq!(changed(&ops, &[], 20, |_| ()), Ok(()));
}

#[test]
fn another_value_in_an_observed_register_is_found() {
    let ops = [kernel(&arithmetic::ISub, 5, 0, 1)];
    let error = reading(&ops, 20, 0, 2).unwrap_err();
    assert!(error.starts_with("r5 holds "), "{error}");
    // Nobody observes it.
    assert_eq!(reading(&ops, 5, 0, 2), Ok(()));
    // It is computed and not stored.
    let not_stored = |superops: &mut [SuperOp]| superops[0].opcode &= !1;
    assert!(changed(&ops, &[], 20, not_stored).is_err());
}

#[test]
fn an_irregular_operation_finds_what_it_reads_and_all_that_is_observed() {
    // The operation names register 5, which is not observed at the end.
    let ops = [kernel(&arithmetic::ISub, 5, 0, 1), output(5)];
    assert_eq!(changed(&ops, &[], 0, |_| ()), Ok(()));
    let not_stored = |superops: &mut [SuperOp]| superops[0].opcode &= !1;
    let error = changed(&ops, &[], 0, not_stored).unwrap_err();
    assert!(error.starts_with("operation 1 "), "{error}");
    // The barrier names none; register 5 is wrong there, and right at the end.
    let ops = [copy(5, 0), Op::Barrier, copy(5, 1)];
    let error = reading(&ops, 20, 0, 1).unwrap_err();
    assert!(error.starts_with("operation 1 "), "{error}");
    assert_eq!(reading(&ops, 0, 0, 1), Ok(()));
}

#[test]
fn a_uniform_operand_is_a_constant_and_an_amount_to_shift_by_is_below_32() {
    let uniform =
        |function| move |superops: &mut [SuperOp]| superops[0].opcode = opcode(function, true, 0, true);
    let (subtract, constants) = ([kernel(&arithmetic::ISub, 5, 0, 1)], [(Reg(1), 40)]);
    assert_eq!(changed(&subtract, &constants, 20, uniform(Function::ISub)), Ok(()));
    let error = changed(&subtract, &[], 20, uniform(Function::ISub)).unwrap_err();
    assert!(error.contains("r1 is no constant"), "{error}");
    let shift = [kernel(&bit::ShiftLeftLogical, 5, 0, 1)];
    for (amount, fits) in [(0, true), (31, true), (32, false), (40, false)] {
        let constants = [(Reg(1), amount)];
        let found = changed(&shift, &constants, 20, uniform(Function::ShiftLeftLogical));
        assert_eq!(found.is_ok(), fits, "{amount}: {found:?}");
    }
}
