//! Payloads and callable data that called shaders write, and that nobody reads.
//!
//! Which shaders are called with which variable is noted while they run; what becomes of the
//! variable's words is found in their programs.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::plan::ProgramPlan;
use crate::rule::{Level, traversal};
use anyhit_base::error::{Error, ErrorKind};
use anyhit_engine::machine::{OpIndex, REGISTER_POINTER, Reg, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::access::{Access, ComputedRegisters};
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::InterfaceRegisters;
use anyhit_engine::pipeline::{source_file, with_location};
use anyhit_engine::program::{Program, for_each_terminator_read};

/// A variable that a shader passes: the shader and the variable's first register.
type Passed = (ShaderIndex, Reg);

/// The calls of a run: which shaders are given which variables.
#[derive(Debug, Default)]
pub(super) struct PassedData {
    /// The shaders that are called with a variable, and the first instruction that did so.
    calls: FxHashMap<Passed, (OpIndex, FxHashSet<ShaderIndex>)>,
}

impl PassedData {
    /// Notes a call by an instruction of a shader.
    pub(super) fn note(&mut self, caller: ShaderIndex, op: OpIndex, variable: Reg, called: ShaderIndex) {
        self.calls.entry((caller, variable)).or_insert_with(|| (op, FxHashSet::default())).1.insert(called);
    }

    /// Adds the calls of other parts of a launch.
    pub(super) fn merge(&mut self, other: Self) {
        for (passed, (op, called)) in other.calls {
            self.calls.entry(passed).or_insert_with(|| (op, FxHashSet::default())).1.extend(called);
        }
    }

    /// Reports the variables that a called shader writes and that neither the caller nor any called
    /// shader reads.
    pub(super) fn report(&self, plans: &[ProgramPlan], levels: &Levels, findings: &mut Findings) {
        let rule = &traversal::PAYLOAD_UNREAD;
        let level = levels.of(rule);
        if level == Level::Allow {
            return;
        }
        let mut calls: Vec<_> = self.calls.iter().collect();
        calls.sort_unstable_by_key(|&(&(caller, variable), _)| (caller, variable.0));
        for (&(caller, variable), (op, called)) in calls {
            let Some(program) = plans.get(caller.index()).map(|plan| &*plan.program) else { continue };
            // What a shader passes on of its own caller's, that caller reads.
            let is_own = |one: &&InterfaceRegisters| {
                matches!(one.storage_class, storage::RAY_PAYLOAD | storage::CALLABLE_DATA)
            };
            let passed = program.interface.iter().find(|one| one.first == variable).filter(is_own);
            let Some(passed) = passed else { continue };
            let mut called: Vec<_> = called.iter().copied().collect();
            called.sort_unstable();
            let given = |&shader: &ShaderIndex| {
                let program = &*plans.get(shader.index())?.program;
                Some((program, incoming(program)?))
            };
            let given: Vec<_> = called.iter().filter_map(given).collect();
            let writer = given.iter().find(|(program, own)| is_written(program, own));
            let is_read =
                is_read(program, passed) || given.iter().any(|(program, own)| is_read(program, own));
            let (Some((writer, _)), false) = (writer, is_read) else { continue };
            let what = match passed.storage_class {
                storage::CALLABLE_DATA => "callable data",
                _ => "payload",
            };
            let (name, stage) = (program.module.name_or_number(passed.variable), writer.stage.name());
            let message = format!(
                "{what} `{name}` is written by {stage} `{}`{}, and never read",
                writer.name,
                source_file(&writer.module)
            );
            let error = Error::new(ErrorKind::Finding, message);
            let error = with_location(program, *op, error, "it is passed here");
            let error = match unpassed_namesake(program, passed) {
                Some(other) => error.note(format!(
                    "the shader reads `{other}`, which no call writes: should it have this location?"
                )),
                None => error,
            };
            let error = error.note(format!("in {} `{}`", program.stage.name(), program.name));
            let word = program.origins.get(op.index()).map_or(0, |origin| origin.offset);
            let key = FindingKey { rule: rule.id, places: [(caller, word), (caller, passed.variable.0)] };
            let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
            findings.add(key, 1, Some(finding));
        }
    }
}

/// Another variable of the same storage class and type that the shader reads and never passes.
fn unpassed_namesake<'a>(program: &'a Program, passed: &InterfaceRegisters) -> Option<&'a str> {
    let is_passed = |variable: &InterfaceRegisters| {
        program.ops.iter().any(|op| op.payload_span().is_some_and(|span| span.first == variable.first))
    };
    let alike = |other: &&InterfaceRegisters| {
        other.storage_class == passed.storage_class
            && other.scalar_fingerprint == passed.scalar_fingerprint
            && other.first != passed.first
    };
    let mut others = program.interface.iter().filter(alike);
    let other = others.find(|other| !is_passed(other) && is_read(program, other))?;
    program.module.name(other.variable)
}

