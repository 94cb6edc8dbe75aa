//! Translates instructions of a module to operations on registers.
//!
//! A [`Translator`] keeps what each id stands for: the registers of its words, or where a pointer
//! points. Composites are scalarized here: extracting, inserting and shuffling only rearrange the
//! list of registers. It also folds constants and forwards stores of variables to loads.

pub(super) mod budget;
mod constants;
mod fingerprint;
mod ids;
mod values;
mod words;

use std::cell::OnceCell;
use std::ops::Range;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::machine::stop::RegSpan;
use crate::machine::{Binding, OpIndex, Reg, Registers};
use crate::math::array;
use crate::module::decoration::number;
use crate::module::interface::Stage;
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, GlobalVariable, Id, Instruction, Module, Opcode};
use crate::ops::builtin::Builtin;
use crate::ops::float_controls::{self, FloatControls};
use crate::ops::lane_kernel::{LaneKernel, OpFamily};
use crate::ops::memory;
use crate::ops::op::Op;
use crate::ops::pointer::storage;
use crate::ops::value_registers::{UndefinedConstant, Words, registers_from};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::InputLimit;
use budget::named;
use fingerprint::Fingerprint;
use values::Values;

pub use constants::array_length;
pub use values::{IdValue, IdValues};

/// A descriptor binding that a program uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Where it is bound.
    pub binding: Binding,
    /// The variable's name, for messages.
    pub name: String,
    /// The variable.
    pub variable: Id,
}

/// The bytes that a variable of the Workgroup storage class occupies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorkgroupVariable {
    /// The variable.
    pub id: Id,
    /// Where it lies in the workgroup's memory.
    pub bytes: Range<u32>,
    /// Whether it has an initializer, which is null.
    pub is_initialized: bool,
    /// Whether it is a block with a layout of its own; else it lies there as in registers.
    pub is_block: bool,
}

/// Registers that a variable of the entry point's interface occupies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InterfaceRegisters {
    /// The variable.
    pub variable: Id,
    /// Its storage class.
    pub storage_class: u32,
    /// The pointee.
    pub ty: TypeId,
    /// The first register.
    pub first: Reg,
    /// The number of registers.
    pub count: u32,
    /// For payloads and callable data, a hash of their scalar types; see
    /// [`Translator::scalar_fingerprint`].
    pub scalar_fingerprint: u64,
}

impl InterfaceRegisters {
    /// The registers as a span.
    pub fn span(&self) -> RegSpan {
        RegSpan { first: self.first, count: self.count }
    }
}

/// A builtin that a program reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputRegisters {
    /// The builtin.
    pub builtin: &'static Builtin,
    /// The first register.
    pub first: Reg,
    /// The number of registers.
    pub count: u32,
}

/// Where an operation comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Origin {
    /// The instruction, in words from the start of the module.
    pub offset: u32,
    /// Index of the inlined call that it belongs to, 0 for none.
    pub scope: u32,
}

