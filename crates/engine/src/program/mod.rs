//! A program: one entry point of a module, lowered to operations on registers.
//!
//! [`lower()`] translates it, `copy_propagation`, [`dce`], `regalloc` and `schedule` optimise it,
//! [`verify`] checks what they did, and [`race_analysis`] finds out which memory invocations share.

mod call_graph;
pub mod control_flow;
mod copy_propagation;
pub mod dce;
pub mod descriptors;
mod loop_report;
mod loop_variable;
pub mod lower;
mod obstacles;
mod out_of_bounds;
pub mod payload;
pub mod print;
pub mod race_analysis;
mod regalloc;
mod schedule;
pub mod source_map;
mod trap_operands;
pub mod verify;
pub mod workgroup;
#[cfg(test)]
mod written_program;

use std::ops::Range;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::accel::RayRule;
use crate::machine::device_memory::STRUCTURE_HANDLE;
use crate::machine::{
    AccessFault, Batch, Binding, Bindings, BlockIndex, Exit, LaneTrap, Mask, OpIndex, Reg, Registers,
    TrapCode,
};
use crate::math::array;
use crate::module::interface::{EntryPoint, Stage};
use crate::module::ty::Type;
use crate::module::{Id, Module, Opcode};
use crate::ops::heap_descriptor::HEAP_BYTES;
use crate::ops::memory::BufferRef;
use crate::ops::op::Op;
use crate::ops::translate::{IdValues, InputRegisters, InterfaceRegisters, Origin, Slot, WorkgroupVariable};
use crate::ops::value_registers::UndefinedConstant;
use crate::ops::{ray_rules, superop};
use crate::program::payload::Payloads;
use crate::program::race_analysis::MemoryAccess;
use crate::reflect::{Layout, Rules};
use anyhit_base::error::names::nearest;
use anyhit_base::error::{Error, ErrorKind, Result};

pub use copy_propagation::for_each_terminator_read;
pub use loop_variable::LoopVariable;
use lower::lower_reference;
pub use lower::{Inlining, LowerOptions, Optimization, lower, lower_with};
pub use obstacles::obstacles;
pub use regalloc::{OptimizedCode, Superblock};
pub use workgroup::{DerivativeGroup, WorkgroupLayout};

/// How a block ends, and its successors: blocks of a program, or labels while it is lowered.
#[derive(Clone, Debug, PartialEq)]
pub enum Terminator<B = BlockIndex> {
    /// Branches to a block.
    Branch(B),
    /// Branches to `then` where the register is not zero, else to `other`.
    BranchConditional {
        /// The register of the bool.
        condition: Reg,
        /// The block where it is true.
        then: B,
        /// The block where it is false.
        other: B,
    },
    /// Branches to the block of the first case that equals the selector.
    Switch {
        /// One register, or two where the selector has 64 bits.
        selector: Reg,
        /// Whether it has 64 bits.
        wide: bool,
        /// The values of the cases and their blocks.
        cases: Box<[(u64, B)]>,
        /// The block where no case matches.
        default: B,
    },
    /// Calls a function; continues at `return_to` afterwards.
    Call {
        /// The function's first block.
        function: B,
        /// The block at which the caller continues.
        return_to: B,
    },
    /// Ends the function.
    Return,
    /// Ends the invocation.
    Exit(Exit),
    /// Must not be reached.
    Unreachable,
}

impl<B> Terminator<B> {
    /// The terminator with other names for its blocks.
    fn map<C>(self, mut rename: impl FnMut(B) -> C) -> Terminator<C> {
        match self {
            Self::Branch(to) => Terminator::Branch(rename(to)),
            Self::BranchConditional { condition, then, other } => {
                Terminator::BranchConditional { condition, then: rename(then), other: rename(other) }
            }
            Self::Switch { selector, wide, cases, default } => {
                let default = rename(default);
                let cases = cases.into_iter().map(|(value, to)| (value, rename(to))).collect();
                Terminator::Switch { selector, wide, cases, default }
            }
            Self::Call { function, return_to } => {
                Terminator::Call { function: rename(function), return_to: rename(return_to) }
            }
            Self::Return => Terminator::Return,
            Self::Exit(exit) => Terminator::Exit(exit),
            Self::Unreachable => Terminator::Unreachable,
        }
    }
}

