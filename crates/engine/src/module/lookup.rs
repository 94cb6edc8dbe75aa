//! Queries on a loaded module: types, constants, names, operands, branch targets.

use std::collections::HashSet;

use smallvec::SmallVec;

use crate::module::constant::ConstantValue;
use crate::module::grammar::id_operands;
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Function, Id, Instruction, Module, Opcode};

impl Module {
    /// The bits of a plain scalar constant: no specialization constant, no composite.
    ///
    /// A bool is 0 or 1, an integer its low `width` bits zero-extended, a float its bits. A null
    /// constant of scalar type is 0. `None` for anything else, undefined values included.
    #[doc(hidden)]
    pub fn constant_scalar(&self, id: Id) -> Option<u64> {
        let Some(Definition::Constant(index)) = self.definition(id) else { return None };
        let constant = &self.constants[index as usize];
        let scalar = matches!(self.ty(constant.ty), Type::Bool | Type::Int { .. } | Type::Float { .. });
        match constant.value {
            _ if constant.specializable => None,
            ConstantValue::Scalar(bits) => Some(bits),
            ConstantValue::Null if scalar => Some(0),
            _ => None,
        }
    }

    /// The type that an id has as a value: of constants, variables, parameters and results.
    ///
    /// `None` for types, labels, functions, and where nothing known defines the id.
    #[doc(hidden)]
    pub fn type_of(&self, id: Id) -> Option<TypeId> {
        if let Some(ty) = self.result_types.find(id) {
            return Some(ty);
        }
        match self.definition(id)? {
            Definition::Constant(index) => Some(self.constants[index as usize].ty),
            Definition::Variable(index) => Some(self.variables[index as usize].pointer),
            Definition::Parameter(function, index) => {
                Some(self.functions[function as usize].parameters[index as usize].1)
            }
            _ => None,
        }
    }

    /// The type that a pointer points to, of an untyped one that of the variable or of the access
    /// chain that makes it; `None` where an id is no pointer, or that is not known.
    #[doc(hidden)]
    pub fn pointee(&self, pointer: Id) -> Option<TypeId> {
        match (self.ty(self.type_of(pointer)?), self.definition(pointer)?) {
            (Type::Pointer { pointee: Some(pointee), .. }, _) => Some(*pointee),
            (Type::Pointer { .. }, Definition::Variable(at)) => self.variables[at as usize].ty,
            (Type::Pointer { .. }, _) => self.untyped_pointee(pointer),
            _ => None,
        }
    }

    /// The instruction in a function that an id is the result of.
    #[doc(hidden)]
    pub fn result_instruction(&self, id: Id) -> Option<&Instruction> {
        let Definition::Result(function, block, at) = self.definition(id)? else { return None };
        let block = self.functions.get(function as usize)?.blocks.get(block as usize)?;
        block.instructions.get(at as usize)
    }

    /// The type that an id declares.
    #[doc(hidden)]
    pub fn type_with_id(&self, id: Id) -> Option<TypeId> {
        match self.definition(id)? {
            Definition::Type(ty) => Some(ty),
            _ => None,
        }
    }

    /// The function that an id defines.
    #[doc(hidden)]
    pub fn function(&self, id: Id) -> Option<&Function> {
        match self.definition(id)? {
            Definition::Function(index) => Some(&self.functions[index as usize]),
            _ => None,
        }
    }

    /// A function's name in the source: from debug information, else from `OpName`, without the
    /// types of its parameters that glslang appends to both.
    #[doc(hidden)]
    pub fn function_name(&self, function: Id) -> Option<&str> {
        let info = &self.debug_info;
        let name = info.function_names.get(&function).map(|name| &**name);
        let name = name.or_else(|| info.names.get(&function).map(String::as_str))?;
        name.split(['(', ',']).next().filter(|name| !name.is_empty())
    }

    /// The name of an id in the source: from `OpName`, else from debug information.
    ///
    /// glslang writes a function's parameters into its name, `divide(f1;f1;`: these are removed.
    #[doc(hidden)]
    pub fn name(&self, id: Id) -> Option<&str> {
        let info = &self.debug_info;
        let mut name = info.names.get(&id).map_or("", String::as_str);
        if let Some(Definition::Function(_)) = self.definition(id) {
            name = name.split('(').next().unwrap_or_default();
        }
        if !name.is_empty() {
            return Some(name);
        }
        let name = info.variable_names.get(&id).or_else(|| info.function_names.get(&id))?;
        Some(name).map(|name| &**name).filter(|name| !name.is_empty())
    }

    /// The name of an id in the source, or its number: `%12`.
    #[doc(hidden)]
    pub fn name_or_number(&self, id: Id) -> String {
        self.name(id).map_or_else(|| format!("%{}", id.0), str::to_owned)
    }

    /// The name of an id in quotes, or its number.
    #[doc(hidden)]
    pub fn quoted_name(&self, id: Id) -> String {
        self.name(id).map_or_else(|| format!("%{}", id.0), |name| format!("`{name}`"))
    }

    /// The type of a part of a composite, by its index where that is known.
    #[doc(hidden)]
    pub fn part(&self, ty: TypeId, index: Option<u64>) -> Option<TypeId> {
        Some(match *self.ty(ty) {
            Type::Struct { ref members, .. } => members.get(usize::try_from(index?).ok()?)?.ty,
            Type::Array { element: part, .. }
            | Type::RuntimeArray { element: part, .. }
            | Type::Vector { component: part, .. }
            | Type::Matrix { column: part, .. } => part,
            _ => return None,
        })
    }