/// Translates instructions into operations; see the module's documentation.
#[derive(Debug)]
pub struct Translator<'m> {
    /// The module.
    pub module: &'m Module,
    /// The stage of the entry point that is lowered.
    pub stage: Stage,
    /// The operations so far.
    pub ops: Vec<Op>,
    /// Where each operation comes from.
    pub origins: Vec<Origin>,
    /// Where the current instruction comes from.
    pub origin: Origin,
    /// The float controls that the entry point declares.
    pub float_controls: FloatControls,
    /// The descriptor bindings used.
    pub slots: Vec<Slot>,
    /// The builtins read.
    pub inputs: Vec<InputRegisters>,
    /// The registers of interface variables.
    pub interface: Vec<InterfaceRegisters>,
    /// Registers that are reached through a computed register number.
    pub addressed: Vec<(Reg, u32)>,
    /// Bytes of workgroup memory so far.
    pub workgroup_size: u32,
    /// Whether the variables in workgroup memory are blocks, which all begin at its first byte and
    /// have a layout (`SPV_KHR_workgroup_memory_explicit_layout`).
    pub workgroup_blocks: bool,
    /// The variables in workgroup memory so far.
    pub workgroup_variables: Vec<WorkgroupVariable>,
    /// Whether the entry point is a compute shader with a derivative group.
    pub derivatives: bool,
    /// Whether stores are forwarded to loads, and operations on constants are folded. Constants of
    /// the module are always folded, as types depend on them.
    pub optimizes: bool,
    /// The constant that says whether its ray queries look at opacity micromaps
    /// (`OpacityMicromapIdKHR`).
    pub micromap_mode: Option<Id>,
    /// Registers of variables, which begin as zeros.
    pub variables: Vec<(Reg, u32)>,
    /// The registers that count the instructions of the shader, where it reads its clock.
    clock: Option<Reg>,
    /// Instructions since the clock was set last.
    ticks: u32,
    values: Values,
    /// What ids of functions stood for, where nothing is optimised.
    recorded: IdValues,
    registers: u32,
    /// The most registers that there may be ([`InputLimit::Registers`]).
    max_registers: u32,
    /// Registers that values name, counted once for each value.
    named_registers: u64,
    /// The results of `OpUndef` at module scope, where nothing is optimised.
    pub undefined_constants: Vec<UndefinedConstant>,
    /// Operations that compute constants again; see [`crate::program::Program`].
    pub constant_operations: FxHashMap<OpIndex, u32>,
    /// The constants whose operations were executed in the open block.
    pub executed_constants: FxHashSet<Id>,
    constants: FxHashMap<u32, Reg>,
    wide_constants: FxHashMap<u64, Reg>,
    /// The words of constants, indexed by register.
    words: Vec<Option<u32>>,
    /// By register of a variable: the epoch of the entry, and another register that holds the
    /// variable's current value (store-to-load forwarding).
    known_values: Vec<(u32, Reg)>,
    /// The current epoch; entries of `known_values` from an earlier epoch are invalid.
    known_values_epoch: u32,
    /// The number of words of a value, indexed by type.
    word_counts: Vec<Option<u32>>,
    /// By type: what its scalars are; see [`Translator::scalar_fingerprint`].
    fingerprints: FxHashMap<TypeId, Fingerprint>,
    /// By the id of a function: the operands of every call of it; see [`Translator::calls`].
    calls: OnceCell<FxHashMap<Id, Vec<&'m [u32]>>>,
    /// Whether a constant of the module is being translated.
    pub(super) in_constant: bool,
    /// Registers in which operations on constants are folded: two for the result, and two for each
    /// operand.
    folding_registers: Registers<1>,
}

impl<'m> Translator<'m> {
    /// A translator for an entry point of a module.
    pub fn new(module: &'m Module, stage: Stage) -> Self {
        Self {
            module,
            stage,
            ops: Vec::new(),
            origins: Vec::new(),
            origin: Origin { offset: 0, scope: 0 },
            float_controls: FloatControls::default(),
            slots: Vec::new(),
            inputs: Vec::new(),
            interface: Vec::new(),
            addressed: Vec::new(),
            workgroup_size: 0,
            workgroup_blocks: false,
            workgroup_variables: Vec::new(),
            derivatives: false,
            optimizes: true,
            micromap_mode: None,
            variables: Vec::new(),
            clock: None,
            ticks: 0,
            values: Values::new(module),
            recorded: IdValues::default(),
            registers: 0,
            max_registers: module.limits.get(InputLimit::Registers) as u32,
            named_registers: 0,
            undefined_constants: Vec::new(),
            constant_operations: FxHashMap::default(),
            executed_constants: FxHashSet::default(),
            constants: FxHashMap::default(),
            wide_constants: FxHashMap::default(),
            words: Vec::new(),
            known_values: Vec::new(),
            known_values_epoch: 1,
            word_counts: vec![None; module.types.len()],
            fingerprints: FxHashMap::default(),
            calls: OnceCell::new(),
            in_constant: false,
            folding_registers: Registers::new(8),
        }
    }

    /// How many registers there are so far.
    pub fn register_count(&self) -> u32 {
        self.registers
    }

    /// The registers of constants with their words, ascending.
    pub fn constant_registers(&self) -> impl Iterator<Item = (Reg, u32)> {
        (0..).zip(&self.words).filter_map(|(register, word)| Some((Reg(register), (*word)?)))
    }

