//! SPIR-V bytes, read into a typed module.
//!
//! This folder and `ops/` are the only ones that name rspirv: its grammar tables say how many
//! operands an instruction has and of what kind. This crate has a parser of its own, because real
//! modules contain what rspirv's loader rejects.

pub mod access_chain;
mod check;
mod check_access;
pub mod check_encoding;
mod check_flow;
pub mod constant;
mod copy_budget;
pub mod debug_info;
mod debug_reader;
mod debug_scope_reader;
pub mod debug_scopes;
pub mod decimal;
mod declare_constant;
mod declare_type;
pub mod decoration;
mod describe;
pub mod disassembly;
pub mod dispatch_axes;
mod functions;
pub mod grammar;
pub mod heap;
pub mod hit_ids;
pub mod id_map;
mod included_lines;
mod instructions;
pub mod interface;
pub mod load;
mod lookup;
pub mod names;
mod opcode;
pub(crate) mod opcode_table;
mod open;
pub mod push_constant_bank;
pub mod scalar_value;
mod span;
pub mod ty;
pub mod validate;
mod words;

#[cfg(any(test, feature = "test-support"))]
pub mod assemble;
#[cfg(test)]
mod load_tests;
#[cfg(test)]
mod refuse_function_tests;
#[cfg(test)]
mod refuse_tests;

use crate::module::constant::Constant;
use crate::module::debug_info::DebugInfo;
use crate::module::debug_scopes::DebugScopes;
use crate::module::decoration::Decorations;
use crate::module::id_map::IdMap;
use crate::module::interface::EntryPoint;
use crate::module::ty::{CooperativeMatrix, Type, TypeId};
use crate::module::validate::ValidationFinding;
use anyhit_base::error::Warning;
use std::fmt;
use std::ops::Range;
use std::sync::OnceLock;

pub use instructions::Instructions;
pub use load::{load, load_with};
pub use opcode::Opcode;

/// A result id of the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Id(pub u32);

/// One instruction of a function. Its operands stay in the words of the module.
///
/// Unknown opcodes are kept. They are an error only where they would be executed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// The opcode.
    pub opcode: Opcode,
    /// Where the instruction begins, in words from the start of the module.
    pub offset: u32,
    /// The result type's id, where the opcode has one.
    pub result_type: Option<Id>,
    /// The result id, where the opcode has one.
    pub result: Option<Id>,
    /// The words after result type and result id, as a range of [`Module::words`].
    pub operands: Range<u32>,
}

/// A basic block: a label and the instructions up to and including its terminator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BasicBlock {
    /// The id of its `OpLabel`.
    pub label: Id,
    /// The word offset of its `OpLabel`.
    pub offset: u32,
    /// The instructions after the label; the last is the terminator, the one before it may be a
    /// merge instruction. `OpLine`, `OpNoLine` and debug-information instructions are left out.
    pub instructions: Vec<Instruction>,
}

/// A function with its parameters and blocks, in the module's order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// The id of its `OpFunction`.
    pub id: Id,
    /// The word offset of its `OpFunction`.
    pub offset: u32,
    /// `Function Control`, a mask.
    pub control: u32,
    /// The return type.
    pub return_type: TypeId,
    /// The result id and the type of each parameter.
    pub parameters: Vec<(Id, TypeId)>,
    /// The blocks; empty for a declaration without a body (an import).
    pub blocks: Vec<BasicBlock>,
    /// Indices of the functions that its instructions call, one for each call, in their order.
    pub calls: Vec<u32>,
    /// Indices of the module-scope variables that its instructions use, ascending.
    pub variables: Vec<u32>,
}

/// An `OpVariable` at module scope.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GlobalVariable {
    /// The result id.
    pub id: Id,
    /// The pointer type.
    pub pointer: TypeId,
    /// The type of what it holds; `None` for an untyped variable without it.
    pub ty: Option<TypeId>,
    /// The storage class's number.
    pub storage_class: u32,
    /// The initialiser, a constant or a variable.
    pub initializer: Option<Id>,
    /// The word offset of its instruction.
    pub offset: u32,
}

/// What an id defines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Definition {
    /// A type.
    Type(TypeId),
    /// A constant: index into [`Module::constants`].
    Constant(u32),
    /// A variable at module scope: index into [`Module::variables`].
    Variable(u32),
    /// A function: index into [`Module::functions`].
    Function(u32),
    /// A parameter of a function: function's index, parameter's index.
    Parameter(u32, u32),
    /// The label of a block: function's index, block's index.
    Label(u32, u32),
    /// The result of an instruction in a function: function's, block's and instruction's index.
    Result(u32, u32, u32),
    /// An imported instruction set: index into [`Module::instruction_sets`].
    InstructionSet(u32),
    /// Anything else at module scope: a string, a decoration group, debug information.
    Other,
}

