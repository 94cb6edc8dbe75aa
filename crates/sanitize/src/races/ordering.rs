//! What memory semantics order, and in which scope.

use rspirv::spirv::{MemorySemantics, Scope};

use crate::plan::InstructionWords;
use crate::races::class::{Classes, Reach};
use crate::races::level::{Level, Topology};
use anyhit_engine::module::{Id, Module, Opcode};
use anyhit_engine::ops::atomic;

/// What an instruction's memory semantics order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Ordering {
    pub releases: Reach,
    pub acquires: Reach,
}

impl Ordering {
    /// That of semantics, where they are known, and of a scope.
    pub(super) fn of(semantics: Option<u64>, scope: Option<Scope>) -> Self {
        let reach = Reach::of(Classes::of(semantics), is_wide(scope));
        let both = MemorySemantics::ACQUIRE_RELEASE | MemorySemantics::SEQUENTIALLY_CONSISTENT;
        let bits = known_bits(semantics);
        let part = |one| if bits.intersects(both | one) { reach } else { Reach::default() };
        Self { releases: part(MemorySemantics::RELEASE), acquires: part(MemorySemantics::ACQUIRE) }
    }

    pub(super) fn with(self, other: Self) -> Self {
        let Self { releases, acquires } = self;
        Self { releases: releases.with(other.releases), acquires: acquires.with(other.acquires) }
    }
}

/// Memory semantics, with how far their scope reaches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Semantics {
    /// The classes of memory that they are about.
    pub classes: Classes,
    pub level: Level,
    pub releases: bool,
    pub acquires: bool,
    /// Whether what was written is made available before the release.
    pub available: bool,
    /// Whether what is available is made visible behind the acquire.
    pub visible: bool,
}

impl Semantics {
    /// Those of bits, where they are known, and of a level.
    pub(super) fn of(bits: Option<u64>, level: Level) -> Self {
        let classes = Classes::of(bits);
        let bits = known_bits(bits);
        let both = MemorySemantics::ACQUIRE_RELEASE | MemorySemantics::SEQUENTIALLY_CONSISTENT;
        Self {
            classes,
            level,
            releases: bits.intersects(both | MemorySemantics::RELEASE),
            acquires: bits.intersects(both | MemorySemantics::ACQUIRE),
            available: bits.contains(MemorySemantics::MAKE_AVAILABLE),
            visible: bits.contains(MemorySemantics::MAKE_VISIBLE),
        }
    }

    /// Those of an instruction, which has a scope and behind it semantics; of
    /// `OpAtomicCompareExchange` those of values that are equal or not.
    pub(super) fn of_instruction(
        module: &Module,
        instruction: InstructionWords<'_>,
        topology: Topology,
        is_equal: bool,
    ) -> Option<Self> {
        let InstructionWords { opcode, words } = instruction;
        let scope_at = match opcode {
            Opcode::MemoryBarrier => 1,
            Opcode::AtomicStore => 2,
            opcode if opcode.is_control_barrier() => 2,
            opcode if atomic::OPCODES.contains(&opcode) => 4,
            _ => return None,
        };
        let (bits, scope) = semantics_and_scope(module, words, scope_at);
        let bits = match opcode {
            Opcode::AtomicCompareExchange if !is_equal => {
                words.get(scope_at + 2).and_then(|&id| module.scalar_value(Id(id)))
            }
            _ => bits,
        };
        Some(Self::of(bits, topology.level(scope)))
    }

    /// Whether, in a control barrier of a workgroup, all that is before it happens before all that
    /// is behind it, in the classes.
    pub(super) fn joins_all(&self) -> bool {
        self.releases && self.acquires && self.level >= Level::Workgroup
    }

    /// Whether they order nothing.
    pub(super) fn is_relaxed(&self) -> bool {
        !(self.releases || self.acquires)
    }
}

/// Unknown semantics may be any.
pub(super) fn known_bits(semantics: Option<u64>) -> MemorySemantics {
    MemorySemantics::from_bits_retain(semantics.map_or(u32::MAX, |bits| bits as u32))
}

/// Whether a scope holds more than a workgroup.
pub(super) fn is_wide(scope: Option<Scope>) -> bool {
    !matches!(scope, Some(Scope::Workgroup | Scope::Subgroup | Scope::Invocation))
}

/// The memory semantics of an instruction, and its scope, which is the word before them; `None`
/// where they are not known.
pub(super) fn semantics_and_scope(
    module: &Module,
    words: &[u32],
    scope_at: usize,
) -> (Option<u64>, Option<Scope>) {
    let semantics = words.get(scope_at + 1).and_then(|&id| module.scalar_value(Id(id)));
    (semantics, scope(module, words.get(scope_at)))
}

/// The scope of an id.
pub(super) fn scope(module: &Module, id: Option<&u32>) -> Option<Scope> {
    let scope = module.scalar_value(Id(*id?))?;
    Scope::from_u32(u32::try_from(scope).ok()?)
}
