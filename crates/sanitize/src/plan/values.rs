//! Where values come from: through copies and local variables to the instruction that made them.

use rustc_hash::{FxHashMap, FxHashSet};

use anyhit_engine::module::{Id, Instruction, Module, Opcode};

/// The values of a module, by what its instructions make of them.
#[derive(Debug)]
pub(super) struct Values<'m> {
    module: &'m Module,
    /// By local variable: the only value that is stored there; `None` where there are several.
    stored: FxHashMap<Id, Option<Id>>,
    /// Results of atomic additions that are the index of an element that is stored.
    allocated: FxHashSet<Id>,
}

impl<'m> Values<'m> {
    /// Those of a module.
    pub(super) fn of(module: &'m Module) -> Self {
        let mut values = Self { module, stored: FxHashMap::default(), allocated: FxHashSet::default() };
        let instructions = module.instructions();
        let mut pointers = FxHashSet::default();
        for instruction in instructions.clone() {
            let operands = module.operands(instruction);
            match (instruction.opcode, operands) {
                (Opcode::Store, &[pointer, value, ..]) => {
                    pointers.insert(Id(pointer));
                    let known = values.stored.entry(Id(pointer)).or_insert(Some(Id(value)));
                    *known = known.filter(|&known| known == Id(value));
                }
                (Opcode::Variable, &[_, value]) => {
                    values.stored.extend(instruction.result.map(|id| (id, Some(Id(value)))));
                }
                _ => {}
            }
        }
        for instruction in instructions {
            let chain = module.access_chain(instruction).filter(|chain| chain.element.is_none());
            if let Some(chain) = chain
                && instruction.result.is_some_and(|id| pointers.contains(&id))
            {
                let counters = chain.indices.iter().filter_map(|&index| values.atomic_addition(Id(index)));
                let counters: Vec<Id> = counters.collect();
                values.allocated.extend(counters);
            }
        }
        values
    }

    /// The instruction that made a value, behind copies, changes of its sign and local variables
    /// that are stored once.
    pub(super) fn origin(&self, id: Id) -> Option<&'m Instruction> {
        let mut id = id;
        // A value does not come from itself; a module that says so is cut off.
        for _ in 0..16 {
            let instruction = self.module.result_instruction(id)?;
            let operand = self.module.operands(instruction).first().map(|&operand| Id(operand));
            id = match instruction.opcode {
                Opcode::CopyObject | Opcode::FreezeKHR | Opcode::Bitcast => operand?,
                Opcode::Load => match self.stored.get(&operand?) {
                    Some(&Some(value)) => value,
                    _ => return Some(instruction),
                },
                _ => return Some(instruction),
            };
        }
        None
    }

    /// Whether a value is the length of an array.
    pub(super) fn is_array_length(&self, id: Id) -> bool {
        let lengths = [Opcode::ArrayLength, Opcode::UntypedArrayLengthKHR];
        self.origin(id).is_some_and(|origin| lengths.contains(&origin.opcode))
    }

    /// Whether a value is what an atomic addition returned, by which an element is chosen that is
    /// written.
    pub(super) fn is_allocated(&self, id: Id) -> bool {
        self.atomic_addition(id).is_some_and(|id| self.allocated.contains(&id))
    }

    /// The result of the atomic addition that a value is.
    fn atomic_addition(&self, id: Id) -> Option<Id> {
        let origin = self.origin(id)?;
        let opcode = origin.opcode;
        matches!(opcode, Opcode::AtomicIAdd | Opcode::AtomicIIncrement).then_some(origin.result?)
    }
}
