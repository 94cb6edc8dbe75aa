//! Where a program reads its variables: the place of a finding about what one holds at the
//! beginning.

use rustc_hash::FxHashMap;

use anyhit_engine::machine::OpIndex;
use anyhit_engine::module::Id;
use anyhit_engine::ops::interface_check::base_variable;
use anyhit_engine::program::Program;

/// `OpLoad`
const LOAD: u32 = 61;
/// `OpAtomicLoad` to `OpAtomicXor`, but for `OpAtomicStore`, which has no result.
const ATOMICS: std::ops::RangeInclusive<u32> = 227..=242;
const ATOMIC_STORE: u32 = 228;

/// The first operations of a program that read its variables of module scope.
#[derive(Debug)]
pub(super) struct FirstReads(FxHashMap<Id, OpIndex>);

impl FirstReads {
    /// Those of a program that is not optimised.
    pub(super) fn of(program: &Program) -> Self {
        let module = &program.module;
        let mut reads = FxHashMap::default();
        for (at, origin) in program.origins.iter().take(program.ops.len()).enumerate() {
            let Some(&[head, _, _, pointer, ..]) = module.words.get(origin.offset as usize..) else {
                continue;
            };
            let opcode = head & 0xFFFF;
            let is_read = opcode == LOAD || ATOMICS.contains(&opcode) && opcode != ATOMIC_STORE;
            if is_read && let Some(variable) = base_variable(module, Id(pointer)) {
                reads.entry(variable).or_insert(OpIndex::new(at));
            }
        }
        Self(reads)
    }

    /// The first operation that reads a variable, if one does.
    pub(super) fn find(&self, variable: Id) -> Option<OpIndex> {
        self.0.get(&variable).copied()
    }
}