    /// Returns true if a type is one that this crate does not know ([`Type::Other`]), holds one or
    /// points to one: nothing says then what its values are, and where they may be used.
    #[doc(hidden)]
    pub fn is_opaque(&self, ty: TypeId) -> bool {
        let mut seen = HashSet::new();
        let mut worklist = vec![ty];
        while let Some(ty) = worklist.pop() {
            if !seen.insert(ty) {
                continue;
            }
            match *self.ty(ty) {
                Type::Other(_) => return true,
                Type::Vector { component: part, .. }
                | Type::Matrix { column: part, .. }
                | Type::Array { element: part, .. }
                | Type::RuntimeArray { element: part, .. }
                | Type::Pointer { pointee: Some(part), .. }
                | Type::SampledImage(part) => worklist.push(part),
                Type::Struct { ref members, .. } => worklist.extend(members.iter().map(|member| member.ty)),
                _ => {}
            }
        }
        false
    }

    /// Whether the module declares the capability `VulkanMemoryModel`.
    #[doc(hidden)]
    pub fn has_vulkan_memory_model(&self) -> bool {
        const VULKAN_MEMORY_MODEL: u32 = 5345;
        self.capabilities.contains(&VULKAN_MEMORY_MODEL)
    }

    /// The id that declares a type.
    #[doc(hidden)]
    pub fn id_of_type(&self, ty: TypeId) -> Option<Id> {
        self.type_ids.get(ty.0 as usize).copied()
    }

    /// The instruction at an offset, in words from the start of the module.
    #[doc(hidden)]
    pub fn instruction_at(&self, offset: u32) -> Option<&Instruction> {
        let block = self.block_at(self.function_at(offset)?, offset)?;
        block.instructions.iter().find(|instruction| instruction.offset == offset)
    }

    /// Whether the result of the instruction at an offset is a float of 32 bits, or made of such.
    #[doc(hidden)]
    pub fn is_float_result(&self, offset: u32) -> bool {
        let ty = self.instruction_at(offset).and_then(|instruction| self.type_of(instruction.result?));
        let Some(mut ty) = ty else { return false };
        loop {
            match *self.ty(ty) {
                Type::Vector { component: part, .. } | Type::Matrix { column: part, .. } => ty = part,
                Type::Float { width, encoding } => return width == 32 && encoding.is_none(),
                _ => return false,
            }
        }
    }

    /// The operands of an instruction that are ids, result type and result id left out.
    ///
    /// Empty for unknown opcodes. The grammar distinguishes ids from literals.
    #[doc(hidden)]
    pub fn operand_ids(&self, instruction: &Instruction) -> SmallVec<[Id; 8]> {
        let mut ids = SmallVec::new();
        let operands = instruction.operands.start as usize..instruction.operands.end as usize;
        let literal_words = self.switch_literal_words(instruction);
        id_operands(&self.words, instruction.opcode, operands, literal_words, &mut |at| {
            ids.push(Id(self.words[at]));
        });
        ids
    }

    /// Whether control can come to a block of a function, both by index.
    #[doc(hidden)]
    pub fn reaches(&self, function: u32, block: u32) -> bool {
        let Some(body) = self.functions.get(function as usize) else { return false };
        let mut reached = vec![false; body.blocks.len()];
        let mut open = vec![0];
        while let Some(at) = open.pop() {
            let Some(here) = body.blocks.get(at as usize) else { continue };
            if std::mem::replace(&mut reached[at as usize], true) {
                continue;
            }
            let Some(terminator) = here.instructions.last() else { continue };
            for label in self.branch_targets(terminator) {
                if let Some(Definition::Label(its, target)) = self.definition(label)
                    && its == function
                {
                    open.push(target);
                }
            }
        }
        reached.get(block as usize).copied().unwrap_or(false)
    }

    /// The labels that a terminator may branch to, in the order of its operands; empty for others.
    #[doc(hidden)]
    pub fn branch_targets(&self, terminator: &Instruction) -> SmallVec<[Id; 2]> {
        let operands = self.operands(terminator);
        match terminator.opcode {
            Opcode::Branch => operands.iter().copied().map(Id).collect(),
            Opcode::BranchConditional => SmallVec::from_buf([Id(operands[1]), Id(operands[2])]),
            Opcode::Switch => {
                let pair = 1 + self.switch_literal_words(terminator);
                let cases = operands[2..].chunks_exact(pair).map(|case| Id(case[pair - 1]));
                std::iter::once(Id(operands[1])).chain(cases).collect()
            }
            _ => SmallVec::new(),
        }
    }

    /// How many words each case literal of an `OpSwitch` takes: 2 for a 64-bit selector, else 1.
    #[doc(hidden)]
    pub fn switch_literal_words(&self, instruction: &Instruction) -> usize {
        if instruction.opcode != Opcode::Switch {
            return 1;
        }
        let selector = self.operands(instruction).first().and_then(|id| self.type_of(Id(*id)));
        match selector.map(|ty| self.ty(ty)) {
            Some(Type::Int { width: 64, .. }) => 2,
            _ => 1,
        }
    }
}
