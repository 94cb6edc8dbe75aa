//! Accesses of composites: indices lie within their types, and loads and stores have the type of
//! what they point to.

use rspirv::spirv::Op;

use crate::error::{Error, Result};
use crate::module::check::span_of;
use crate::module::grammar::opcode;
use crate::module::names::opcode_name;
use crate::module::ty::{Type, TypeId};
use crate::module::words::invalid;
use crate::module::{Id, Instruction, Module};

/// Checks one instruction; those that access nothing pass.
///
/// # Errors
/// `InvalidModule` where an index leaves its struct or, as a literal, its vector, matrix or array
/// of fixed length, indexes a scalar, or arrives at another type than the instruction says; where a
/// phi or a copy of memory gives a value another type.
pub(super) fn instruction(module: &Module, instruction: &Instruction) -> Result<()> {
    let Some(known) = opcode(instruction.opcode) else { return Ok(()) };
    let first = instruction.operands.start as usize;
    let result_type = || instruction.result_type.and_then(|id| module.type_with_id(id));
    let access = Access { module, instruction };
    match known.op {
        Op::CompositeExtract => {
            let Some(composite) = access.value_type(first)? else { return Ok(()) };
            let found = access.literal_path(composite, first + 1)?;
            access.agree(found, result_type(), span_of(instruction).start + 1)
        }
        Op::CompositeInsert => {
            let (object, composite) = (access.value_type(first)?, access.value_type(first + 1)?);
            let Some(composite) = composite else { return Ok(()) };
            access.agree(Some(composite), result_type(), first + 1)?;
            let found = access.literal_path(composite, first + 2)?;
            access.agree(found, object, first)
        }
        Op::AccessChain | Op::InBoundsAccessChain => {
            let Some(base) = access.pointee(first)? else { return Ok(()) };
            let found = access.id_path(base, first + 1)?;
            access.result_pointer(found, result_type())
        }
        Op::PtrAccessChain | Op::InBoundsPtrAccessChain => {
            let Some(base) = access.pointee(first)? else { return Ok(()) };
            let found = access.id_path(base, first + 2)?;
            access.result_pointer(found, result_type())
        }
        Op::Load => {
            let Some(pointee) = access.pointee(first)? else { return Ok(()) };
            access.agree(Some(pointee), result_type(), span_of(instruction).start + 1)
        }
        Op::Store => {
            let Some(pointee) = access.pointee(first)? else { return Ok(()) };
            access.agree(Some(pointee), module.type_of(Id(module.operands(instruction)[1])), first + 1)
        }
        Op::CopyMemory => {
            let (to, from) = (access.pointee(first)?, access.pointee(first + 1)?);
            access.agree(to, from, first + 1)
        }
        Op::Phi => {
            let result = result_type();
            let values = instruction.operands.clone().step_by(2).map(|at| at as usize);
            values
                .into_iter()
                .try_for_each(|at| access.agree(result, module.type_of(Id(module.words[at])), at))
        }
        _ => Ok(()),
    }
}

struct Access<'m> {
    module: &'m Module,
    instruction: &'m Instruction,
}