/// A basic block: operations that run one after the other, and a terminator.
#[derive(Clone, Debug, PartialEq)]
pub struct Block<B = BlockIndex> {
    /// The first operation.
    pub first: OpIndex,
    /// One past the last operation.
    pub end: OpIndex,
    /// How the block ends.
    pub terminator: Terminator<B>,
    /// The number of module instructions in the blocks up to the end of this one, including
    /// eliminated ones. The difference of two blocks is the fuel that a back edge costs.
    pub instructions: u32,
}

/// Consecutive instructions of the module that run in one block of a program. Eliminated ones
/// count among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstructionSpan {
    /// The program's block.
    pub block: BlockIndex,
    /// The inlined call that they belong to; see [`Program::scopes`].
    pub scope: u32,
    /// The word offset of the first.
    pub first: u32,
    /// The word offset of the last.
    pub last: u32,
    /// The number of instructions.
    pub count: u32,
}

/// A call that was inlined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scope {
    /// The scope around it; 0 is the entry point.
    pub parent: u32,
    /// The word offset of the call.
    pub call: u32,
    /// The function.
    pub function: Id,
}

/// One entry point, ready to run. It does not change while it runs.
#[derive(Clone)]
#[must_use]
pub struct Program {
    /// The module of the entry point.
    pub module: Arc<Module>,
    /// The stage.
    pub stage: Stage,
    /// The entry point's name.
    pub name: String,
    /// Which calls were inlined.
    #[doc(hidden)]
    pub inlining: Inlining,
    /// All operations.
    #[doc(hidden)]
    pub ops: Vec<Op>,
    /// By operation of a program that is not optimised: whether the optimizer eliminates it, so
    /// that it must not trap here either; false throughout in a program for the sanitizer. Empty in
    /// optimised programs.
    #[doc(hidden)]
    pub silent: Vec<bool>,
    /// The operations that batches without an observer run.
    #[doc(hidden)]
    pub optimized: OptimizedCode,
    /// The origin of each operation, then the origin of each block's terminator.
    #[doc(hidden)]
    pub origins: Vec<Origin>,
    /// The inlined calls; the first is the entry point itself.
    #[doc(hidden)]
    pub scopes: Vec<Scope>,
    /// All blocks in structured order; the entry point begins at 0.
    #[doc(hidden)]
    pub blocks: Vec<Block>,
    /// The instructions of the module that the blocks run, in the order in which they run them.
    #[doc(hidden)]
    pub instruction_spans: Vec<InstructionSpan>,
    /// By function that is not inlined, the entry point first: its first block, ascending, and the
    /// instructions of all its blocks, which a call costs.
    #[doc(hidden)]
    pub functions: Vec<(BlockIndex, u32)>,
    /// The variables and phis of which the report of an endless loop tells.
    #[doc(hidden)]
    pub loop_variables: Vec<LoopVariable>,
    /// Their registers.
    #[doc(hidden)]
    pub watched: Arc<[Reg]>,
    /// How many registers a batch needs.
    #[doc(hidden)]
    pub register_count: u32,
    /// Registers that hold constants.
    #[doc(hidden)]
    pub constants: Vec<(Reg, u32)>,
    /// Those of them that are undefined, where the program is not optimised.
    #[doc(hidden)]
    pub undefined_constants: Vec<UndefinedConstant>,
    /// By operation that computes a constant of the module again, for the sanitizer: the word
    /// offset of that constant. Their results are not read.
    #[doc(hidden)]
    pub constant_operations: FxHashMap<OpIndex, u32>,
    /// The descriptor bindings, by slot.
    #[doc(hidden)]
    pub slots: Vec<Slot>,
    /// The builtins that are read.
    #[doc(hidden)]
    pub inputs: Vec<InputRegisters>,
    /// The registers of payload, attribute and other interface variables.
    #[doc(hidden)]
    pub interface: Vec<InterfaceRegisters>,
    /// The registers of all variables.
    #[doc(hidden)]
    pub variables: Vec<(Reg, u32)>,
    /// Whether the results of a launch depend on how its invocations interleave; see
    /// [`crate::ops::atomic`].
    #[doc(hidden)]
    pub order_dependent: bool,
    /// Its accesses to memory that all invocations share.
    #[doc(hidden)]
    pub accesses: Vec<MemoryAccess>,
    /// Whether it has subgroup operations, so that its subgroup must run together.
    #[doc(hidden)]
    pub uses_subgroups: bool,
    /// The workgroups of a compute entry point.
    #[doc(hidden)]
    pub workgroup: Option<WorkgroupLayout>,
    /// The variables in workgroup memory.
    #[doc(hidden)]
    pub workgroup_variables: Vec<WorkgroupVariable>,
    /// Whether it queries device addresses of shader records.
    #[doc(hidden)]
    pub addresses_records: bool,
    /// What lowering eliminated, as no output depends on it.
    #[doc(hidden)]
    pub eliminated: Eliminated,
    /// Which words of payloads it reads and writes.
    #[doc(hidden)]
    pub payloads: Payloads,
    /// What each id stands for, for debuggers; empty where the program is optimised.
    #[doc(hidden)]
    pub id_values: IdValues,
}

