//! Where a program reads its variables: the place of a finding about what one holds at the
//! beginning.

use rustc_hash::FxHashMap;

use anyhit_engine::machine::OpIndex;
use anyhit_engine::module::{Id, Opcode};
use anyhit_engine::ops::interface_check::base_variable;
use anyhit_engine::program::Program;

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
            // Atomic instructions but the store, which has no result.
            let is_read = match Opcode::of_word(head) {
                Opcode::Load => true,
                opcode => {
                    (Opcode::AtomicLoad..=Opcode::AtomicXor).contains(&opcode)
                        && opcode != Opcode::AtomicStore
                }
            };
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
