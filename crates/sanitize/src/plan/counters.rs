//! Floats that count the turns of a loop: sums of a variable and a step that is the same in all
//! turns, which are stored to the variable again, and compared.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::flushed_use::comparison;
use anyhit_engine::module::{BasicBlock, Definition, Id, Instruction, Instructions, Module, Opcode};

/// A sum that counts the turns of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FloatCounter {
    /// Which operand of the sum is the counter.
    pub operand: usize,
    /// The variable or phi that counts.
    pub variable: Id,
}

/// The counters of the loops of a module, by the offset of the sum.
pub(super) fn float_counters(module: &Module) -> FxHashMap<u32, FloatCounter> {
    let mut counters = FxHashMap::default();
    for function in &module.functions {
        for (at, header) in function.blocks.iter().enumerate() {
            let merge = header.instructions.iter().find(|one| one.opcode == Opcode::LoopMerge);
            let Some(&merge) = merge.and_then(|merge| module.operands(merge).first()) else { continue };
            let after = function.blocks[at..].iter().position(|block| block.label == Id(merge));
            let end = after.map_or(function.blocks.len(), |after| at + after);
            Loop::new(module, &function.blocks[at..end]).add_counters(&mut counters);
        }
    }
    counters
}

/// The instructions of a loop.
struct Loop<'a> {
    module: &'a Module,
    instructions: Vec<&'a Instruction>,
    /// The results of its instructions.
    results: FxHashMap<Id, &'a Instruction>,
    /// By variable: what is stored to it.
    stored: FxHashMap<Id, Vec<Id>>,
    /// The variables and values that floats are compared with.
    compared: FxHashSet<Id>,
}

impl<'a> Loop<'a> {
    fn new(module: &'a Module, blocks: &'a [BasicBlock]) -> Self {
        let instructions: Vec<_> = Instructions::of(blocks).collect();
        let results = instructions.iter().filter_map(|&one| Some((one.result?, one))).collect();
        let (stored, compared) = Default::default();
        let mut own = Self { module, instructions, results, stored, compared };
        for instruction in own.instructions.clone() {
            let operands = module.operands(instruction);
            match (instruction.opcode, operands) {
                (Opcode::Store, &[pointer, object, ..]) => {
                    own.stored.entry(Id(pointer)).or_default().push(Id(object));
                }
                (opcode, &[a, b]) if comparison(opcode).is_some() => {
                    own.compared.extend([a, b].map(|id| own.loaded(Id(id)).unwrap_or(Id(id))));
                }
                _ => {}
            }
        }
        own
    }

    /// The pointer that a value of the loop is loaded from.
    fn loaded(&self, id: Id) -> Option<Id> {
        let load = self.results.get(&id).filter(|one| one.opcode == Opcode::Load)?;
        self.module.operands(load).first().map(|&pointer| Id(pointer))
    }

    fn add_counters(&self, counters: &mut FxHashMap<u32, FloatCounter>) {
        for instruction in &self.instructions {
            let (Opcode::FAdd | Opcode::FSub, &[a, b], Some(result)) =
                (instruction.opcode, self.module.operands(instruction), instruction.result)
            else {
                continue;
            };
            for (operand, [value, step]) in [[a, b], [b, a]].into_iter().enumerate() {
                let is_difference = instruction.opcode == Opcode::FSub;
                if is_difference && operand == 1 || !self.is_invariant(Id(step)) {
                    continue;
                }
                let Some(variable) = self.counts(Id(value), result) else { continue };
                if [variable, Id(value), result].iter().any(|id| self.compared.contains(id)) {
                    counters.insert(instruction.offset, FloatCounter { operand, variable });
                }
            }
        }
    }

    /// The variable or phi that has a value in one turn, and a sum in the next.
    fn counts(&self, value: Id, sum: Id) -> Option<Id> {
        if let Some(pointer) = self.loaded(value) {
            return self.stored.get(&pointer)?.contains(&sum).then_some(pointer);
        }
        let phi = self.results.get(&value).filter(|one| one.opcode == Opcode::Phi)?;
        self.module.operands(phi).contains(&sum.0).then_some(value)
    }

    /// Whether a value is the same in all turns.
    fn is_invariant(&self, id: Id) -> bool {
        match self.loaded(id) {
            Some(pointer) => !self.results.contains_key(&pointer) && !self.stored.contains_key(&pointer),
            None => !self.results.contains_key(&id) && self.module.definition(id).is_some_and(is_value),
        }
    }
}

fn is_value(definition: Definition) -> bool {
    matches!(definition, Definition::Constant(_) | Definition::Result(..) | Definition::Parameter(..))
}