/// The payload or callable data that a shader is given.
fn incoming(program: &Program) -> Option<&InterfaceRegisters> {
    program.interface_registers(match program.stage {
        Stage::Callable => storage::INCOMING_CALLABLE_DATA,
        _ => storage::INCOMING_RAY_PAYLOAD,
    })
}

/// Returns whether an operation of a program writes a part of a variable. A call passes the
/// variable, and does not write it itself.
fn is_written(program: &Program, variable: &InterfaceRegisters) -> bool {
    let own = variable.first.0..variable.first.0 + variable.count;
    let is_own = |first: Reg, count: u32| first.0 < own.end && own.start < first.0.saturating_add(count);
    let may_write = |op: &&Op| !op.calls_pipeline() && op.undefines().is_none();
    program.ops.iter().filter(may_write).any(|op| {
        let mut writes = false;
        op.accesses(|access| {
            if let Access::Write(first, count) = access {
                writes |= is_own(first, count);
            }
        });
        if let Some(ComputedRegisters { first, writes: true, .. }) = op.computed_registers() {
            writes |= addressed(program, first).is_some_and(|(first, count)| is_own(first, count));
        }
        writes
    })
}

/// Returns whether anything but the variable itself depends on a part of a variable: an effect, a
/// branch, or another variable that is passed on or handed back. A copy that nobody reads does not.
///
/// The registers on which something depends are found from the operations with effects backwards,
/// whatever the order of operations: that finds too many at worst.
fn is_read(program: &Program, variable: &InterfaceRegisters) -> bool {
    let mut needed = Needed(vec![false; program.register_count as usize]);
    for other in program.interface.iter().filter(|other| other.first != variable.first) {
        needed.add(other.first, other.count);
    }
    for block in &program.blocks {
        for_each_terminator_read(&block.terminator, |register| {
            needed.add(register, 1);
        });
    }
    let mut open: Vec<&Op> = program.ops.iter().rev().collect();
    loop {
        let before = open.len();
        open.retain(|op| {
            let is_needed = needed.has_use_for(program, op);
            if is_needed {
                needed.add_reads(program, op, variable);
            }
            !is_needed
        });
        if open.len() == before {
            return needed.has(variable.first, variable.count);
        }
    }
}

/// Registers on which something depends, by their number.
struct Needed(Vec<bool>);

impl Needed {
    fn add(&mut self, first: Reg, count: u32) {
        let range = first.0 as usize..(first.0.saturating_add(count) as usize).min(self.0.len());
        if let Some(registers) = self.0.get_mut(range) {
            registers.fill(true);
        }
    }

    fn has(&self, first: Reg, count: u32) -> bool {
        let range = first.0 as usize..(first.0.saturating_add(count) as usize).min(self.0.len());
        self.0.get(range).is_some_and(|registers| registers.contains(&true))
    }

    /// Whether an operation has an effect, or writes a register on which something depends.
    fn has_use_for(&self, program: &Program, op: &Op) -> bool {
        let mut is_needed = false;
        op.accesses(|access| {
            is_needed |= match access {
                Access::Effect => true,
                Access::Write(first, count) => self.has(first, count),
                Access::Read(..) => false,
            };
        });
        if let Some(ComputedRegisters { first, writes: true, .. }) = op.computed_registers() {
            is_needed |= addressed(program, first).is_none_or(|(first, count)| self.has(first, count));
        }
        is_needed
    }

    /// Adds what an operation reads, but for the variable where it only passes that.
    fn add_reads(&mut self, program: &Program, op: &Op, variable: &InterfaceRegisters) {
        let passes = |first: Reg, count: u32| {
            op.calls_pipeline() && first == variable.first && count == variable.count
        };
        op.accesses(|access| {
            if let Access::Read(first, count) = access
                && !passes(first, count)
            {
                self.add(first, count);
            }
        });
        if let Some(ComputedRegisters { first, writes: false, .. }) = op.computed_registers() {
            match addressed(program, first) {
                Some((first, count)) => self.add(first, count),
                None => self.0.fill(true),
            }
        }
    }
}

/// The variable whose registers a computed register number addresses; `None` where a pointer says
/// which it is.
fn addressed(program: &Program, first: Reg) -> Option<(Reg, u32)> {
    if first.0 >= REGISTER_POINTER {
        return None;
    }
    let holds = |&&(start, count): &&(Reg, u32)| (start.0..start.0 + count).contains(&first.0);
    Some(program.variables.iter().find(holds).copied().unwrap_or((first, 1)))
}
