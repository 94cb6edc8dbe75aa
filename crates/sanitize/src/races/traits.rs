//! What an instruction says of its access to memory, beside what it accesses: whether it takes part
//! in communication (Vulkan, Memory Model, "Private vs. Non-Private"), with whom an atomic one is
//! atomic, and whether other declarations may reach the same memory.

use rspirv::spirv::{ImageOperands, MemoryAccess, MemorySemantics, Scope};
use rustc_hash::FxHashMap;

use crate::module_checks::code::{EntryCode, Part};
use crate::plan::InstructionWords;
use crate::races::class::{Classes, Reach};
use crate::races::ordering::{Ordering, is_wide, known_bits, scope, semantics_and_scope};
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::interface::EntryPoint;
use anyhit_engine::module::{Module, Opcode};
use anyhit_engine::ops::atomic;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;

/// What a declaration says of others that reach the same memory (SPIR-V 2.18.2, "Aliasing").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Aliasing {
    /// Nothing: a compiler may assume that there are none.
    #[default]
    Unsaid,
    /// `Restrict`: there are none.
    Restrict,
    /// `Aliased`: there may be some.
    Aliased,
}

/// What an instruction says of its access.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AccessTraits {
    /// Whether it is not meant for communication with other invocations.
    pub is_private: bool,
    /// Whether it makes what it writes available, and visible what it reads.
    pub propagates: bool,
    /// What its declaration says of others.
    pub aliasing: Aliasing,
    /// The scope of an atomic instruction, or that in which the access propagates, if it is known.
    pub scope: Option<Scope>,
}

/// The traits of the operations of a program.
#[derive(Debug)]
pub(super) struct ProgramTraits {
    by_op: Vec<AccessTraits>,
    /// What its barriers and atomic instructions order.
    pub barriers: Barriers,
    /// Whether its module declares the Vulkan memory model.
    pub has_model: bool,
}

impl ProgramTraits {
    /// Those of a program, for the operations that are asked about.
    pub(super) fn of(program: &Program, is_asked: &[bool]) -> Self {
        let module = &program.module;
        let entry = program.entry_point();
        let (barriers, has_model) = (Barriers::of(module), module.has_vulkan_memory_model());
        let Some(entry) = entry.filter(|_| is_asked.contains(&true)) else {
            return Self { by_op: vec![AccessTraits::default(); is_asked.len()], barriers, has_model };
        };
        let by_offset = traits_by_offset(module, entry);
        let of = |(at, &is_asked): (usize, &bool)| {
            let origin = program.origins.get(at).filter(|_| is_asked);
            origin.and_then(|origin| by_offset.get(&origin.offset)).copied().unwrap_or_default()
        };
        Self { by_op: is_asked.iter().enumerate().map(of).collect(), barriers, has_model }
    }

    /// Those of some operations that are all coherent.
    #[cfg(test)]
    pub(super) fn coherent(operations: usize) -> Self {
        let traits = AccessTraits { propagates: true, ..AccessTraits::default() };
        Self { by_op: vec![traits; operations], barriers: Barriers::default(), has_model: false }
    }

    /// Those of an operation.
    #[inline]
    pub(super) fn at(&self, op: usize) -> &AccessTraits {
        &self.by_op[op]
    }
}

/// By the offset of an instruction that accesses memory.
fn traits_by_offset(module: &Module, entry: &EntryPoint) -> FxHashMap<u32, AccessTraits> {
    let code = EntryCode::new(module, entry);
    let has_model = module.has_vulkan_memory_model();
    let mut all: FxHashMap<u32, AccessTraits> = FxHashMap::default();
    for access in code.accesses() {
        let parts = code.parts(access.pointer);
        let class = code.storage_class(access.pointer);
        let is_decorated = |number: u32| {
            parts.iter().any(|&part| match part {
                Part::Variable(id) | Part::Parameter(id) => module.decorations.find(id, number).is_some(),
                Part::Member(id, member) => module.decorations.find_member(id, member, number).is_some(),
            })
        };
        let words = InstructionWords::at(module, access.offset);
        let is_atomic = atomic::OPCODES.contains(&access.opcode);
        let (is_private, propagates) = match () {
            () if is_atomic => (false, true),
            () if has_model => {
                let Explicit { is_private, propagates, .. } = explicit(words, access.opcode);
                (is_private, propagates)
            }
            // GLSL: shared variables are coherent.
            () if class == Some(storage::WORKGROUP) => (false, true),
            () => {
                let is_coherent = is_decorated(number::COHERENT) || is_decorated(number::VOLATILE);
                (!is_coherent, is_coherent)
            }
        };
        let aliasing = match () {
            () if is_decorated(number::RESTRICT) => Aliasing::Restrict,
            () if is_decorated(number::ALIASED) || class == Some(storage::PHYSICAL_STORAGE_BUFFER) => {
                Aliasing::Aliased
            }
            () => Aliasing::Unsaid,
        };
        let scope = match (is_atomic, access.opcode) {
            (false, _) if !has_model => None,
            (false, opcode) => scope(module, explicit(words, opcode).scope),
            (true, Opcode::AtomicStore) => scope(module, words.words.get(2)),
            (true, _) => scope(module, words.words.get(4)),
        };
        let traits = AccessTraits { is_private, propagates, aliasing, scope };
        // A copy has two accesses: both are as private as the more private one.
        let known = all.entry(access.offset).or_insert(traits);
        known.is_private |= is_private;
        known.propagates &= propagates;
    }
    all
}

