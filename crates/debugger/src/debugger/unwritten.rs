//! Which variables of a shader have not been written yet: what their registers hold is no value of
//! the shader's.

use anyhit_engine::machine::stop::RegSpan;
use anyhit_engine::machine::{OpIndex, Reg};
use anyhit_engine::ops::access::{Access, ComputedRegisters, RegCopy};
use anyhit_engine::ops::memory::OUT_OF_BOUNDS;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::pointer::{PointerBase, storage};
use anyhit_engine::ops::translate::{IdValue, InterfaceRegisters};
use anyhit_engine::program::Program;

/// Classes of variables of module scope that begin without a value, unless they have an
/// initializer.
const BEGIN_UNWRITTEN: [u32; 3] = [storage::PRIVATE, storage::RAY_PAYLOAD, storage::CALLABLE_DATA];

/// Where the variables of a program begin without a value, and what writes them.
#[derive(Debug)]
pub(super) struct VariableWrites {
    /// The registers of variables of module scope that begin so.
    globals: Vec<(Reg, u32)>,
    /// By operation: whether it writes a variable, or one begins there.
    ops: Vec<bool>,
}

impl VariableWrites {
    /// Those of a program that is not optimised.
    pub(super) fn new(program: &Program) -> Self {
        let module = &program.module;
        let begins = |class: u32| BEGIN_UNWRITTEN.contains(&class);
        let variables =
            module.variables.iter().filter(|one| begins(one.storage_class) && one.initializer.is_none());
        let globals: Vec<(Reg, u32)> = variables
            .filter_map(|variable| match program.id_values.find(0, variable.id)? {
                IdValue::Pointer(pointer) => match pointer.base {
                    PointerBase::Registers { first, count, constant: false } => Some((first, count)),
                    _ => None,
                },
                IdValue::Words(_) => None,
            })
            .collect();
        let mut unwritten = UnwrittenRegisters::default();
        let given = incoming(program).map(|given| (given.first, given.count));
        globals.iter().copied().chain(given).for_each(|(first, count)| unwritten.begin(first, count));
        for op in &program.ops {
            if let Some(RegSpan { first, count }) = op.undefines() {
                unwritten.begin(first, count);
            }
        }
        // Copies of what is not written are not written either, nor are copies of those.
        loop {
            let before = unwritten.count();
            program.ops.iter().for_each(|op| unwritten.may_copy(op));
            if unwritten.count() == before {
                break;
            }
        }
        let ops = program.ops.iter().map(|op| {
            // Shaders that are called write what they are given.
            if op.calls_pipeline() {
                return false;
            }
            let mut writes = op.undefines().is_some() || op.computed_registers().is_some();
            op.accesses(|access| {
                if let Access::Write(first, count) = access {
                    writes |= (0..count).any(|word| unwritten.contains(first.plus(word)));
                }
            });
            writes
        });
        let ops = ops.collect();
        Self { globals, ops }
    }

    /// Whether an operation writes a variable, or one begins there.
    pub(super) fn concern(&self, op: OpIndex) -> bool {
        self.ops.get(op.index()).copied().unwrap_or_default()
    }

    /// What is unwritten where a shader begins.
    pub(super) fn at_begin(&self) -> UnwrittenRegisters {
        let mut unwritten = UnwrittenRegisters::default();
        self.globals.iter().for_each(|&(first, count)| unwritten.begin(first, count));
        unwritten
    }
}

/// Registers of variables that have begun and have not been written, a bit each.
#[derive(Clone, Debug, Default)]
pub(super) struct UnwrittenRegisters {
    bits: Vec<u64>,
}

impl UnwrittenRegisters {
    /// Whether a register is among them.
    pub(super) fn contains(&self, register: Reg) -> bool {
        let (word, bit) = place(register);
        self.bits.get(word).is_some_and(|bits| bits >> bit & 1 != 0)
    }

    /// A variable begins.
    fn begin(&mut self, first: Reg, count: u32) {
        for register in (0..count).map(|word| first.plus(word)) {
            let (word, bit) = place(register);
            if word >= self.bits.len() {
                self.bits.resize(word + 1, 0);
            }
            self.bits[word] |= 1 << bit;
        }
    }

    /// Registers are written.
    pub(super) fn write(&mut self, first: Reg, count: u32) {
        for register in (0..count).map(|word| first.plus(word)) {
            let (word, bit) = place(register);
            if let Some(bits) = self.bits.get_mut(word) {
                *bits &= !(1 << bit);
            }
        }
    }

    /// An operation has run; `register` reads the registers of the invocation.
    pub(super) fn ran(&mut self, op: &Op, register: &dyn Fn(Reg) -> u32) {
        if let Some(RegSpan { first, count }) = op.undefines() {
            self.begin(first, count);
            return;
        }
        // Nearly all writes of variables are moves of one word.
        if let Some(RegCopy { to, from, .. }) = op.copy() {
            self.write(to, 1);
            self.copy(to, from, 1);
            return;
        }
        written_registers(op, register, &mut |first, count| self.write(first, count));
        let Some(ComputedRegisters { first, index, count, other, writes }) = op.computed_registers() else {
            return;
        };
        let index = register(index);
        if index != OUT_OF_BOUNDS {
            let computed = first.computed(index);
            let (to, from) = if writes { (computed, other) } else { (other, computed) };
            self.copy(to, from, count);
        }
    }

    /// Registers become copies of others: those are not written of which the others are not.
    fn copy(&mut self, to: Reg, from: Reg, count: u32) {
        for word in 0..count {
            if self.contains(from.plus(word)) {
                self.begin(to.plus(word), 1);
            }
        }
    }

    /// Adds what an operation may copy, whatever the index.
    fn may_copy(&mut self, op: &Op) {
        if let Some(RegCopy { to, from, .. }) = op.copy() {
            self.copy(to, from, 1);
        }
        if let Some(ComputedRegisters { other, count, writes: false, .. }) = op.computed_registers() {
            self.begin(other, count);
        }
    }

    /// How many there are.
    fn count(&self) -> u32 {
        self.bits.iter().map(|bits| bits.count_ones()).sum()
    }

    /// Takes over what is known of a payload or callable data that other registers hold.
    pub(super) fn take(&mut self, to: Reg, from: &Self, first: Reg, count: u32) {
        for word in 0..count {
            match from.contains(first.plus(word)) {
                true => self.begin(to.plus(word), 1),
                false => self.write(to.plus(word), 1),
            }
        }
    }
}

/// Tells the registers that an operation that ran has written; `register` reads the registers of
/// the invocation.
pub(super) fn written_registers(op: &Op, register: &dyn Fn(Reg) -> u32, visit: &mut dyn FnMut(Reg, u32)) {
    if let Some(ComputedRegisters { count, first, index, writes: true, .. }) = op.computed_registers() {
        let index = register(index);
        if index != OUT_OF_BOUNDS {
            visit(first.computed(index), count);
        }
        return;
    }
    op.accesses(|access| {
        if let Access::Write(first, count) = access {
            visit(first, count);
        }
    });
}

/// The word and the bit of a register.
fn place(register: Reg) -> (usize, u32) {
    (register.0 as usize / 64, register.0 % 64)
}

/// The payload or callable data that a shader is given.
pub(super) fn incoming(program: &Program) -> Option<&InterfaceRegisters> {
    let classes = [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA];
    classes.into_iter().find_map(|class| program.interface_registers(class))
}
