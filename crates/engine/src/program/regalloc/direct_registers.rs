//! Renames extended registers of values and constants to direct registers that are free.
//!
//! Superinstructions encode the first [`DIRECT_REGISTERS`] registers in one byte; see
//! [`crate::ops::superop`].

use rustc_hash::FxHashMap;

use crate::machine::Reg;
use crate::ops::op::Op;
use crate::ops::superop::DIRECT_REGISTERS;
use crate::program::Program;
use crate::program::copy_propagation::{AliasedRegisters, for_each_terminator_read};
use crate::program::regalloc::{LocalValues, RegisterPool};

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
        op.visit_single_registers(|reg, _| {
            // The pool made no new registers, as some were never taken.
            let register = reg.0 as usize;
            if !extended(reg.0) {
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
    for op in ops.iter_mut().filter(|op| !op.is_noop()) {
        if op.writes_all_lanes() || op.copy().is_some() {
            // No operation writes the register of a constant: all of these are uses.
            op.visit_single_registers(|reg, _| {
                if !extended(*reg) {
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
mod tests;