    /// Counts an instruction, for `OpReadClockKHR`.
    pub fn tick(&mut self) {
        self.ticks += 1;
    }

    /// Adds the instructions counted since the last time to the clock; called before a block ends.
    pub fn set_clock(&mut self) -> Result<()> {
        const SHADER_CLOCK: u32 = 5055;
        let ticks = std::mem::take(&mut self.ticks);
        if !self.module.capabilities.contains(&SHADER_CLOCK) {
            return Ok(());
        }
        let clock = match self.clock {
            Some(clock) => clock,
            None => {
                let clock = self.fresh(2)?;
                self.variables.push((clock, 2));
                *self.clock.insert(clock)
            }
        };
        let more = self.wide_constant(ticks.into())?;
        let sum = self.emit_family(&crate::ops::arithmetic::IAdd, 64, &[clock, more])?;
        for word in 0..2 {
            let (to, from) = (clock.plus(word), sum.plus(word));
            self.emit(Op::Memory(memory::MemoryOp::MoveMasked { to, from }));
        }
        Ok(())
    }

    /// The instructions that the invocation has executed in this shader so far, as two words.
    pub fn read_clock(&mut self) -> Result<Words> {
        self.set_clock()?;
        let clock = self
            .clock
            .ok_or_else(|| self.invalid("OpReadClockKHR requires the capability ShaderClockKHR"))?;
        let to = self.fresh_words(2)?;
        for (word, &to) in to.iter().enumerate() {
            self.emit(Op::Memory(memory::MemoryOp::Move { to, from: clock.plus(word as u32) }));
        }
        Ok(to)
    }

    /// An error about the current instruction.
    pub fn error(&self, kind: ErrorKind, message: impl Into<String>) -> Error {
        let error = Error::new(kind, message).at(Place::Word(self.origin.offset as usize));
        let debug = &self.module.debug_info;
        match debug.line_at(self.origin.offset) {
            Some(line) => {
                let file =
                    debug.files.get(line.file as usize).map_or_else(String::new, |file| file.name.clone());
                error.at(Place::Line { file, line: line.line, column: line.column })
            }
            None => error,
        }
    }

    /// The error of a module that breaks a rule at the current instruction.
    pub fn invalid(&self, message: impl Into<String>) -> Error {
        self.error(ErrorKind::InvalidModule, message)
    }

    /// The error of a type in a buffer without a layout decoration.
    ///
    /// The validator requires these in four storage classes; for the others, such as shader
    /// records, no rule does.
    pub fn missing_layout(&self, storage_class: u32, message: impl Into<String>) -> Error {
        use crate::ops::pointer::storage;
        match storage_class {
            storage::UNIFORM
            | storage::STORAGE_BUFFER
            | storage::PHYSICAL_STORAGE_BUFFER
            | storage::PUSH_CONSTANT => {
                self.invalid(message).note("SPIR-V, 2.16.2: buffers must be explicitly laid out")
            }
            _ => self.unsupported(message),
        }
    }

    /// The error of an instruction that this crate does not run.
    pub fn unsupported(&self, message: impl Into<String>) -> Error {
        self.error(ErrorKind::UnsupportedModule, message)
    }

    /// New consecutive registers.
    pub fn fresh(&mut self, count: u32) -> Result<Reg> {
        let first = Reg(self.registers);
        self.registers = self.registers.saturating_add(count);
        if self.registers > self.max_registers {
            return Err(self.beyond(InputLimit::Registers, Some(self.registers.into())));
        }
        Ok(first)
    }

    /// New consecutive registers as a list.
    pub fn fresh_words(&mut self, count: u32) -> Result<Words> {
        Ok(registers_from(self.fresh(count)?, count))
    }

    /// Appends an operation.
    #[inline]
    pub fn emit(&mut self, op: Op) {
        self.ops.push(op);
        self.origins.push(self.origin);
    }