/// How much dead code lowering eliminated: no output of the program depends on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Eliminated {
    /// The number of operations.
    pub operations: u32,
    /// The number of builtins that the shader loads and that are not computed.
    pub builtins: u32,
}

impl Block {
    /// The indices of its operations.
    #[inline]
    pub fn ops(&self) -> Range<usize> {
        self.first.index()..self.end.index()
    }
}

impl Program {
    /// Lowers the entry point with a name.
    ///
    /// # Errors
    /// `InvalidArgument` where no entry point or several have the name, and what [`lower()`]
    /// refuses.
    pub fn of(module: &Arc<Module>, entry: &str) -> Result<Self> {
        let named: Vec<_> = module.entry_points.iter().filter(|known| known.name == entry).collect();
        if let [only] = named[..] {
            return lower(module, only);
        }
        let list = |entries: &[&EntryPoint]| {
            let one = |entry: &&EntryPoint| format!("`{}` ({})", entry.name, entry.stage.name());
            entries.iter().map(one).collect::<Vec<_>>().join(", ")
        };
        let (message, entries) = match named.is_empty() {
            true => ("the module has no entry point", module.entry_points.iter().collect()),
            false => ("the module has several entry points", named),
        };
        let error = Error::new(ErrorKind::InvalidArgument, format!("{message} `{entry}`"))
            .note(format!("entry points: {}", list(&entries)));
        Err(match nearest(entry, module.entry_points.iter().map(|known| known.name.as_str())) {
            Some(near) if near != entry => error.note(format!("did you mean `{near}`?")),
            _ => error,
        })
    }

    /// Lowers the entry point with a stage and a name.
    ///
    /// # Errors
    /// `InvalidArgument` where there is none, and what [`lower()`] refuses.
    pub fn with_stage(module: &Arc<Module>, stage: Stage, entry: &str) -> Result<Self> {
        let found = module.entry_points.iter().find(|known| known.stage == stage && known.name == entry);
        let message = || format!("the module has no {} entry point `{entry}`", stage.name());
        lower(module, found.ok_or_else(|| Error::new(ErrorKind::InvalidArgument, message()))?)
    }

    /// Whether its results may depend on which invocations form a subgroup: it has subgroup
    /// instructions, or reads builtins of the subgroup.
    #[doc(hidden)]
    pub fn sees_subgroups(&self) -> bool {
        /// `SubgroupSize`, `NumSubgroups`, `SubgroupId`, `SubgroupLocalInvocationId`,
        /// `SubgroupEqMask` and its siblings.
        const BUILTINS: [u32; 9] = [36, 38, 40, 41, 4416, 4417, 4418, 4419, 4420];
        let reads_one = || self.inputs.iter().any(|input| BUILTINS.contains(&input.builtin.number));
        self.uses_subgroups || reads_one()
    }

    /// Lowers the entry point of this program again, without any optimisation: the reference that
    /// an optimised program is checked against. It gives the same results, slowly.
    ///
    /// # Errors
    /// As [`lower()`].
    #[doc(hidden)]
    pub fn unoptimized(&self) -> Result<Self> {
        let is_reference = !self.silent.is_empty();
        if is_reference {
            return Ok(self.clone());
        }
        let is_this = |entry: &&EntryPoint| entry.stage == self.stage && entry.name == self.name;
        let entry = self.module.entry_points.iter().find(is_this);
        let entry = entry.expect("bug in anyhit: the program's entry point is not in its module");
        lower_reference(self, entry, Optimization::None)
    }

