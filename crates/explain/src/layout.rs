//! Maps the bytes of a buffer to the members of its type.

use crate::values::TypedValue;
use anyhit_engine::machine::Binding;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{MemoryPart, Module};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::Pipeline;
use anyhit_engine::program::Program;
use anyhit_engine::program::layout::{Layout, Rules};

/// `DescriptorSet` and `Binding`, numbers of decorations.
const DESCRIPTOR_SET: u32 = 34;
const BINDING: u32 = 33;

/// The type that a shader declares for a buffer.
#[derive(Clone, Copy, Debug)]
pub struct BufferLayout<'a> {
    module: &'a Module,
    ty: TypeId,
}

/// A scalar or vector in a buffer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BufferMember {
    /// The access path from the buffer's block: `outputs[3].normal`.
    pub path: String,
    /// The offset of the first byte.
    pub offset: u64,
    /// The size in bytes.
    pub size: u64,
    ty: TypeId,
}

impl<'a> BufferLayout<'a> {
    /// The type of a binding in the first shader that declares it.
    pub fn of(pipeline: &'a Pipeline, binding: Binding) -> Option<Self> {
        pipeline.programs.iter().find_map(|program| {
            let module = &*program.module;
            let number = |id, decoration| module.decorations.literal(id, decoration);
            let variable = module.variables.iter().find(|variable| {
                number(variable.id, DESCRIPTOR_SET) == Some(binding.set)
                    && number(variable.id, BINDING) == Some(binding.binding)
            })?;
            match *module.ty(variable.pointer) {
                Type::Pointer { pointee: Some(ty), .. } => Some(Self { module, ty }),
                _ => None,
            }
        })
    }

    /// The type that an entry point declares for the data of its shader record; `None` where it
    /// reads none.
    pub(super) fn of_record(program: &'a Program) -> Option<Self> {
        let module = &*program.module;
        let variables = module.interface_of(program.entry_point()?);
        let variable = variables.iter().find(|one| one.storage_class == storage::SHADER_RECORD_BUFFER)?;
        Some(Self { module, ty: variable.ty? })
    }

    /// The bytes that are declared, of which runtime arrays have as many as are given.
    pub(super) fn size(&self, given: u64) -> u64 {
        let layout = Layout::new(self.module, self.ty, Rules::Explicit);
        match layout.runtime_stride() {
            Some((start, _)) => given.max(start as u64),
            None => layout.size() as u64,
        }
    }

    /// The scalars and vectors of the first bytes, at most so many.
    pub(super) fn members(&self, bytes: u64, most: usize) -> Vec<BufferMember> {
        let mut members: Vec<BufferMember> = Vec::new();
        let mut byte = 0;
        while byte < bytes && members.len() < most {
            match self.member_at(byte) {
                Some(member) => {
                    byte = member.offset + member.size.max(1);
                    members.push(member);
                }
                None => byte += 4,
            }
        }
        members
    }

    /// The scalar or vector that holds a byte; `None` in padding, and for scalars that are not
    /// whole words.
    pub fn member_at(&self, byte: u64) -> Option<BufferMember> {
        let MemoryPart { path, offset, ty, scalar } = self.module.part_at(self.ty, byte)?;
        let is_whole_words = matches!(
            self.module.ty(scalar),
            Type::Int { width: 32 | 64, .. }
                | Type::Float { width: 32 | 64, encoding: None }
                | Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. }
        );
        let member = BufferMember { path, offset, size: self.module.size_of(ty)?, ty };
        (is_whole_words && byte < member.offset + member.size && member.offset.is_multiple_of(4))
            .then_some(member)
    }

    /// The value of a member from its words.
    pub fn value(&self, member: &BufferMember, words: &[u32]) -> TypedValue {
        TypedValue::of_type(self.module, member.ty, words)
    }
}