    /// The register that holds a constant word.
    pub fn constant(&mut self, word: u32) -> Result<Reg> {
        if let Some(&reg) = self.constants.get(&word) {
            return Ok(reg);
        }
        let reg = self.fresh(1)?;
        self.constants.insert(word, reg);
        self.set_constant(reg, word);
        Ok(reg)
    }

    pub(super) fn set_constant(&mut self, reg: Reg, word: u32) {
        self.words.resize(self.words.len().max(reg.0 as usize + 1), None);
        self.words[reg.0 as usize] = Some(word);
    }

    /// The first of two registers that hold a constant of 64 bits.
    pub fn wide_constant(&mut self, bits: u64) -> Result<Reg> {
        if let Some(&reg) = self.wide_constants.get(&bits) {
            return Ok(reg);
        }
        let reg = self.fresh(2)?;
        self.wide_constants.insert(bits, reg);
        self.set_constant(reg, bits as u32);
        self.set_constant(reg.plus(1), (bits >> 32) as u32);
        Ok(reg)
    }

    /// The word of a register, where it is constant.
    pub fn constant_word(&self, reg: Reg) -> Option<u32> {
        self.words.get(reg.0 as usize).copied().flatten()
    }

    /// Appends a kernel on the given operands, or folds it if all of them are constants. Returns
    /// the first register of the result.
    #[inline]
    pub fn emit_kernel(&mut self, kernel: &'static LaneKernel, from: &[Reg]) -> Result<Reg> {
        if self.float_controls.affects(kernel) {
            return float_controls::emit_controlled(self, kernel, from);
        }
        self.emit_uncontrolled(kernel, from)
    }

    /// Does what [`Translator::emit_kernel`] does, but ignores the float controls.
    pub fn emit_uncontrolled(&mut self, kernel: &'static LaneKernel, from: &[Reg]) -> Result<Reg> {
        let first = from.first().copied().unwrap_or(Reg(0));
        let operands = std::array::from_fn(|at| from.get(at).copied().unwrap_or(first));
        if (self.optimizes || self.in_constant)
            && let Some(bits) = self.fold(kernel, from)
        {
            return match kernel.words {
                2 => self.wide_constant(bits),
                _ => self.constant(bits as u32),
            };
        }
        let to = self.fresh(kernel.words)?;
        self.emit(Op::LaneKernel { kernel, to, from: operands });
        Ok(to)
    }

    /// Appends the kernel that a family has for operands of `width` bits; see
    /// [`Translator::emit_kernel`].
    pub fn emit_family(&mut self, family: &'static OpFamily, width: u32, from: &[Reg]) -> Result<Reg> {
        match family.kernel(width) {
            Some(kernel) => self.emit_kernel(kernel, from),
            None => {
                Err(self.unsupported(format!("Op{} on {width}-bit operands is not supported", family.name)))
            }
        }
    }

    fn fold(&mut self, kernel: &LaneKernel, from: &[Reg]) -> Option<u64> {
        let mut operands = [Reg(2); 3];
        for (at, &reg) in from.iter().enumerate() {
            operands[at] = Reg(2 + 2 * at as u32);
            for word in 0..kernel.operands[at] {
                self.folding_registers[operands[at].plus(word)].0[0] = self.constant_word(reg.plus(word))?;
            }
        }
        (kernel.eval_1)(self.folding_registers.all_mut(), Reg(0), &operands);
        let [low, high] = array::map([Reg(0), Reg(1)], |reg| u64::from(self.folding_registers[reg].0[0]));
        Some(low | high << 32)
    }

    /// The first of two consecutive registers that hold two words, copied if need be.
    pub fn pair(&mut self, low: Reg, high: Reg) -> Result<Reg> {
        if high == low.plus(1) {
            return Ok(low);
        }
        if let (Some(low), Some(high)) = (self.constant_word(low), self.constant_word(high)) {
            return self.wide_constant(u64::from(low) | u64::from(high) << 32);
        }
        let to = self.fresh(2)?;
        self.emit(Op::Memory(memory::MemoryOp::Move { to, from: low }));
        self.emit(Op::Memory(memory::MemoryOp::Move { to: to.plus(1), from: high }));
        Ok(to)
    }

