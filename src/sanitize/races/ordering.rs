//! What memory semantics order, and in which scope.

use rspirv::spirv::{MemorySemantics, Scope};

use crate::module::{Id, Module};
use crate::sanitize::races::class::{Classes, Reach};

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

    /// What is left of it within a scope.
    pub(super) fn within(self, scope: Option<Scope>) -> Self {
        if is_wide(scope) {
            return self;
        }
        Self { releases: self.releases.near_alone(), acquires: self.acquires.near_alone() }
    }

    pub(super) fn with(self, other: Self) -> Self {
        let Self { releases, acquires } = self;
        Self { releases: releases.with(other.releases), acquires: acquires.with(other.acquires) }
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
