//! Loops that wait for another invocation.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::module_checks::Fault;
use crate::module_checks::code::{EntryCode, MemoryAccess, Part};
use anyhit_engine::module::{BasicBlock, Definition, Id, Instruction, Opcode};
use anyhit_engine::ops::atomic;
use anyhit_engine::ops::pointer::storage;

/// `Image`
const IMAGE: u32 = 11;

/// Loops that end when a value in memory changes, which they themselves do not change.
pub(super) fn launch_order(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    let functions = code.module.call_tree(code.entry.function);
    for function in functions.into_iter().map(|function| &code.module.functions[function as usize]) {
        let blocks: Blocks = function.blocks.iter().map(|block| (block.label, block)).collect();
        for header in &function.blocks {
            let merge = header.instructions.iter().find(|one| one.opcode == Opcode::LoopMerge);
            let Some(&merge) = merge.and_then(|merge| code.module.operands(merge).first()) else { continue };
            let one = Loop::new(code, &blocks, header, Id(merge));
            if let Some(waits) = one.waits_for() {
                let name = code.describe(waits.variable);
                let message = format!("the loop ends only when another invocation writes {name}");
                faults.push(Fault { offset: waits.offset, message });
            }
        }
    }
}

/// The blocks of a function by their labels.
type Blocks<'a> = FxHashMap<Id, &'a BasicBlock>;

/// What a loop waits for.
struct Waits {
    /// The instruction that reads it.
    offset: u32,
    variable: Part,
}

/// A loop of a function.
struct Loop<'a> {
    code: &'a EntryCode<'a>,
    /// Where its blocks go on.
    merge: Id,
    /// The instructions of its blocks by their results, and by the variables that they store to.
    results: FxHashMap<Id, &'a Instruction>,
    stores: FxHashMap<Id, Vec<Id>>,
    /// The conditions of its exits.
    exits: Vec<Id>,
}

impl<'a> Loop<'a> {
    fn new(code: &'a EntryCode<'a>, blocks: &Blocks<'a>, header: &'a BasicBlock, merge: Id) -> Self {
        let mut one = Self {
            code,
            merge,
            results: FxHashMap::default(),
            stores: FxHashMap::default(),
            exits: Vec::new(),
        };
        let block = |label: Id| blocks.get(&label).copied();
        let (mut open, mut seen) = (vec![header], FxHashSet::from_iter([header.label, merge]));
        while let Some(next) = open.pop() {
            for instruction in &next.instructions {
                one.results.extend(instruction.result.map(|id| (id, instruction)));
                let operands = code.module.operands(instruction);
                match (instruction.opcode, operands) {
                    (Opcode::Store, &[pointer, value, ..]) => {
                        one.stores.entry(Id(pointer)).or_default().push(Id(value));
                    }
                    (Opcode::BranchConditional, &[condition, yes, no, ..]) => {
                        let leaves = |label: u32| one.leaves(block(Id(label)), Id(label));
                        if leaves(yes) || leaves(no) {
                            one.exits.push(Id(condition));
                        }
                    }
                    _ => {}
                }
            }
            let targets = next.instructions.last().into_iter().flat_map(|last| code.module.operands(last));
            let targets = targets.filter_map(|&label| block(Id(label)));
            open.extend(targets.filter(|block| seen.insert(block.label)));
        }
        one
    }

    /// Whether a branch to a block leaves the loop at once.
    fn leaves(&self, block: Option<&BasicBlock>, label: Id) -> bool {
        label == self.merge
            || block.is_some_and(|block| match block.instructions.as_slice() {
                [branch] if branch.opcode == Opcode::Branch => {
                    self.code.module.operands(branch).first() == Some(&self.merge.0)
                }
                _ => false,
            })
    }

    /// What a loop waits for, if its only exit depends on memory alone.
    fn waits_for(&self) -> Option<Waits> {
        let &[condition] = self.exits.as_slice() else { return None };
        let mut waits = None;
        let mut seen = FxHashSet::default();
        self.only_memory(condition, &mut seen, &mut waits).then_some(waits).flatten()
    }

    /// Whether a value changes from turn to turn only as memory does that all invocations share.
    fn only_memory(&self, id: Id, seen: &mut FxHashSet<Id>, waits: &mut Option<Waits>) -> bool {
        // What is made before the loop stays.
        let Some(instruction) = self.results.get(&id) else { return true };
        if !seen.insert(id) {
            return false;
        }
        let operands = self.code.module.operands(instruction);
        let opcode = instruction.opcode;
        let is_atomic = atomic::OPCODES.contains(&opcode);
        match opcode {
            Opcode::Load if self.is_local(Id(operands[0])) => match self.stores.get(&Id(operands[0])) {
                None => true,
                Some(values) => match values.as_slice() {
                    &[value] => self.only_memory(value, seen, waits),
                    _ => false,
                },
            },
            Opcode::Load | Opcode::ImageRead => {
                let operands = if opcode == Opcode::Load { &operands[..1] } else { &operands[..2] };
                self.waits_at(instruction, operands[0], waits) && self.all_only_memory(operands, seen, waits)
            }
            // An addition counts turns.
            _ if is_atomic && does_not_count(opcode) => {
                self.waits_at(instruction, operands[0], waits) && self.all_only_memory(operands, seen, waits)
            }
            _ if is_atomic => false,
            Opcode::Phi | Opcode::FunctionCall => false,
            _ => self.all_only_memory(operands, seen, waits),
        }
    }

    fn all_only_memory(&self, ids: &[u32], seen: &mut FxHashSet<Id>, waits: &mut Option<Waits>) -> bool {
        ids.iter().all(|&id| self.only_memory(Id(id), seen, waits))
    }

    /// Notes an access to memory; `false` where it is not that of other invocations.
    fn waits_at(&self, instruction: &Instruction, pointer: u32, waits: &mut Option<Waits>) -> bool {
        let class = self.code.storage_class(Id(pointer));
        let is_shared = match class {
            Some(class) => [
                storage::STORAGE_BUFFER,
                storage::PHYSICAL_STORAGE_BUFFER,
                storage::WORKGROUP,
                storage::UNIFORM,
                IMAGE,
            ]
            .contains(&class),
            // An image, which has no storage class.
            None => true,
        };
        let parts = self.code.parts(Id(pointer));
        let is_written =
            |access: MemoryAccess| access.writes && self.code.parts(access.pointer).last() == parts.last();
        if let (Some(&variable), true) = (parts.first(), self.code.accesses().any(is_written)) {
            waits.get_or_insert(Waits { offset: instruction.offset, variable });
        }
        is_shared
    }

    /// Whether a pointer is a variable of the function.
    fn is_local(&self, pointer: Id) -> bool {
        self.code.storage_class(pointer) == Some(storage::FUNCTION)
            && matches!(self.code.module.definition(pointer), Some(Definition::Result(..)))
    }
}

/// Whether an atomic instruction gives the same result again until another invocation writes.
fn does_not_count(opcode: Opcode) -> bool {
    use Opcode as O;
    !matches!(
        opcode,
        O::AtomicIIncrement | O::AtomicIDecrement | O::AtomicIAdd | O::AtomicISub | O::AtomicFAddEXT
    )
}
