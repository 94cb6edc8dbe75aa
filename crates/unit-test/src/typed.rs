//! The content of buffers by the types that shaders declare.

use std::collections::{HashSet, VecDeque};
use std::sync::Arc;

use crate::value::Value;
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::{Pipeline, Sbt};
use anyhit_engine::program::Program;
use anyhit_engine::reflect::{FromParts, Layout, Rules};

/// The most elements of a buffer in which further pointers are searched.
const ELEMENTS: usize = 64;

/// What holds the first addresses: blocks of a storage class with their content.
pub type AddressRoots = Vec<(u32, Arc<Buffer>)>;

/// The shader records of a pipeline.
pub fn record_roots(pipeline: &Pipeline) -> AddressRoots {
    let Sbt { ray_generation, miss, hit, callable } = &pipeline.sbt;
    let records = ray_generation.iter().chain([miss, hit, callable].into_iter().flatten().flatten());
    records.filter_map(|record| Some((storage::SHADER_RECORD_BUFFER, record.data.clone()?))).collect()
}

/// The elements that a device pointer leads to.
#[derive(Clone, Copy, Debug)]
pub struct Pointees<'a> {
    /// The layout of an element.
    pub layout: Layout<'a>,
    stride: usize,
    count: usize,
}

impl Pointees<'_> {
    /// The bytes from one element to the next, where there are several.
    pub fn stride(&self) -> Option<usize> {
        (self.count != 1).then_some(self.stride)
    }

    fn read(&self, bytes: &[u8]) -> Value {
        let Self { layout, stride, count } = *self;
        if count == 1 {
            return layout.read(bytes);
        }
        let elements = (0..count).map(|index| layout.read(&bytes[index * stride..])).collect();
        Value::list(layout, bytes, elements)
    }
}

/// The content of a buffer at a device address by the type of the first pointer to its beginning:
/// in what shaders bind, their push constants, other roots, and the buffers to which pointers there
/// lead. `None` where no pointer leads to it.
pub fn pointed(
    programs: &[&Program],
    resources: &Resources,
    roots: &[(u32, Arc<Buffer>)],
    address: u64,
) -> Option<Value> {
    let pointees = pointees(programs, resources, roots, address)?;
    let (buffer, offset) = resources.memory.buffer(address)?;
    Some(pointees.read(&buffer.bytes().split_off(offset as usize)))
}

/// The elements at a device address, as [`pointed`] finds them.
pub fn pointees<'a>(
    programs: &[&'a Program],
    resources: &Resources,
    roots: &[(u32, Arc<Buffer>)],
    address: u64,
) -> Option<Pointees<'a>> {
    let mut seen: HashSet<(u64, usize, TypeId)> = HashSet::new();
    let mut open: VecDeque<(usize, TypeId, Vec<u8>)> = VecDeque::new();
    for (at, program) in programs.iter().enumerate() {
        for (class, binding, ty) in bound(program) {
            let Some(ty) = ty else { continue };
            let mut buffers: Vec<Arc<Buffer>> = Vec::new();
            if class == storage::PUSH_CONSTANT {
                buffers.extend(resources.push_constants.clone());
            }
            buffers.extend(roots.iter().filter(|root| root.0 == class).map(|root| root.1.clone()));
            let descriptors = binding.and_then(|binding| resources.descriptors.get(&binding));
            buffers.extend(descriptors.into_iter().flatten().filter_map(|descriptor| match descriptor {
                Descriptor::Buffer(buffer) => Some(buffer.clone()),
                _ => None,
            }));
            let block = block(&program.module, ty);
            if !Layout::new(&program.module, block, Rules::Explicit).has_addresses() {
                continue;
            }
            open.extend(buffers.iter().map(|buffer| (at, block, buffer.bytes())));
        }
    }
    while let Some((at, ty, bytes)) = open.pop_front() {
        let layout = Layout::new(&programs[at].module, ty, Rules::Explicit);
        for (target, pointee, stride) in layout.addresses(&bytes) {
            let Some((buffer, offset)) = resources.memory.buffer(target) else { continue };
            if offset >= buffer.size() || !seen.insert((target, at, pointee)) {
                continue;
            }
            let left = (buffer.size() - offset) as usize;
            let layout = Layout::new(&programs[at].module, pointee, Rules::Explicit);
            // A pointer to one element leads to as many as the buffer holds.
            let stride = stride.unwrap_or(layout.size()).max(1);
            let count = if layout.runtime_stride().is_some() { 1 } else { (left / stride).max(1) };
            if target == address {
                return Some(Pointees { layout, stride, count });
            }
            if !layout.has_addresses() {
                continue;
            }
            let bytes = buffer.bytes().split_off(offset as usize);
            open.extend(
                (0..count.min(ELEMENTS)).map(|at_index| {
                    (at, pointee, bytes.get(at_index * stride..).unwrap_or_default().to_vec())
                }),
            );
        }
    }
    None
}

/// The type of the elements of an array of descriptors.
pub fn block(module: &Module, mut ty: TypeId) -> TypeId {
    while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = module.ty(ty) {
        ty = *element;
    }
    ty
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
