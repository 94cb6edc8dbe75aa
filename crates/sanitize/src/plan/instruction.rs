//! The instruction that an operation comes from, as its words stand in the module.

use rspirv::spirv::GlslStd450Op;

use crate::operand_check::CheckedInstruction;
use anyhit_engine::module::access_chain::AccessChain;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Definition, Id, Module, Opcode};

/// The words of an instruction of a module.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InstructionWords<'m> {
    /// The opcode; `OpNop` where the offset is that of no instruction.
    pub opcode: Opcode,
    /// All words, the first of which has the opcode.
    pub words: &'m [u32],
}

impl<'m> InstructionWords<'m> {
    /// The access chain that it is; `None` for any other instruction.
    pub(crate) fn access_chain(self) -> Option<AccessChain<'m>> {
        AccessChain::of(self.opcode, self.words.get(3..)?)
    }

    /// The instruction at a word offset.
    pub(crate) fn at(module: &'m Module, offset: u32) -> Self {
        let words = module.words.get(offset as usize..).unwrap_or_default();
        let count = words.first().map_or(0, |head| (head >> 16) as usize);
        let opcode = words.first().map_or(Opcode::Nop, |&head| Opcode::of_word(head));
        Self { opcode, words: words.get(..count).unwrap_or_default() }
    }

    /// Of an `OpSpecConstantOp`, the instruction with the opcode of its operation, which follows
    /// the result and precedes the operands.
    pub(super) fn computed_constant(self) -> Self {
        Self { opcode: self.words.get(3).map_or(Opcode::Nop, |&opcode| Opcode::of_operand(opcode)), ..self }
    }

    /// The instruction, where checks can be about it.
    pub(super) fn known(&self, module: &Module) -> Option<CheckedInstruction> {
        match (self.opcode, self.words) {
            (Opcode::ExtInst, &[_, _, _, set, number, ..]) => match module.definition(Id(set))? {
                Definition::InstructionSet(at) if module.instruction_sets[at as usize] == "GLSL.std.450" => {
                    GlslStd450Op::from_u32(number).map(CheckedInstruction::Glsl)
                }
                _ => None,
            },
            (opcode, _) => Some(CheckedInstruction::Core(opcode)),
        }
    }

    /// The id of the result, of an instruction that has one and a type.
    pub(crate) fn result(&self, module: &Module) -> Option<Id> {
        let id = Id(*self.words.get(2)?);
        module.type_of(id).is_some_and(|ty| module.type_with_id(Id(self.words[1])) == Some(ty)).then_some(id)
    }

    /// The variable that it declares, if it is `OpVariable`.
    pub(super) fn variable(&self) -> Option<Id> {
        match (self.opcode, self.words) {
            (Opcode::Variable, &[_, _, result, ..]) => Some(Id(result)),
            _ => None,
        }
    }

    /// Whether the result has a decoration.
    pub(super) fn is_decorated(&self, module: &Module, number: u32) -> bool {
        self.result(module).is_some_and(|id| module.decorations.find(id, number).is_some())
    }

    /// Bits of a scalar of the result; 0 where it has none.
    pub(super) fn result_width(&self, module: &Module) -> u32 {
        let ty = self.words.get(1).and_then(|&ty| module.type_with_id(Id(ty)));
        ty.map_or(0, |ty| scalar_width(module, ty))
    }
}

/// Bits of a scalar of a type; 0 where it has none.
pub(super) fn scalar_width(module: &Module, ty: TypeId) -> u32 {
    match *module.ty(ty) {
        Type::Int { width, .. } | Type::Float { width, .. } => width,
        Type::Vector { component, .. } => scalar_width(module, component),
        _ => 0,
    }
}