    /// Returns the program that the sanitizer observes: [`Program::unoptimized`], in which
    /// operations whose results nothing reads trap and race like all others, and those of
    /// specialization constants are executed where an instruction uses the constant.
    ///
    /// # Errors
    /// As [`lower()`].
    #[doc(hidden)]
    pub fn for_sanitizer(&self) -> Result<Self> {
        let is_this = |entry: &&EntryPoint| entry.stage == self.stage && entry.name == self.name;
        let entry = self.module.entry_points.iter().find(is_this);
        let entry = entry.expect("bug in anyhit: the program's entry point is not in its module");
        lower_reference(self, entry, Optimization::Sanitized)
    }

    /// Whether it has no output and no effect, and cannot trap.
    #[doc(hidden)]
    #[inline]
    pub fn is_empty(&self) -> bool {
        let ends =
            |block: &Block| matches!(block.terminator, Terminator::Return | Terminator::Exit(Exit::Returned));
        self.ops.is_empty() && self.blocks.len() == 1 && self.blocks.iter().all(ends)
    }

    /// A batch with the constants in place, ready for [`Program::begin`].
    #[doc(hidden)]
    pub fn batch<const W: usize>(&self) -> Batch<W> {
        let mut registers = Registers::new((self.register_count as usize).max(superop::DIRECT_REGISTERS));
        for &(reg, word) in &self.constants {
            registers[reg].0 = [word; W];
        }
        let mut batch = Batch::new(registers);
        batch.watched = self.watched.clone();
        batch
    }

    /// The instructions that a call of the function which begins at a block costs.
    #[doc(hidden)]
    pub fn call_cost(&self, block: BlockIndex) -> u32 {
        let found = self.functions.binary_search_by_key(&block, |&(first, _)| first);
        found.map_or(1, |at| self.functions[at].1.max(1))
    }

    /// The instructions that an invocation costs a launch, beside those that it is charged for back
    /// edges and calls: all of the entry point, functions that are inlined included.
    #[doc(hidden)]
    pub fn entry_cost(&self) -> u32 {
        self.functions.first().map_or(1, |&(_, instructions)| instructions.max(1))
    }

    /// The terminator of a block, as an index into [`Program::origins`].
    #[doc(hidden)]
    #[inline]
    pub fn terminator_index(&self, block: BlockIndex) -> OpIndex {
        OpIndex::new(self.ops.len()).plus(block.0)
    }

    /// Starts the lanes of a mask, whose invocations are set, each with its fuel, counted in
    /// instructions.
    ///
    /// Variables begin as zeros, so that what a shader reads before it writes does not depend on
    /// what ran in the batch before.
    #[doc(hidden)]
    pub fn begin<const W: usize>(&self, batch: &mut Batch<W>, mask: Mask<W>, fuel: u64) {
        for &(first, count) in &self.variables {
            for register in batch.registers.span_mut(first, count) {
                register.0 = [0; W];
            }
        }
        self.refresh_inputs(batch, mask, false);
        batch.begin(mask, BlockIndex(0), self.blocks[0].first, fuel);
    }

    /// Fills the registers of builtins; with `volatile`, only of those that may change while
    /// running.
    #[doc(hidden)]
    pub fn refresh_inputs<const W: usize>(&self, batch: &mut Batch<W>, mask: Mask<W>, volatile: bool) {
        let Batch { registers, invocations, .. } = batch;
        for input in self.inputs.iter().filter(|input| !volatile || input.builtin.volatile) {
            input.builtin.read.read(invocations, mask, registers.span_mut(input.first, input.count));
        }
    }

    /// The registers of the variable of a storage class of which an entry point has at most one.
    #[doc(hidden)]
    #[inline]
    pub fn interface_registers(&self, storage_class: u32) -> Option<&InterfaceRegisters> {
        self.interface.iter().find(|registers| registers.storage_class == storage_class)
    }

