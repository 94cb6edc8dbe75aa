//! The content of buffers by the types that shaders declare.

use crate::harness::layout::{Layout, Rules};
use crate::harness::value::Value;
use crate::machine::Binding;
use crate::module::ty::{Type, TypeId};
use crate::ops::pointer::storage;
use crate::program::Program;
use crate::scene::Assembled;

/// A buffer's content by the type of the first shader that uses it; `None` where no shader declares
/// it.
pub fn typed(assembled: &Assembled, binding: Binding, bytes: &[u8]) -> Option<Value> {
    programs(assembled).find_map(|program| {
        let of_binding = |one: &(u32, Option<Binding>, Option<TypeId>)| one.1 == Some(binding);
        let (.., ty) = bound(program).into_iter().find(of_binding)?;
        let mut ty = ty?;
        while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = program.module.ty(ty) {
            ty = *element;
        }
        let block = matches!(program.module.ty(ty), Type::Struct { .. });
        block.then(|| Layout::new(&program.module, ty, Rules::Explicit).read(bytes))
    })
}

/// The shaders of a scene.
pub fn programs(assembled: &Assembled) -> impl Iterator<Item = &Program> {
    let dispatched = assembled.dispatches.iter().map(|dispatch| &*dispatch.compute.program);
    assembled.pipeline.programs.iter().map(|program| &**program).chain(dispatched)
}

/// Storage class, binding and type of what a program's interface binds.
pub fn bound(program: &Program) -> Vec<(u32, Option<Binding>, Option<TypeId>)> {
    let module = &*program.module;
    let entry =
        module.entry_points.iter().find(|entry| entry.stage == program.stage && entry.name == program.name);
    let variables = entry.map_or_else(Vec::new, |entry| module.interface_of(entry));
    let bound = variables.into_iter().map(|variable| {
        let numbers = variable.descriptor_set.zip(variable.binding);
        let ty = variable.ty;
        let legacy = ty.is_some_and(|ty| matches!(module.ty(ty), Type::Struct { buffer_block: true, .. }));
        let class = if legacy { storage::STORAGE_BUFFER } else { variable.storage_class };
        (class, numbers.map(|(set, binding)| Binding { set, binding }), ty)
    });
    bound.collect()
}
