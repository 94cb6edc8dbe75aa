//! Through which bindings shaders reach memory, and which accesses to it may race.

use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::plan::ProgramPlan;
use anyhit_engine::machine::{Binding, Bindings, Descriptor, Resources, ShaderIndex};
use anyhit_engine::ops::memory::{BufferRef, Chunk};
use anyhit_engine::ops::shared_access::SharedPart;
use anyhit_engine::program::Program;

/// The numbers of the descriptors that shaders access memory through.
#[derive(Debug)]
pub(super) struct References {
    /// By shader and slot: the binding.
    bindings: Vec<Vec<Binding>>,
    /// By binding and element of its array, from 1 on.
    numbers: FxHashMap<(Binding, u32), u32>,
    /// The last one, by shader and handle.
    last: (ShaderIndex, u32, u32),
}

impl References {
    pub(super) fn new(plans: &[ProgramPlan]) -> Self {
        let bindings = |plan: &ProgramPlan| plan.program.slots.iter().map(|slot| slot.binding).collect();
        Self {
            bindings: plans.iter().map(bindings).collect(),
            numbers: FxHashMap::default(),
            last: (ShaderIndex(u32::MAX), 0, 0),
        }
    }

    /// The number of the descriptor that a handle of a shader names: one for all shaders.
    #[inline]
    pub(super) fn number(&mut self, shader: ShaderIndex, handle: u32) -> u32 {
        let (known_shader, known_handle, number) = self.last;
        if (known_shader, known_handle) == (shader, handle) {
            return number;
        }
        let slot = Bindings::slot_of(handle);
        let binding =
            slot.and_then(|(slot, element)| Some((*self.bindings.get(shader.index())?.get(slot)?, element)));
        let next = self.numbers.len() as u32 + 1;
        let number = binding.map_or(0, |key| *self.numbers.entry(key).or_insert(next));
        self.last = (shader, handle, number);
        number
    }
}

/// The bindings of buffers and images that several bindings have, or that have a device address.
pub(crate) fn overlapping_bindings(resources: &Resources) -> FxHashSet<Binding> {
    let mut by_memory: FxHashMap<usize, Vec<Binding>> = FxHashMap::default();
    for (&binding, elements) in &resources.descriptors {
        for descriptor in elements.iter().flat_map(Descriptor::kinds) {
            let memory = match descriptor {
                Descriptor::Buffer(buffer) if !buffer.is_null() => buffer.memory_id(),
                Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => Arc::as_ptr(image).addr(),
                _ => continue,
            };
            by_memory.entry(memory).or_default().push(binding);
        }
    }
    let shared = by_memory.into_values().filter(|bindings| bindings.len() > 1);
    shared.flatten().collect()
}

/// The memory that the shaders of a pipeline, or of a dispatch, may write.
#[derive(Debug, Default)]
pub(super) struct Written {
    pub bindings: FxHashSet<Binding>,
    /// Whether a buffer is written that is only known while running.
    unknown: bool,
    images: bool,
}

impl Written {
    /// What programs may write.
    pub(super) fn by<'p>(programs: impl Iterator<Item = &'p Program>) -> Self {
        let mut written = Self::default();
        for program in programs {
            for op in &program.ops {
                op.shared_accesses(&mut |used, part| match part {
                    SharedPart::Bytes(chunk) if used.may_write() => written.add(program, chunk),
                    SharedPart::Texel(_) | SharedPart::Texels { .. } => written.images |= used.may_write(),
                    SharedPart::Bytes(_) => {}
                });
            }
        }
        written
    }

    fn add(&mut self, program: &Program, chunk: &Chunk) {
        match chunk.buffer {
            BufferRef::Handle(handle) => self.bindings.extend(binding(program, handle)),
            BufferRef::Computed(_) | BufferRef::Address(_) => self.unknown = true,
            BufferRef::Workgroup | BufferRef::PushConstants | BufferRef::ShaderRecord => {}
        }
    }

    /// By operation of a program, whether it accesses memory that may be written.
    pub(super) fn watched(&self, program: &Program) -> Vec<bool> {
        let chunk = |chunk: &Chunk| match chunk.buffer {
            BufferRef::Workgroup => true,
            BufferRef::PushConstants | BufferRef::ShaderRecord => false,
            BufferRef::Computed(_) | BufferRef::Address(_) => self.unknown || !self.bindings.is_empty(),
            BufferRef::Handle(handle) => {
                self.unknown || binding(program, handle).is_some_and(|one| self.bindings.contains(&one))
            }
        };
        let watched = program.ops.iter().enumerate().map(|(at, op)| {
            // Compilers drop loads whose result is unused.
            let mut is_watched = false;
            if program.silent.get(at) != Some(&true) {
                op.shared_accesses(&mut |used, part| {
                    is_watched |= match part {
                        SharedPart::Bytes(part) => chunk(part),
                        SharedPart::Texel(_) => used.may_write() || self.images,
                        SharedPart::Texels { .. } => false,
                    };
                });
            }
            is_watched
        });
        watched.collect()
    }
}

/// The binding of a descriptor.
fn binding(program: &Program, handle: u32) -> Option<Binding> {
    Some(program.slots.get(Bindings::slot_of(handle)?.0)?.binding)
}