    /// Returns the first of consecutive registers that hold the words; copies them where they lie
    /// apart.
    pub fn consecutive(&mut self, words: &[Reg]) -> Result<Reg> {
        let first = words.first().copied().unwrap_or(Reg(0));
        if words.iter().enumerate().all(|(at, &reg)| reg == first.plus(at as u32)) {
            return Ok(first);
        }
        let to = self.fresh(words.len() as u32)?;
        for (at, &from) in words.iter().enumerate() {
            self.emit(Op::Memory(memory::MemoryOp::Move { to: to.plus(at as u32), from }));
        }
        Ok(to)
    }

    /// The operands of every call of a function in the module, itself the first of them.
    pub(super) fn calls(&self, function: Id) -> &[&'m [u32]] {
        let module = self.module;
        let calls = self.calls.get_or_init(|| {
            let mut calls: FxHashMap<Id, Vec<&'m [u32]>> = FxHashMap::default();
            for call in module.instructions() {
                if let (Opcode::FunctionCall, operands @ [callee, ..]) = (call.opcode, module.operands(call))
                {
                    calls.entry(Id(*callee)).or_default().push(operands);
                }
            }
            calls
        });
        calls.get(&function).map_or(&[], Vec::as_slice)
    }

    fn is_aliased(&self, variable: &GlobalVariable) -> bool {
        self.module.decorations.find(variable.id, number::ALIASED).is_some()
    }

    /// The bytes at the start of workgroup memory that variables with `Aliased` share.
    fn aliased_workgroup_bytes(&self) -> u32 {
        let variables = self.module.variables.iter();
        let shared = variables.filter(|one| one.storage_class == storage::WORKGROUP && self.is_aliased(one));
        let size = shared.filter_map(|one| self.module.size_of(one.ty?)).max().unwrap_or(0);
        u32::try_from(size).unwrap_or(u32::MAX)
    }

    /// Allocates a variable of the Workgroup storage class; returns its bytes. Variables that have
    /// a layout of their own and the decoration `Aliased` share the first ones.
    ///
    /// # Errors
    /// `InvalidModule` where variables with and without a layout of their own are mixed,
    /// `UnsupportedModule` for more memory than a workgroup gets.
    pub fn allocate_workgroup(&mut self, variable: &GlobalVariable, ty: TypeId) -> Result<Range<u32>> {
        let is_untyped = matches!(self.module.ty(variable.pointer), Type::Pointer { pointee: None, .. });
        let block = is_untyped || matches!(self.module.ty(ty), Type::Struct { block: true, .. });
        if block != self.workgroup_blocks && (self.workgroup_size > 0 || !block) {
            let message = "either all variables in workgroup memory must have a layout of their own, or none";
            return Err(self.invalid(message).note("SPV_KHR_workgroup_memory_explicit_layout"));
        }
        self.workgroup_blocks = block;
        let size = match block {
            true => self.module.size_of(ty).ok_or_else(|| self.invalid("the block has no size"))?,
            false => u64::from(self.word_count(ty)?) * 4,
        };
        let (start, aliased) = match (block, self.is_aliased(variable)) {
            (true, true) => (0, 0),
            (true, false) => (self.workgroup_size, self.aliased_workgroup_bytes()),
            (false, _) => (self.workgroup_size, 0),
        };
        let start = start.max(aliased).next_multiple_of(8);
        let end = size.saturating_add(start.into());
        if end > self.module.limits.get(InputLimit::WorkgroupBytes) {
            return Err(self.beyond(InputLimit::WorkgroupBytes, Some(end)));
        }
        self.workgroup_size = self.workgroup_size.max(end as u32);
        Ok(start..end as u32)
    }

    /// Records, until the block ends, that a variable's register has the value of another register.
    #[inline]
    pub fn set_known_value(&mut self, variable: Reg, value: Reg) {
        let registers = self.known_values.len().max(variable.0 as usize + 1);
        self.known_values.resize(registers, (0, Reg(0)));
        self.known_values[variable.0 as usize] = (self.known_values_epoch, value);
    }

    /// The register that holds a variable's current value, where that is known.
    pub fn known_value(&self, variable: Reg) -> Option<Reg> {
        let &(epoch, value) = self.known_values.get(variable.0 as usize)?;
        (self.optimizes && epoch == self.known_values_epoch).then_some(value)
    }