/// What an access says with the Vulkan memory model.
struct Explicit<'w> {
    is_private: bool,
    propagates: bool,
    /// The id of the scope in which it propagates.
    scope: Option<&'w u32>,
}

/// What the memory or image operands of an access say.
fn explicit(words: InstructionWords<'_>, opcode: Opcode) -> Explicit<'_> {
    let at = match opcode {
        Opcode::ImageRead | Opcode::ImageSparseRead => 5,
        Opcode::ImageWrite | Opcode::Load | Opcode::CopyMemorySized => 4,
        _ => 3,
    };
    let mask = words.words.get(at).copied().unwrap_or_default();
    let (non_private, propagating) = match opcode {
        Opcode::ImageRead | Opcode::ImageSparseRead | Opcode::ImageWrite => (
            ImageOperands::NON_PRIVATE_TEXEL.bits(),
            (ImageOperands::MAKE_TEXEL_AVAILABLE | ImageOperands::MAKE_TEXEL_VISIBLE).bits(),
        ),
        _ => (
            MemoryAccess::NON_PRIVATE_POINTER.bits(),
            (MemoryAccess::MAKE_POINTER_AVAILABLE | MemoryAccess::MAKE_POINTER_VISIBLE).bits(),
        ),
    };
    // Each bit below has an operand: of memory the alignment, of texels a level or a sample. That
    // of Volatile has none.
    let below = mask & ((1 << propagating.trailing_zeros()) - 1);
    let operands = match opcode {
        Opcode::ImageRead | Opcode::ImageSparseRead | Opcode::ImageWrite => below,
        _ => below & MemoryAccess::ALIGNED.bits(),
    };
    let scope = words.words.get(at + 1 + operands.count_ones() as usize);
    let propagates = mask & propagating != 0;
    Explicit { is_private: mask & non_private == 0, propagates, scope: scope.filter(|_| propagates) }
}

/// What the barriers and the atomic instructions of a module order, wherever they stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Barriers {
    /// What the memory barriers order.
    pub fences: Ordering,
    /// What barriers and atomic instructions order.
    pub all: Ordering,
    /// Whether a control barrier may be of scope Subgroup.
    pub subgroup: bool,
    /// Whether there are atomic instructions.
    pub atomics: bool,
    /// What is made available to others.
    pub available: Reach,
    /// What is made visible from others.
    pub visible: Reach,
}

impl Barriers {
    fn of(module: &Module) -> Self {
        let mut all = Self::default();
        for instruction in module.instructions() {
            let operands = module.operands(instruction);
            match instruction.opcode {
                Opcode::MemoryBarrier => {
                    let ordering = all.add(module, operands, 0);
                    all.fences = all.fences.with(ordering);
                }
                opcode if opcode.is_control_barrier() => {
                    all.add(module, operands, 1);
                    let scope = scope(module, operands.first());
                    all.subgroup |= scope.is_none_or(|scope| scope == Scope::Subgroup);
                }
                opcode if atomic::OPCODES.contains(&opcode) => {
                    all.atomics = true;
                    all.add(module, operands, 1);
                }
                _ => {}
            }
        }
        // Without any semantics a control barrier orders nothing.
        all.subgroup &= all.all != Ordering::default();
        all
    }

    /// Adds a barrier or an atomic instruction, whose scope is an operand and whose semantics are
    /// the next.
    fn add(&mut self, module: &Module, operands: &[u32], scope_at: usize) -> Ordering {
        let (semantics, scope) = semantics_and_scope(module, operands, scope_at);
        let (ordering, bits) = (Ordering::of(semantics, scope), known_bits(semantics));
        self.all = self.all.with(ordering);
        let reach = Reach::of(Classes::of(semantics), is_wide(scope));
        if bits.contains(MemorySemantics::MAKE_AVAILABLE) {
            self.available = self.available.with(reach);
        }
        if bits.contains(MemorySemantics::MAKE_VISIBLE) {
            self.visible = self.visible.with(reach);
        }
        ordering
    }

    /// What two modules order together.
    pub(super) fn with(self, other: Self) -> Self {
        Self {
            fences: self.fences.with(other.fences),
            all: self.all.with(other.all),
            subgroup: self.subgroup || other.subgroup,
            atomics: self.atomics || other.atomics,
            available: self.available.with(other.available),
            visible: self.visible.with(other.visible),
        }
    }
}
