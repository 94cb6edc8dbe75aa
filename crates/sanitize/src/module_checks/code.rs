//! What an entry point executes: its instructions, its accesses to memory, and what they reach.

use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;

use anyhit_engine::module::access_chain::AccessChain;
use anyhit_engine::module::interface::{EntryPoint, InterfaceVariable};
use anyhit_engine::module::ty::Type;
use anyhit_engine::module::{Definition, Function, Id, Instruction, Module, Opcode};
use anyhit_engine::ops::atomic;

/// The instructions of an entry point's call tree, and the variables that they use.
pub(crate) struct EntryCode<'a> {
    pub module: &'a Module,
    pub entry: &'a EntryPoint,
    pub instructions: Vec<&'a Instruction>,
    pub variables: Vec<InterfaceVariable>,
    /// By the id of a parameter of a function: what calls pass for it.
    arguments: FxHashMap<Id, SmallVec<[Id; 2]>>,
}

/// An access of an instruction to memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MemoryAccess {
    /// Where the instruction begins, in words from the start of the module.
    pub offset: u32,
    pub opcode: Opcode,
    /// The pointer, or the image.
    pub pointer: Id,
    pub reads: bool,
    pub writes: bool,
}

/// What a pointer is made from, outermost last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// A variable of the module or of a function.
    Variable(Id),
    /// A parameter of a function.
    Parameter(Id),
    /// A member of a struct, by the struct's id and the member's index.
    Member(Id, u32),
}

impl<'a> EntryCode<'a> {
    pub(crate) fn new(module: &'a Module, entry: &'a EntryPoint) -> Self {
        let functions = module.call_tree(entry.function);
        let functions = functions.into_iter().map(|function| &module.functions[function as usize]);
        let instructions: Vec<_> = functions.flat_map(Function::instructions).collect();
        let mut arguments: FxHashMap<Id, SmallVec<[Id; 2]>> = FxHashMap::default();
        for &instruction in instructions.iter().filter(|one| one.opcode == Opcode::FunctionCall) {
            let Some((&callee, passed)) = module.operands(instruction).split_first() else { continue };
            let Some(callee) = module.function(Id(callee)) else { continue };
            for (&(parameter, _), &argument) in callee.parameters.iter().zip(passed) {
                arguments.entry(parameter).or_default().push(Id(argument));
            }
        }
        Self { module, entry, instructions, variables: module.interface_of(entry), arguments }
    }

    /// Opcode, instruction and operand words of each instruction.
    pub(crate) fn with_operands(&self) -> impl Iterator<Item = (Opcode, &'a Instruction, &'a [u32])> {
        let module = self.module;
        let all = self.instructions.iter();
        all.map(move |&instruction| (instruction.opcode, instruction, module.operands(instruction)))
    }

    /// All accesses to memory and to the texels of storage images.
    pub(crate) fn accesses(&self) -> impl Iterator<Item = MemoryAccess> {
        self.with_operands().flat_map(|(opcode, instruction, operands)| {
            let mut all = SmallVec::<[MemoryAccess; 2]>::new();
            let mut add = |at: usize, reads: bool, writes: bool| {
                let Some(&pointer) = operands.get(at) else { return };
                let offset = instruction.offset;
                all.push(MemoryAccess { offset, opcode, pointer: Id(pointer), reads, writes });
            };
            match opcode {
                Opcode::Load if self.loads_a_handle(instruction) => {}
                Opcode::Load | Opcode::AtomicLoad | Opcode::ImageRead | Opcode::ImageSparseRead => {
                    add(0, true, false)
                }
                Opcode::Store | Opcode::AtomicStore | Opcode::ImageWrite => add(0, false, true),
                Opcode::CopyMemory | Opcode::CopyMemorySized => {
                    add(0, false, true);
                    add(1, true, false);
                }
                _ if atomic::OPCODES.contains(&opcode) => add(0, true, true),
                _ => {}
            }
            all
        })
    }