    /// Invalidates the known values of variables: at a block's start, and where something may
    /// change them.
    pub fn invalidate_known_values(&mut self) {
        self.known_values_epoch += 1;
    }

    /// Defines what an id stands for.
    pub fn define(&mut self, id: Id, value: IdValue) {
        self.named_registers += named(&value);
        if !self.optimizes {
            self.recorded.record(self.origin.scope, id, &value);
        }
        self.values.define(id, value);
    }

    /// What ids stood for, for debuggers: nothing where the program is optimised. It is called when
    /// all is translated.
    pub fn take_id_values(&mut self) -> IdValues {
        let mut recorded = std::mem::take(&mut self.recorded);
        if !self.optimizes {
            std::mem::replace(&mut self.values, Values::new(self.module)).add_globals(&mut recorded);
        }
        recorded
    }

    /// What an id of the function that is lowered stands for.
    pub fn local(&self, id: Id) -> Option<&IdValue> {
        self.values.local(id)
    }

    /// The number of defined ids of functions; [`Translator::truncate_locals`] goes back to it.
    pub fn local_count(&self) -> usize {
        self.values.local_count()
    }

    /// Discards the definitions of ids of functions, except for the first `locals`: called at the
    /// end of a function.
    pub fn truncate_locals(&mut self, locals: usize) {
        self.values.truncate_locals(locals);
    }

    /// Defines the result of an instruction as words.
    pub fn define_result(&mut self, instruction: &Instruction, words: Words) {
        if let Some(id) = instruction.result {
            self.define(id, IdValue::Words(words));
        }
    }

    /// Checks that the result of an instruction has as many words as its type: its uses rely on the
    /// type.
    pub fn check_result(&mut self, instruction: &Instruction) -> Result<()> {
        let (Some(id), Some(_)) = (instruction.result, instruction.result_type) else { return Ok(()) };
        let Some(IdValue::Words(words)) = self.local(id) else { return Ok(()) };
        let found = words.len();
        let ty = self.result_type(instruction)?;
        if self.word_count(ty)? as usize == found {
            return Ok(());
        }
        let name = self.module.describe_type(ty);
        let opcode = instruction.opcode;
        Err(self.invalid(format!("the operands of {opcode} do not match its result type {name}")))
    }

    /// The result type of an instruction.
    ///
    /// # Errors
    /// `InvalidModule` where it has none.
    #[inline]
    pub fn result_type(&self, instruction: &Instruction) -> Result<TypeId> {
        let id = instruction.result_type.ok_or_else(|| self.invalid("the instruction has no result type"))?;
        self.type_id(id)
    }

    /// The type that an id stands for.
    #[inline]
    pub fn type_id(&self, id: Id) -> Result<TypeId> {
        match self.module.definition(id) {
            Some(Definition::Type(ty)) => Ok(ty),
            _ => Err(self.invalid(format!("%{} is not a type", id.0))),
        }
    }

    /// The type of a value's id.
    #[inline]
    pub fn type_of(&self, id: Id) -> Result<TypeId> {
        self.module.type_of(id).ok_or_else(|| self.invalid(format!("%{} has no type", id.0)))
    }

    /// An operand that is an id.
    #[inline]
    pub fn id(&self, instruction: &Instruction, at: usize) -> Result<Id> {
        self.literal(instruction, at).map(Id)
    }

    /// An operand word.
    #[inline]
    pub fn literal(&self, instruction: &Instruction, at: usize) -> Result<u32> {
        let word = self.module.operands(instruction).get(at).copied();
        word.ok_or_else(|| self.invalid(format!("operand {at} is missing")))
    }

    /// All operand words.
    #[inline]
    pub fn operands(&self, instruction: &Instruction) -> &'m [u32] {
        self.module.operands(instruction)
    }

    /// The words of an operand that is a value's id.
    pub fn operand(&mut self, instruction: &Instruction, at: usize) -> Result<Words> {
        let id = self.id(instruction, at)?;
        self.words(id)
    }
}
