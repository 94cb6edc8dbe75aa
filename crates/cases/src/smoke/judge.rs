//! Judges several runs of one shader: decides which traps may be due to made-up values.

use crate::smoke::sets::Set;
use anyhit_base::sorted::SortedSet;
use anyhit_engine::machine::TrapCode;
use anyhit_engine::pipeline::Trapped;

/// One run of a shader on a set of values.
pub(super) struct Try {
    /// The values.
    pub set: Set,
    /// Where it trapped.
    pub trapped: Option<Box<Trapped>>,
    /// The instructions that some lane went on from, by their word offset.
    pub passed: SortedSet<u32>,
    /// What it needed, and how it trapped without.
    pub mended: Option<(String, Box<Trapped>)>,
}

impl Try {
    /// The trap that several runs come to: the first that no values get past, or the first one
    /// where no run came to its end. `None` where all is well.
    pub(super) fn verdict(tries: &[Try]) -> Option<&Trapped> {
        let mut traps = sites(tries).into_iter();
        let complete = tries.iter().any(|one| one.trapped.is_none());
        if complete { traps.find(|trap| !is_excused(trap, tries)) } else { traps.next() }
    }

    /// Traps of runs that are not held against the shader, one for each instruction.
    pub(super) fn excused(tries: &[Try]) -> Vec<&Trapped> {
        sites(tries).into_iter().filter(|trap| is_excused(trap, tries)).collect()
    }

    /// Whether it got past an instruction.
    pub(super) fn passes(&self, offset: u32) -> bool {
        let here = self.trapped.as_ref().is_some_and(|trapped| trapped.offset == offset);
        !here && self.passed.contains(&offset)
    }

    /// Whether it trapped there.
    pub(super) fn traps_at(&self, trap: &Trapped) -> bool {
        self.trapped.as_ref().is_some_and(|trapped| same(trapped, trap))
    }
}

/// Whether a trap says that the operands of a ray break a rule. Numbers that are all the same make
/// no ray, so that getting past on them says nothing.
pub(super) fn is_of_rays(trap: &Trapped) -> bool {
    matches!(trap.code, TrapCode::InvalidTrace | TrapCode::InvalidRayQuery | TrapCode::InvalidHitObject)
}

/// Whether two traps are one.
pub(super) fn same(one: &Trapped, other: &Trapped) -> bool {
    (one.offset, one.code) == (other.offset, other.code)
}

/// The traps, each once, in the order in which they came.
fn sites(tries: &[Try]) -> Vec<&Trapped> {
    let mut sites: Vec<&Trapped> = Vec::new();
    for trap in tries.iter().filter_map(|one| one.trapped.as_deref()) {
        if !sites.iter().any(|known| same(known, trap)) {
            sites.push(trap);
        }
    }
    sites
}

/// Whether other values get past a trap, or only exceptional ones lead to it.
fn is_excused(trap: &Trapped, tries: &[Try]) -> bool {
    let mut past = tries.iter().filter(|one| one.passes(trap.offset));
    match trap.code {
        _ if is_of_rays(trap) => past.any(|one| one.set.has_different_floats()),
        // These end a way through the shader: nothing gets past.
        code if code == TrapCode::Unreachable || code.is_limit() => {
            tries.iter().any(|one| one.trapped.is_none())
        }
        _ => {
            let mut here = tries.iter().filter(|one| one.traps_at(trap));
            past.next().is_some() || here.all(|one| !one.set.is_plain())
        }
    }
}