    /// Whether an `OpLoad` loads no value from memory, but an image, a sampler or a structure.
    fn loads_a_handle(&self, instruction: &Instruction) -> bool {
        let ty = instruction.result_type.and_then(|id| self.module.type_with_id(id));
        matches!(
            ty.map(|ty| self.module.ty(ty)),
            Some(Type::Image(_) | Type::Sampler | Type::SampledImage(_) | Type::AccelerationStructure)
        )
    }

    /// The instruction in a function that an id is the result of.
    pub(crate) fn result(&self, id: Id) -> Option<&'a Instruction> {
        self.module.result_instruction(id)
    }

    /// The parts that a pointer or an image is made from. Where it cannot be followed (a choice
    /// between pointers, an address) those behind are missing.
    pub(crate) fn parts(&self, pointer: Id) -> Vec<Part> {
        let mut parts = Vec::new();
        let mut seen = FxHashSet::default();
        let mut open = vec![pointer];
        while let Some(id) = open.pop() {
            if !seen.insert(id) {
                continue;
            }
            match self.module.definition(id) {
                Some(Definition::Variable(_)) => parts.push(Part::Variable(id)),
                Some(Definition::Parameter(..)) => {
                    parts.push(Part::Parameter(id));
                    open.extend(self.arguments.get(&id).into_iter().flatten());
                }
                Some(Definition::Result(..)) => {
                    let Some(instruction) = self.result(id) else { continue };
                    if let Some(chain) = self.module.access_chain(instruction) {
                        self.members(chain, &mut parts);
                        open.push(chain.base);
                        continue;
                    }
                    let operands = self.module.operands(instruction);
                    let Some(&base) = operands.first() else { continue };
                    match instruction.opcode {
                        Opcode::Variable => parts.push(Part::Variable(id)),
                        Opcode::CopyObject
                        | Opcode::FreezeKHR
                        | Opcode::ImageTexelPointer
                        | Opcode::Image
                        | Opcode::SampledImage => {
                            open.push(Id(base));
                        }
                        // The image that an image instruction uses, not a pointer in memory.
                        Opcode::Load if self.loads_a_handle(instruction) => open.push(Id(base)),
                        _ => {}
                    }
                }
                _ => {}
            }
        }
        parts
    }

    /// Adds the members that the indices of an access chain select.
    fn members(&self, chain: AccessChain<'_>, parts: &mut Vec<Part>) {
        let Some(mut ty) = self.module.chain_type(chain) else { return };
        for &index in chain.indices {
            let index = self.module.scalar_value(Id(index));
            let Some(part) = self.module.part(ty, index) else { return };
            let index = index.and_then(|index| u32::try_from(index).ok());
            if let (Type::Struct { .. }, Some(id), Some(index)) =
                (self.module.ty(ty), self.module.id_of_type(ty), index)
            {
                parts.push(Part::Member(id, index));
            }
            ty = part;
        }
    }

    /// The storage class of a pointer.
    pub(crate) fn storage_class(&self, pointer: Id) -> Option<u32> {
        match *self.module.ty(self.module.type_of(pointer)?) {
            Type::Pointer { storage_class, .. } => Some(storage_class),
            _ => None,
        }
    }

    /// The variables that an access may reach.
    pub(crate) fn reached(&self, access: &MemoryAccess) -> impl Iterator<Item = Id> + use<> {
        self.parts(access.pointer).into_iter().filter_map(|part| match part {
            Part::Variable(id) => Some(id),
            _ => None,
        })
    }

    /// A variable, parameter or member as a report names it.
    pub(crate) fn describe(&self, part: Part) -> String {
        match part {
            Part::Variable(id) | Part::Parameter(id) => {
                // A block without an instance name is named after its type.
                let block = || self.module.name(self.module.id_of_type(self.module.pointee(id)?)?);
                let known = self.module.name(id).or_else(block);
                format!("`{}`", known.map_or_else(|| self.module.name_or_number(id), str::to_owned))
            }
            Part::Member(id, index) => {
                let member = self.module.debug_info.member_names.get(&(id, index));
                let member = member.filter(|name| !name.is_empty());
                let by_index = || format!("{}[{index}]", self.module.name_or_number(id));
                format!("`{}`", member.map_or_else(by_index, Clone::clone))
            }
        }
    }
}