    /// Describes the access that trapped: the offset or coordinate, and the buffer or image.
    #[doc(hidden)]
    pub fn describe_access(
        &self,
        trap: LaneTrap,
        fault_value: u64,
        accessed: Option<&AccessFault>,
    ) -> Option<String> {
        if let TrapCode::InvalidTrace | TrapCode::InvalidRayQuery | TrapCode::InvalidHitObject = trap.code {
            // The fault value is the number of the rule that was violated.
            let first = *self.module.words.get(self.origins.get(trap.op.index())?.offset as usize)?;
            let broken = *RayRule::ALL.get(fault_value as usize)?;
            return Some(ray_rules::describe(Opcode::of_word(first), broken));
        }
        if trap.code == TrapCode::AccelerationStructureMissing {
            // A handle that is no descriptor is a device address.
            let (handle, high) = (fault_value as u32, (fault_value >> 32) as u32);
            let name = self.describe_descriptor(handle).filter(|_| high == STRUCTURE_HANDLE)?;
            return Some(format!("{name} contains none"));
        }
        if trap.code == TrapCode::InvalidHitKind {
            return Some(format!("the hit kind is {fault_value}"));
        }
        if let Some(&AccessFault::HeapOffset { first, offset }) = accessed {
            return Some(format!(
                "byte {offset} of {}, which has at most {HEAP_BYTES}",
                self.heap_binding(first)?
            ));
        }
        let Some(chunk) = self.accessed_chunk(trap.op) else { return self.describe_texel(accessed?) };
        let bytes = chunk.width / 8 * chunk.count;
        let extent = match trap.code {
            TrapCode::IndexOutOfBounds => String::new(),
            _ => format!("{bytes} bytes at offset {fault_value} of "),
        };
        let (handle, size) = match accessed {
            Some(AccessFault::Buffer { handle, size, view: Some((name, offset)) }) => {
                (*handle, format!(", which is the range of {size} bytes at offset {offset} of `{name}`"))
            }
            Some(&AccessFault::Buffer { handle, size, view: None }) => {
                (handle, format!(", which has {size} bytes"))
            }
            Some(&AccessFault::Descriptor { handle, .. }) => (Some(handle), String::new()),
            _ => (None, String::new()),
        };
        let name = match chunk.buffer {
            BufferRef::Address(_) => {
                let nearest = accessed.filter(|_| trap.code != TrapCode::NullPointer);
                let nearest = nearest.and_then(|accessed| self.describe_address(fault_value, accessed));
                return Some(format!(
                    "{bytes} bytes at address {fault_value:#x}{}",
                    nearest.unwrap_or_default()
                ));
            }
            BufferRef::PushConstants => "the push constants".to_owned(),
            BufferRef::ShaderRecord => "the shader record".to_owned(),
            BufferRef::Workgroup => "the workgroup's memory".to_owned(),
            BufferRef::Computed(_) => self
                .describe_descriptor(handle.unwrap_or(u32::MAX))
                .unwrap_or_else(|| "a buffer selected at run time".to_owned()),
            BufferRef::Handle(handle) => self.describe_descriptor(handle)?,
        };
        Some(format!("{extent}{name}{size}"))
    }

    /// Describes a texel outside its image.
    #[doc(hidden)]
    pub fn describe_texel(&self, accessed: &AccessFault) -> Option<String> {
        let words = |numbers: &mut dyn Iterator<Item = String>, between: &str| {
            numbers.collect::<Vec<_>>().join(between)
        };
        match accessed {
            AccessFault::Texel { handle, coordinate, extent, level, sample } => {
                let name = self.describe_descriptor(*handle)?;
                let at = words(&mut coordinate.iter().map(i64::to_string), ", ");
                let sides = words(&mut extent.iter().map(u32::to_string), " x ");
                let mut text = format!("texel ({at}) of {name}, which has {sides}");
                if level[1] > 1 || level[0] > 0 {
                    text += &format!("; level {} of {}", level[0], level[1]);
                }
                if sample[1] > 1 || sample[0] > 0 {
                    text += &format!("; sample {} of {}", sample[0], sample[1]);
                }
                Some(text)
            }
            AccessFault::Descriptor { handle, part, .. } => {
                let part = part.map_or_else(String::new, |part| format!(", {part}"));
                Some(self.describe_descriptor(*handle)? + &part)
            }
            AccessFault::Buffer { handle: Some(handle), .. } => self.describe_descriptor(*handle),
            AccessFault::ImageKind { handle, declared, bound } => {
                let name = self.describe_descriptor(*handle)?;
                Some(format!("{name} is declared as {declared}, but {bound} is bound"))
            }
            AccessFault::Buffer { handle: None, .. }
            | AccessFault::Address { .. }
            | AccessFault::ImageFile(_)
            | AccessFault::HeapOffset { .. }
            | AccessFault::HitRecord(_)
            | AccessFault::Message(_) => None,
        }
    }

