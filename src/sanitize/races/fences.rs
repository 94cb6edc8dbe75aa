//! Fences around atomic instructions: a release synchronizes through an atomic instruction that it
//! is program-ordered before, an acquire through one that it is program-ordered after (Vulkan,
//! Memory Model, "Synchronizes-With").

use rspirv::spirv::{Op as Opcode, Scope};
use rustc_hash::FxHashMap;

use crate::math::array;
use crate::module::Module;
use crate::sanitize::plan::InstructionWords;
use crate::sanitize::races::class::Reach;
use crate::sanitize::races::ordering::{Ordering, is_wide, semantics_and_scope};

/// When something has last happened: by class of memory, in any scope and in one that is wider than
/// a workgroup; 0 where it has not.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Times {
    near: [u32; 3],
    wide: [u32; 3],
}

impl Times {
    /// Notes a time for what an instruction reaches.
    pub(super) fn set(&mut self, reach: Reach, time: u32) {
        for (is_wide, times) in [(false, &mut self.near), (true, &mut self.wide)] {
            reach.across(is_wide).each().for_each(|class| times[class] = times[class].max(time));
        }
    }

    /// The times within a scope.
    pub(super) fn within(self, scope: Option<Scope>) -> Self {
        if is_wide(scope) { self } else { Self { wide: [0; 3], ..self } }
    }

    /// The later ones of these and others.
    pub(super) fn later(self, other: Self) -> Self {
        let later = |one: [u32; 3], other: [u32; 3]| array::from_fn(|at| one[at].max(other[at]));
        Self { near: later(self.near, other.near), wide: later(self.wide, other.wide) }
    }

    /// The time for a class.
    #[inline]
    pub(super) fn of(&self, class: usize, is_wide: bool) -> u32 {
        if is_wide { self.wide[class] } else { self.near[class] }
    }
}

/// The fences and atomic instructions of an invocation.
#[derive(Clone, Copy, Debug, Default)]
struct Passed {
    /// The last fences that release.
    released: Times,
    /// The last atomic instruction: of any scope, and of one wider than a workgroup.
    atomic: [u32; 2],
}

/// The fences and atomic instructions of all invocations so far that have executed any.
#[derive(Debug, Default)]
pub(super) struct Fences {
    by_invocation: FxHashMap<u32, Passed>,
}

impl Fences {
    /// An invocation executes a fence. Returns since when what it acquires is there: since the last
    /// atomic instruction before it.
    pub(super) fn fence(&mut self, invocation: u32, fence: Ordering, time: u32) -> Times {
        let passed = self.by_invocation.entry(invocation).or_default();
        passed.released.set(fence.releases, time);
        let mut acquired = Times::default();
        let [near, wide] = passed.atomic;
        acquired.set(fence.acquires.near_alone(), near);
        acquired.set(fence.acquires, wide);
        acquired
    }

    /// An invocation executes an atomic instruction. Returns when the last fences before it have
    /// released.
    pub(super) fn atomic(&mut self, invocation: u32, scope: Option<Scope>, time: u32) -> Times {
        let passed = self.by_invocation.entry(invocation).or_default();
        passed.atomic[0] = time;
        if is_wide(scope) {
            passed.atomic[1] = time;
        }
        passed.released.within(scope)
    }
}

/// What an instruction orders that is a memory barrier or a control barrier; nothing of another.
pub(super) fn fence_of(module: &Module, instruction: InstructionWords<'_>) -> Ordering {
    let InstructionWords { opcode, words } = instruction;
    let scope_at = match opcode {
        Some(Opcode::MemoryBarrier) => 1,
        Some(Opcode::ControlBarrier) => 2,
        _ => return Ordering::default(),
    };
    let (semantics, scope) = semantics_and_scope(module, words, scope_at);
    Ordering::of(semantics, scope)
}
