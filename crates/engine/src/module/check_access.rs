//! Checks accesses of composites: indices are in bounds, and loads and stores have the type of the
//! pointee.

use crate::module::span::{invalid, span_of};
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Instruction, Module, Opcode};
use anyhit_base::error::{Error, Result};

/// Checks one instruction. Those that access no composite or memory are accepted.
///
/// # Errors
/// `InvalidModule` where an index is out of its struct's bounds or, as a literal, of those of a
/// vector, matrix or array, indexes a scalar, or leads to another type than the instruction has;
/// where the values of a phi or the pointees of a memory copy have different types.
pub(super) fn instruction(module: &Module, instruction: &Instruction) -> Result<()> {
    let first = instruction.operands.start as usize;
    let result_type = || instruction.result_type.and_then(|id| module.type_with_id(id));
    let access = AccessChecker { module, instruction };
    if let Some(chain) = module.access_chain(instruction) {
        let end = instruction.operands.end as usize;
        let base = match chain.base_type {
            Some(_) => {
                access.pointee(first + 1)?;
                Some(access.base_type(first)?)
            }
            None => access.pointee(first)?,
        };
        let Some(base) = base else { return Ok(()) };
        let found = access.id_path(base, end - chain.indices.len())?;
        return access.result_pointer(found, result_type());
    }
    match instruction.opcode {
        Opcode::CompositeExtract => {
            let Some(composite) = access.value_type(first)? else { return Ok(()) };
            let found = access.literal_path(composite, first + 1)?;
            access.check_same_type(found, result_type(), span_of(instruction).start + 1)
        }
        Opcode::CompositeInsert => {
            let (object, composite) = (access.value_type(first)?, access.value_type(first + 1)?);
            let Some(composite) = composite else { return Ok(()) };
            access.check_same_type(Some(composite), result_type(), first + 1)?;
            let found = access.literal_path(composite, first + 2)?;
            access.check_same_type(found, object, first)
        }
        Opcode::Load => {
            let Some(pointee) = access.pointee(first)? else { return Ok(()) };
            access.check_same_type(Some(pointee), result_type(), span_of(instruction).start + 1)
        }
        Opcode::Store => {
            let Some(pointee) = access.pointee(first)? else { return Ok(()) };
            access.check_same_type(
                Some(pointee),
                module.type_of(Id(module.operands(instruction)[1])),
                first + 1,
            )
        }
        Opcode::CopyMemory => {
            let (to, from) = (access.pointee(first)?, access.pointee(first + 1)?);
            access.check_same_type(to, from, first + 1)
        }
        Opcode::Phi => {
            let result = result_type();
            let values = instruction.operands.clone().step_by(2).map(|at| at as usize);
            values
                .into_iter()
                .try_for_each(|at| access.check_same_type(result, module.type_of(Id(module.words[at])), at))
        }
        _ => Ok(()),
    }
}

struct AccessChecker<'m> {
    module: &'m Module,
    instruction: &'m Instruction,
}

impl AccessChecker<'_> {
    /// The type of the value whose id is at a word; `None` where an unknown instruction may define
    /// it.
    #[inline]
    fn value_type(&self, at: usize) -> Result<Option<TypeId>> {
        let id = Id(self.module.words[at]);
        match self.module.type_of(id) {
            None if self.module.definition(id).is_some() => Err(self.expected(at, "a value")),
            ty => Ok(ty),
        }
    }

    /// The type whose id is at a word.
    fn base_type(&self, at: usize) -> Result<TypeId> {
        let ty = self.module.type_with_id(Id(self.module.words[at]));
        ty.ok_or_else(|| self.expected(at, "a type"))
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

    /// The type that literal indices lead to, from a word to the end of the instruction.
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

    /// The type that indices given by ids lead to, from a word to the end of the instruction.
    fn id_path(&self, mut ty: TypeId, start: usize) -> Result<Option<TypeId>> {
        for at in start..self.instruction.operands.end as usize {
            let id = Id(self.module.words[at]);
            let index_type = self.value_type(at)?;
            let index = match index_type.map(|ty| self.module.ty(ty)) {
                Some(Type::Int { width, signed }) => {
                    let sign = 64 - width;
                    self.module.constant_scalar(id).map(|bits| {
                        // A negative index becomes a very large one, which is out of any bounds.
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

    /// The type of a part of a composite; `index` is `None` if it is not constant. Returns `None`
    /// for unknown types.
    fn step(&self, ty: TypeId, index: Option<u64>, at: usize) -> Result<Option<TypeId>> {
        let (inner, count) = match self.module.ty(ty) {
            Type::Struct { members, .. } => {
                let index = index.unwrap_or(0);
                let member = usize::try_from(index).ok().and_then(|index| members.get(index));
                (member.map(|member| member.ty), Some(members.len() as u64))
            }
            Type::Vector { component, count } => {
                (Some(*component), self.checked_length(Some(u64::from(*count))))
            }
            Type::Matrix { column, count } => (Some(*column), self.checked_length(Some(u64::from(*count)))),
            Type::Array { element, length, .. } => {
                (Some(*element), self.checked_length(self.module.constant_scalar(*length)))
            }
            Type::RuntimeArray { element, .. } => (Some(*element), None),
            Type::Other(_) => return Ok(None),
            _ => {
                return Err(invalid(
                    at,
                    format!(
                        "{}: cannot index into {}",
                        self.instruction.opcode,
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
                    self.instruction.opcode,
                    index.unwrap_or_default() as i64,
                    self.module.describe_type(ty),
                    count.unwrap_or_default()
                ),
            )),
        }
    }

    /// The length that an index is checked against here: that of a composite value, whose indices
    /// are literals. Indices into memory are checked while running, even constant ones:
    /// `OpAccessChain` past the end is undefined only if the pointer is used, and shaders may
    /// compute one and never use it.
    fn checked_length(&self, length: Option<u64>) -> Option<u64> {
        let literal = matches!(self.instruction.opcode, Opcode::CompositeExtract | Opcode::CompositeInsert);
        length.filter(|_| literal)
    }

    /// Checks that two types are equal, where both are known.
    fn check_same_type(&self, expected: Option<TypeId>, found: Option<TypeId>, at: usize) -> Result<()> {
        match (expected, found) {
            (Some(expected), Some(found)) if expected != found => Err(invalid(
                at,
                format!(
                    "{}: expected the type {}, found {}",
                    self.instruction.opcode,
                    self.module.describe_type(expected),
                    self.module.describe_type(found)
                ),
            )),
            _ => Ok(()),
        }
    }

    /// Checks the type that the indices lead to against the pointer type of the result.
    fn result_pointer(&self, found: Option<TypeId>, result_type: Option<TypeId>) -> Result<()> {
        let at = span_of(self.instruction).start + 1;
        match result_type.map(|ty| self.module.ty(ty)) {
            Some(Type::Pointer { pointee, .. }) => self.check_same_type(found, *pointee, at),
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
                self.instruction.opcode,
                self.module.describe_id(Id(self.module.words[at]))
            ),
        )
    }
}
