//! Maps the bytes of a buffer to the members of its type.

use anyhit_engine::machine::Binding;
use anyhit_engine::module::ty::Type;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::Pipeline;
use anyhit_engine::program::Program;
use anyhit_engine::reflect::lookup::variable_at;
use anyhit_engine::reflect::{Layout, MemoryPart, Rules};

/// The layout of a binding in the first shader that declares it.
pub fn of_binding(pipeline: &Pipeline, binding: Binding) -> Option<Layout<'_>> {
    pipeline.programs.iter().find_map(|program| variable_at(&program.module, binding))
}

/// The layout that an entry point declares for the data of its shader record; `None` where it
/// reads none.
pub(super) fn of_record(program: &Program) -> Option<Layout<'_>> {
    let module = &*program.module;
    let variables = module.interface_of(program.entry_point()?);
    let variable = variables.iter().find(|one| one.storage_class == storage::SHADER_RECORD_BUFFER)?;
    Some(Layout::new(module, variable.ty?, Rules::Explicit))
}

/// The declared bytes, of which runtime arrays have as many as are given.
pub(super) fn declared_size(layout: Layout<'_>, given: u64) -> u64 {
    match layout.runtime_stride() {
        Some((start, _)) => given.max(start as u64),
        None => layout.size() as u64,
    }
}

/// The scalars and vectors of the first bytes, at most so many.
pub(super) fn members(layout: Layout<'_>, bytes: u64, most: usize) -> Vec<MemoryPart<'_>> {
    let mut members: Vec<MemoryPart<'_>> = Vec::new();
    let mut byte = 0;
    while byte < bytes && members.len() < most {
        match member_at(layout, byte) {
            Some(member) => {
                byte = member.end().max(member.offset + 1);
                members.push(member);
            }
            None => byte += 4,
        }
    }
    members
}

/// The scalar or vector that holds a byte; `None` in padding, and for scalars that are not whole
/// words.
pub fn member_at(layout: Layout<'_>, byte: u64) -> Option<MemoryPart<'_>> {
    let member = layout.part_at(byte)?;
    let scalar = member.layout.scalar(member.layout.ty);
    let is_whole_words = matches!(
        scalar.module.ty(scalar.ty),
        Type::Int { width: 32 | 64, .. }
            | Type::Float { width: 32 | 64, encoding: None }
            | Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. }
    );
    (is_whole_words && byte < member.end() && member.offset.is_multiple_of(4)).then_some(member)
}