impl Access<'_> {
    /// The type of the value whose id stands at a word; `None` where an unknown instruction may
    /// define it.
    fn value_type(&self, at: usize) -> Result<Option<TypeId>> {
        let id = Id(self.module.words[at]);
        match self.module.type_of(id) {
            None if self.module.definition(id).is_some() => Err(self.expected(at, "a value")),
            ty => Ok(ty),
        }
    }

    /// What the pointer at a word points to; `None` for untyped pointers and unknown types.
    fn pointee(&self, at: usize) -> Result<Option<TypeId>> {
        let Some(pointer) = self.value_type(at)? else { return Ok(None) };
        match self.module.ty(pointer) {
            Type::Pointer { pointee, .. } => Ok(*pointee),
            Type::Other(_) => Ok(None),
            _ => Err(self.expected(at, "a pointer")),
        }
    }

    /// Follows literal indices from a word on to the end of the instruction.
    fn literal_path(&self, mut ty: TypeId, start: usize) -> Result<Option<TypeId>> {
        for at in start..self.instruction.operands.end as usize {
            let index = u64::from(self.module.words[at]);
            match self.step(ty, Some(index), at)? {
                Some(inner) => ty = inner,
                None => return Ok(None),
            }
        }
        Ok(Some(ty))
    }

    /// Follows indices that are ids from a word on to the end of the instruction.
    fn id_path(&self, mut ty: TypeId, start: usize) -> Result<Option<TypeId>> {
        for at in start..self.instruction.operands.end as usize {
            let id = Id(self.module.words[at]);
            let index_type = self.value_type(at)?;
            let index = match index_type.map(|ty| self.module.ty(ty)) {
                Some(Type::Int { width, signed }) => {
                    let sign = 64 - width;
                    self.module.constant_scalar(id).map(|bits| {
                        // A negative index is a very large one: out of any range.
                        if *signed { ((bits << sign) as i64 >> sign) as u64 } else { bits }
                    })
                }
                None | Some(Type::Other(_)) => None,
                Some(_) => return Err(self.expected(at, "an integer as index")),
            };
            if let Type::Struct { .. } = self.module.ty(ty)
                && index.is_none()
            {
                return Err(self.expected(at, "a constant as index of a struct"));
            }
            match self.step(ty, index, at)? {
                Some(inner) => ty = inner,
                None => return Ok(None),
            }
        }
        Ok(Some(ty))
    }

    /// One step into a composite; `index` is `None` where it is not constant. `None` for types that
    /// are not known.
    fn step(&self, ty: TypeId, index: Option<u64>, at: usize) -> Result<Option<TypeId>> {
        let (inner, count) = match self.module.ty(ty) {
            Type::Struct { members, .. } => {
                let index = index.unwrap_or(0);
                let member = usize::try_from(index).ok().and_then(|index| members.get(index));
                (member.map(|member| member.ty), Some(members.len() as u64))
            }
            Type::Vector { component, count } => (Some(*component), self.fixed(Some(u64::from(*count)))),
            Type::Matrix { column, count } => (Some(*column), self.fixed(Some(u64::from(*count)))),
            Type::Array { element, length, .. } => {
                (Some(*element), self.fixed(self.module.constant_scalar(*length)))
            }
            Type::RuntimeArray { element, .. } => (Some(*element), None),
            Type::Other(_) => return Ok(None),
            _ => {
                return Err(invalid(
                    at,
                    format!(
                        "{}: an index into {}, which has no parts",
                        opcode_name(self.instruction.opcode),
                        self.module.describe_type(ty)
                    ),
                ));
            }
        };
        match (inner, index, count) {
            (Some(inner), Some(index), Some(count)) if index < count => Ok(Some(inner)),
            (Some(inner), index, count) if index.is_none() || count.is_none() => Ok(Some(inner)),
            _ => Err(invalid(
                at,
                format!(
                    "{}: index {} is out of range: {} has {} parts",
                    opcode_name(self.instruction.opcode),
                    index.unwrap_or_default() as i64,
                    self.module.describe_type(ty),
                    count.unwrap_or_default()
                ),
            )),
        }
    }

    /// How many parts an index is held against. Those that come through memory, as constants may,
    /// are left to the run: an index past the end is undefined where it is used (`OpAccessChain`),
    /// and shaders may name an element past the end and never touch it.
    fn fixed(&self, parts: Option<u64>) -> Option<u64> {
        let literal =
            matches!(opcode(self.instruction.opcode)?.op, Op::CompositeExtract | Op::CompositeInsert);
        parts.filter(|_| literal)
    }

    /// Two types that must be one, where both are known.
    fn agree(&self, found: Option<TypeId>, said: Option<TypeId>, at: usize) -> Result<()> {
        match (found, said) {
            (Some(found), Some(said)) if found != said => Err(invalid(
                at,
                format!(
                    "{}: the type {} is expected, found {}",
                    opcode_name(self.instruction.opcode),
                    self.module.describe_type(found),
                    self.module.describe_type(said)
                ),
            )),
            _ => Ok(()),
        }
    }

    /// Holds the type arrived at against the pointer type that the instruction says.
    fn result_pointer(&self, found: Option<TypeId>, result_type: Option<TypeId>) -> Result<()> {
        let at = span_of(self.instruction).start + 1;
        match result_type.map(|ty| self.module.ty(ty)) {
            Some(Type::Pointer { pointee, .. }) => self.agree(found, *pointee, at),
            Some(Type::Other(_)) | None => Ok(()),
            Some(_) => Err(self.expected(at, "a pointer type")),
        }
    }

    #[cold]
    fn expected(&self, at: usize, what: &str) -> Error {
        invalid(
            at,
            format!(
                "{}: expected {what}, found {}",
                opcode_name(self.instruction.opcode),
                self.module.describe_id(Id(self.module.words[at]))
            ),
        )
    }
}