    /// The heap that has a handle.
    pub(super) fn heap_binding(&self, first: u32) -> Option<Binding> {
        Some(self.slots.get(Bindings::slot_of(first)?.0)?.binding)
    }

    /// Describes where a device address is relative to the nearest buffer.
    fn describe_address(&self, fault_value: u64, accessed: &AccessFault) -> Option<String> {
        let AccessFault::Address { start, size, handle, name } = accessed else { return None };
        let (start, size) = (*start, *size);
        let bound = handle.and_then(|handle| self.describe_descriptor(handle));
        let name = match (name, bound) {
            (Some(name), None) => format!(" `{name}`"),
            (Some(name), Some(bound)) => format!(" `{name}`, bound as {bound},"),
            (None, Some(bound)) => format!(" {bound}"),
            (None, None) => String::new(),
        };
        let position =
            match (fault_value.checked_sub(start), fault_value.checked_sub(start.saturating_add(size))) {
                (None, _) => format!("{} bytes before the nearest buffer,", start - fault_value),
                (Some(offset), None) => format!("offset {offset} of the buffer"),
                (Some(_), Some(0)) => "at the end of the buffer".to_owned(),
                (Some(_), Some(distance)) => {
                    format!("{distance} bytes past the end of the nearest buffer,")
                }
            };
        Some(format!(": {position}{name} at {start:#x}, which has {size} bytes"))
    }

    /// The entry point that it was made of.
    #[doc(hidden)]
    pub fn entry_point(&self) -> Option<&EntryPoint> {
        let mut entries = self.module.entry_points.iter();
        entries.find(|entry| entry.stage == self.stage && entry.name == self.name)
    }

    /// Describes a handle: name, set, binding and array element.
    #[doc(hidden)]
    pub fn describe_descriptor(&self, handle: u32) -> Option<String> {
        let Some((slot, element)) = Bindings::slot_of(handle) else {
            return Some("a null descriptor".to_owned());
        };
        let slot = self.slots.get(slot)?;
        Some(format!("`{}` ({}, element {element})", slot.name, slot.binding))
    }

    /// Describes a byte of the buffer that a handle leads to: the source expression of its scalar,
    /// set, binding and array element; `None` in padding, and where the type is not laid out.
    #[doc(hidden)]
    pub fn describe_buffer_byte(&self, handle: u32, byte: u64) -> Option<String> {
        let (slot, element) = Bindings::slot_of(handle)?;
        let slot = self.slots.get(slot)?;
        let module = &self.module;
        let mut ty = module.pointee(slot.variable)?;
        let mut name = slot.name.clone();
        // Each block of an array has a buffer of its own.
        while let Type::Array { element: part, .. } | Type::RuntimeArray { element: part, .. } =
            *module.ty(ty)
        {
            if name == slot.name {
                name += &format!("[{element}]");
            }
            ty = part;
        }
        let path = Layout::new(module, ty, Rules::Explicit).byte_path(byte)?;
        let dot = if path.is_empty() || path.starts_with('[') { "" } else { "." };
        Some(format!("`{name}{dot}{path}` ({}, element {element})", slot.binding))
    }

    /// Describes an invocation of this program by its launch index; in compute shaders, where that
    /// is `GlobalInvocationId`, with its workgroup.
    #[doc(hidden)]
    pub fn describe_invocation(&self, [x, y, z]: [u32; 3]) -> String {
        match &self.workgroup {
            Some(layout) => {
                let [a, b, c] = array::from_fn(|axis| [x, y, z][axis] / layout.size[axis].max(1));
                format!("invocation ({x}, {y}, {z}) of workgroup ({a}, {b}, {c})")
            }
            None => format!("launch id ({x}, {y}, {z})"),
        }
    }

    /// The bindings of the slots, for [`Resources::bindings`](crate::machine::Resources::bindings).
    #[doc(hidden)]
    pub fn bindings(&self) -> impl Iterator<Item = Binding> {
        self.slots.iter().map(|slot| slot.binding)
    }
}