/// A module: arenas of types, constants, variables and functions, with names and spans.
#[derive(Clone)]
pub struct Module {
    /// The words, in this machine's byte order, header included.
    #[doc(hidden)]
    pub words: Vec<u32>,
    /// Major and minor version.
    #[doc(hidden)]
    pub version: (u8, u8),
    /// The header's generator word.
    #[doc(hidden)]
    pub generator: u32,
    /// The limits that it was loaded with, which hold for whatever is made of it, too.
    #[doc(hidden)]
    pub limits: anyhit_base::input::InputLimits,
    /// Numbers of the addressing model and the memory model.
    #[doc(hidden)]
    pub memory_model: (u32, u32),
    /// Numbers of the declared capabilities.
    pub capabilities: Vec<u32>,
    /// Names of the declared extensions.
    pub extensions: Vec<String>,
    /// Names of the imported instruction sets.
    pub instruction_sets: Vec<String>,
    /// Entry points in the module's order.
    pub entry_points: Vec<EntryPoint>,
    /// All types; a [`TypeId`] is an index.
    #[doc(hidden)]
    pub types: Vec<Type>,
    /// The id that declares each type.
    #[doc(hidden)]
    pub type_ids: Vec<Id>,
    /// The vector types whose count of components is a constant, with that constant, ascending:
    /// long vectors (`SPV_EXT_long_vector`) and cooperative vectors (`SPV_NV_cooperative_vector`).
    #[doc(hidden)]
    pub vector_counts: Vec<(TypeId, Id)>,
    /// The cooperative matrix types (`SPV_KHR_cooperative_matrix`), ascending.
    #[doc(hidden)]
    pub cooperative_matrices: Vec<CooperativeMatrix>,
    /// All constants, specialization constants and undefined values of module scope.
    #[doc(hidden)]
    pub constants: Vec<Constant>,
    /// All variables of module scope.
    #[doc(hidden)]
    pub variables: Vec<GlobalVariable>,
    /// All functions.
    #[doc(hidden)]
    pub functions: Vec<Function>,
    /// Decorations of ids and members.
    #[doc(hidden)]
    pub decorations: Decorations,
    /// Names, source files, lines.
    #[doc(hidden)]
    pub debug_info: DebugInfo,
    /// Lexical scopes and local variables, once somebody has asked for them; see
    /// [`Module::debug_scopes`].
    scopes: OnceLock<DebugScopes>,
    /// Findings of [`Module::validate`] that make the module invalid, once lowering has asked for
    /// them.
    faults: OnceLock<Vec<ValidationFinding>>,
    /// Its other findings, once somebody has asked for them.
    undeclared: OnceLock<Vec<ValidationFinding>>,
    /// What each id defines.
    #[doc(hidden)]
    pub definitions: IdMap<Definition>,
    /// The types of the results of instructions in functions.
    #[doc(hidden)]
    pub result_types: IdMap<TypeId>,
    /// What the compiler of its source warned of; none where the module was not compiled here.
    pub warnings: Vec<Warning>,
}

/// Version, entry points, and the number of words.
impl fmt::Debug for Module {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Module")
            .field("version", &self.version)
            .field("words", &self.words.len())
            .field("entry_points", &self.entry_points)
            .finish_non_exhaustive()
    }
}

impl Module {
    /// The operand words of an instruction (after result type and result id).
    #[doc(hidden)]
    #[inline]
    pub fn operands(&self, instruction: &Instruction) -> &[u32] {
        &self.words[instruction.operands.start as usize..instruction.operands.end as usize]
    }

    /// The type with this handle.
    #[doc(hidden)]
    pub fn ty(&self, ty: TypeId) -> &Type {
        &self.types[ty.0 as usize]
    }

    /// Returns whether a type is a cooperative vector (`SPV_NV_cooperative_vector`), which is a
    /// [`Type::Vector`] of any number of components.
    #[doc(hidden)]
    pub fn is_cooperative_vector(&self, ty: TypeId) -> bool {
        /// `CooperativeVectorNV`
        const COOPERATIVE_VECTORS: u32 = 5394;
        !self.vector_counts.is_empty()
            && self.vector_counts.binary_search_by_key(&ty, |&(ty, _)| ty).is_ok()
            && self.capabilities.contains(&COOPERATIVE_VECTORS)
    }

    /// The operands of a cooperative matrix type. The type itself is a [`Type::Vector`] of the
    /// components that one invocation of a subgroup has.
    #[doc(hidden)]
    pub fn cooperative_matrix(&self, ty: TypeId) -> Option<&CooperativeMatrix> {
        let at = self.cooperative_matrices.binary_search_by_key(&ty, |matrix| matrix.ty);
        self.cooperative_matrices.get(at.ok()?)
    }

    /// What an id defines; `None` where no known instruction defines it.
    #[doc(hidden)]
    #[inline]
    pub fn definition(&self, id: Id) -> Option<Definition> {
        self.definitions.find(id)
    }
}
