//! The content of a scene's buffers by the types that its shaders declare.

use anyhit_engine::machine::Binding;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;
use anyhit_engine::reflect::lookup::{DataBlock, find_block};
use anyhit_engine::reflect::{Layout, Rules};
use anyhit_scene::Assembled;
use anyhit_scene::pass::Pass;
use anyhit_unit_test::typed::{AddressRoots, Pointees, block, bound, pointees, record_roots};
use anyhit_unit_test::value::Value;

/// The content of a buffer, by where its descriptor is kept and the type of the first shader that
/// uses it; `None` where no shader declares it.
pub fn typed(assembled: &Assembled, kept: Binding, element: u32, bytes: &[u8]) -> Option<Value> {
    declared(assembled, kept, element).map(|layout| layout.read(bytes))
}

/// The layout of a buffer, as [`typed`] finds it.
pub(super) fn declared(assembled: &Assembled, kept: Binding, element: u32) -> Option<Layout<'_>> {
    if kept.is_heap() {
        let block = DataBlock::of_buffer(kept, element);
        return programs(assembled).find_map(|program| find_block(&program.module, block).ok().flatten());
    }
    assembled.readers_of(kept).into_iter().find_map(|(program, at)| {
        let of_binding = |one: &(u32, Option<Binding>, Option<TypeId>)| one.1 == Some(at);
        let (.., ty) = bound(program).into_iter().find(of_binding)?;
        let ty = block(&program.module, ty?);
        let is_block = matches!(program.module.ty(ty), Type::Struct { .. });
        is_block.then(|| Layout::new(&program.module, ty, Rules::Explicit))
    })
}

/// The elements of a buffer that is bound nowhere, by its name and the type of the first pointer to
/// it.
pub(super) fn unbound_elements<'a>(assembled: &'a Assembled, name: &str) -> Option<Pointees<'a>> {
    let (address, _) = assembled.resources.memory.named_buffer(name)?;
    let programs: Vec<_> = programs(assembled).collect();
    pointees(&programs, &assembled.resources, &roots(assembled), address)
}

/// The push constants and shader records of a scene.
pub fn roots(assembled: &Assembled) -> AddressRoots {
    let own = assembled.dispatches.iter().filter_map(|one| one.push_constants.clone());
    let launches = assembled.passes.iter().filter_map(Pass::launch);
    let own = own.chain(launches.filter_map(|launch| launch.push_constants.clone()));
    let pipelines = std::iter::once(&assembled.pipeline).chain(&assembled.pipelines);
    let mut roots: AddressRoots = pipelines.flat_map(record_roots).collect();
    roots.extend(own.map(|buffer| (storage::PUSH_CONSTANT, buffer)));
    roots
}

/// The shaders of a scene.
pub fn programs(assembled: &Assembled) -> impl Iterator<Item = &Program> {
    assembled.programs().map(|program| &**program)
}
