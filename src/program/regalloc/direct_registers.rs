//! Renames extended registers of values and constants to direct registers that are free.
//!
//! Superinstructions encode the first [`DIRECT_REGISTERS`] registers in one byte; see
//! [`crate::ops::superop`].

use rustc_hash::FxHashMap;

use crate::machine::Reg;
use crate::ops::memory;
use crate::ops::op::Op;
use crate::ops::superop::DIRECT_REGISTERS;
use crate::program::Program;
use crate::program::copy_propagation::{AliasedRegisters, for_each_terminator_read, is_noop};
use crate::program::regalloc::{LocalValues, OperandKind, RegisterPool, for_each_renameable};

/// Renames extended registers whose values live longer than a superblock to free direct ones.
///
/// Returns the direct registers that were taken, and by register its new name. A direct register
/// that batches initialize with zeros may be taken, because values are written before they are
/// read.
pub(super) fn rename_values(
    program: &Program,
    ops: &mut [Op],
    pool: &RegisterPool,
    aliased: &AliasedRegisters,
    values: &LocalValues,
) -> (Vec<Reg>, Vec<Reg>) {
    let extended = |register: u32| register as usize >= DIRECT_REGISTERS;
    let registers = program.register_count as usize;
    let mut stays: Vec<bool> =
        (0..registers).map(|register| aliased.contains(Reg(register as u32))).collect();
    let mut is_variable = vec![false; registers];
    for register in program.variables.iter().flat_map(|&(first, count)| first.0..first.0 + count) {
        (stays[register as usize], is_variable[register as usize]) = (true, true);
    }
    program.constants.iter().for_each(|(reg, _)| stays[reg.0 as usize] = true);
    program
        .blocks
        .iter()
        .for_each(|block| for_each_terminator_read(&block.terminator, |reg| stays[reg.0 as usize] = true));
    // Takes registers of variables first, because constants cannot have those.
    let is_variable = |reg: &Reg| is_variable[reg.0 as usize];
    let never_taken = pool.never_taken().iter().copied().filter(|reg| !extended(reg.0));
    let (mut order, others): (Vec<Reg>, Vec<Reg>) = never_taken.partition(is_variable);
    order.extend(others);
    if order.is_empty() {
        return (order, Vec::new());
    }
    // By register: its new name.
    let mut renamed: Vec<Reg> = (0..program.register_count).map(Reg).collect();
    let mut taken = 0;
    for op in ops {
        for_each_renameable(op, |reg, _| {
            let register = reg.0 as usize;
            // New registers of the pool come after all others.
            if !extended(reg.0) || register >= registers {
                return;
            }
            if renamed[register] == *reg
                && taken < order.len()
                && !stays[register]
                && values.is_renameable(*reg)
            {
                renamed[register] = order[taken];
                taken += 1;
            }
            *reg = renamed[register];
        });
    }
    order.truncate(taken);
    (order, renamed)
}

/// Renames extended registers that hold constants to free direct ones.
pub(super) fn rename_constants(program: &mut Program, ops: &mut [Op], pool: &RegisterPool, taken: &[Reg]) {
    let extended = |reg: Reg| reg.0 as usize >= DIRECT_REGISTERS;
    let words: FxHashMap<Reg, u32> =
        program.constants.iter().copied().filter(|&(reg, _)| extended(reg)).collect();
    let mut renamed: FxHashMap<Reg, Reg> = FxHashMap::default();
    // Every batch begins with zeros in variables, and keeps its constants.
    let mut initially_zero = [false; DIRECT_REGISTERS];
    for register in program.variables.iter().flat_map(|&(first, count)| first.0..first.0 + count) {
        if let Some(zero) = initially_zero.get_mut(register as usize) {
            *zero = true;
        }
    }
    let mut never_taken = pool
        .never_taken()
        .iter()
        .copied()
        .filter(|&reg| !extended(reg) && !initially_zero[reg.0 as usize] && !taken.contains(&reg))
        .peekable();
    if never_taken.peek().is_none() {
        return;
    }
    // A copy that became a no-op stays one.
    for op in ops.iter_mut().filter(|op| !is_noop(op)) {
        if let Op::LaneKernel { .. }
        | Op::Memory(memory::MemoryOp::Move { .. } | memory::MemoryOp::MoveMasked { .. }) = op
        {
            for_each_renameable(op, |reg, kind| {
                if kind != OperandKind::Use || !extended(*reg) {
                    return;
                }
                let Some(&word) = words.get(reg) else { return };
                let known = renamed.get(reg).copied().or_else(|| {
                    let register = never_taken.next()?;
                    program.constants.push((register, word));
                    renamed.insert(*reg, register);
                    Some(register)
                });
                *reg = known.unwrap_or(*reg);
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_programs_have_few_extended_registers() {
        for name in ["arithmetic.rgen", "light.rchit", "heavy.rchit"] {
            let path = format!("{}/spirv-fixtures/bench/{name}.spv", env!("CARGO_MANIFEST_DIR"));
            let module = crate::Module::open(path).expect("a valid fixture");
            let program = Program::of(&module, "main").expect("a supported fixture");
            assert!(
                program.register_count as usize > DIRECT_REGISTERS,
                "{name} has {} registers",
                program.register_count
            );
            let is_extended = |op: &&Op| match op {
                Op::LaneKernel { kernel, to, from } => {
                    let operands = from.iter().zip(&kernel.operands).filter(|(_, words)| **words > 0);
                    let mut named = operands.map(|(reg, _)| reg).chain([to]);
                    named.any(|reg| reg.0 as usize >= DIRECT_REGISTERS)
                }
                _ => false,
            };
            let ops = &program.optimized.ops;
            let count = ops.iter().filter(is_extended).count();
            assert!(count * 8 <= ops.len(), "{name}: {count} of {} name extended registers", ops.len());
        }
    }

    #[test]
    fn a_direct_constant_has_a_register_that_is_not_zeroed() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/spirv-fixtures/bench/arithmetic.rgen.spv");
        let module = crate::Module::open(path).expect("a valid fixture");
        let mut program = Program::of(&module, "main").expect("a supported fixture");
        let extended = Reg(DIRECT_REGISTERS as u32 + 40);
        program.variables = vec![(Reg(10), 1)];
        program.constants = vec![(extended, 7)];
        let kernel = crate::ops::arithmetic::IAdd.kernel(32).expect("a kernel of 32 bits");
        let mut ops = [Op::LaneKernel { kernel, to: Reg(0), from: [Reg(1), extended, Reg(1)] }];
        rename_constants(&mut program, &mut ops, &RegisterPool::new(400, vec![Reg(10), Reg(11)]), &[]);
        assert_eq!(ops, [Op::LaneKernel { kernel, to: Reg(0), from: [Reg(1), Reg(11), Reg(1)] }]);
        assert_eq!(program.constants, [(extended, 7), (Reg(11), 7)]);
    }
}
