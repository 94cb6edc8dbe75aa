//! What shaders are given by binding: buffers, images, samplers and push constants, for a scene and
//! for a shader by itself.

use std::sync::{Arc, Mutex, PoisonError};

use bytemuck::NoUninit;

use crate::bound::blocks;
use crate::data::HostBytes;
use crate::device_buffers::DeviceBuffers;
use crate::fit::check_block;
use crate::image_views;
use crate::rust_layout::RustLayout;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::machine::resource::ELEMENT_BITS;
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;
use anyhit_engine::reflect::{Layout, Rules};

/// Resources, and as what Rust types buffers were given.
#[derive(Clone, Debug, Default)]
pub(super) struct Given {
    pub resources: Resources,
    buffers: Vec<(Binding, RustLayout)>,
    push_constants: Option<RustLayout>,
    /// The programs for which all this was compared; others of the same resources share it.
    compared: Arc<Mutex<Vec<Arc<Program>>>>,
    /// Why a buffer cannot lie at its address, or cannot be bound by its name.
    mistake: Option<Error>,
}

impl Given {
    pub(super) fn buffer<T: NoUninit>(&mut self, set: u32, binding: u32, elements: &[T]) {
        self.buffer_of(set, binding, HostBytes::of_slice(elements));
    }

    pub(super) fn buffer_of(&mut self, set: u32, binding: u32, given: HostBytes) {
        self.descriptor(set, binding, Descriptor::Buffer(Buffer::new(&given.bytes)));
        self.buffers.push((Binding { set, binding }, given.rust));
    }

    pub(super) fn buffer_at<T: NoUninit>(&mut self, address: u64, elements: &[T]) {
        let buffer = Buffer::new(bytemuck::cast_slice(elements));
        if let Err(message) = self.resources.memory.add_buffer_at(address, &buffer, None) {
            self.mistaken(message);
        }
    }

    pub(super) fn device_buffers(&mut self, buffers: &DeviceBuffers) {
        if let Err(message) = self.resources.memory.extend(&buffers.memory()) {
            self.mistaken(message);
        }
    }

    pub(super) fn bind_buffer(&mut self, set: u32, binding: u32, name: &str) {
        match self.resources.memory.named_buffer(name) {
            Some((_, buffer)) => self.descriptor(set, binding, Descriptor::Buffer(buffer.clone())),
            None => self.mistaken(format!("no buffer with an address is named `{name}`")),
        }
    }

    /// Keeps the first mistake.
    fn mistaken(&mut self, message: String) {
        self.mistake.get_or_insert(Error::new(ErrorKind::InvalidArgument, message));
    }

    pub(super) fn descriptor(&mut self, set: u32, binding: u32, descriptor: Descriptor) {
        let place = Binding { set, binding };
        self.compared = Arc::default();
        self.buffers.retain(|(known, _)| *known != place);
        self.resources.insert(place, 0, descriptor);
    }

    pub(super) fn heap(&mut self, index: u32, descriptor: Descriptor) {
        if index >> ELEMENT_BITS != 0 {
            return self.mistaken(format!(
                "a heap has at most {} descriptors, and none at index {index}",
                1 << ELEMENT_BITS
            ));
        }
        self.compared = Arc::default();
        let heap = match descriptor {
            Descriptor::Sampler(_) => Binding::SAMPLER_HEAP,
            _ => Binding::RESOURCE_HEAP,
        };
        self.resources.insert(heap, index, descriptor);
    }

    pub(super) fn push_constants(&mut self, given: HostBytes) {
        self.compared = Arc::default();
        self.resources.push_constants = Some(Buffer::new(&given.bytes));
        self.push_constants = Some(given.rust);
    }

    /// Keeps what a run left behind. What shaders have written is no Rust value any more.
    pub(super) fn keep(&mut self, left: Resources) {
        self.resources = left;
        self.compared = Arc::default();
        self.buffers.iter_mut().for_each(|(_, rust)| rust.forget());
    }

    /// Compares what was given with what a shader declares.
    ///
    /// # Errors
    /// `InvalidArgument` with both layouts.
    pub(super) fn check(&self, program: &Arc<Program>) -> Result<()> {
        if let Some(mistake) = &self.mistake {
            return Err(mistake.clone());
        }
        let is_empty = self.buffers.is_empty() && self.push_constants.is_none();
        if is_empty && self.resources.descriptors.is_empty() {
            return Ok(());
        }
        let mut compared = self.compared.lock().unwrap_or_else(PoisonError::into_inner);
        if compared.iter().any(|known| Arc::ptr_eq(known, program)) {
            return Ok(());
        }
        image_views::check(program, &self.resources)?;
        for (ty, class, place) in blocks(program) {
            let layout = Layout::new(&program.module, ty, Rules::Explicit);
            if let Some((Binding { set, binding }, rust)) =
                self.buffers.iter().find(|(known, _)| Some(*known) == place)
            {
                let what = format!("buffer {binding} of set {set}");
                let bytes =
                    || self.resources.buffer(*set, *binding).map_or_else(Vec::new, |found| found.bytes());
                check_block(layout, &what, rust, &bytes)?;
            }
            if let Some(rust) = self.push_constants.as_ref().filter(|_| class == storage::PUSH_CONSTANT) {
                let constants = &self.resources.push_constants;
                let bytes = || constants.as_ref().map_or_else(Vec::new, |found| found.bytes());
                check_block(layout, "the push constants", rust, &bytes)?;
            }
        }
        compared.push(program.clone());
        Ok(())
    }
}

/// The methods of a builder that bind resources.
macro_rules! gives_resources {
    ($builder:ty) => {
        impl $builder {
            /// Binds a storage or uniform buffer with these elements. A size, a stride or a scalar
            /// that is not the shaders' is an error of the run, with both layouts; `u8`s have no
            /// scalars to compare.
            #[must_use]
            pub fn buffer<T: bytemuck::NoUninit>(mut self, set: u32, binding: u32, elements: &[T]) -> Self {
                self.given.buffer(set, binding, elements);
                self
            }

            /// Binds a storage or uniform buffer with these bytes, little-endian, whatever types
            /// the shaders declare. Fewer bytes than they declare are an error of the run.
            #[must_use]
            pub fn buffer_bytes(self, set: u32, binding: u32, bytes: &[u8]) -> Self {
                self.buffer(set, binding, bytes)
            }

            /// Binds a storage or uniform buffer with an array of another language.
            #[doc(hidden)]
            #[must_use]
            pub fn buffer_of(mut self, set: u32, binding: u32, given: crate::data::HostBytes) -> Self {
                self.given.buffer_of(set, binding, given);
                self
            }

            /// Puts a buffer with these elements at a device address, for shaders that reach it by
            /// pointers; it is bound nowhere. The address is a multiple of 16, at least `0x10000`
            /// and lies in no other buffer, which is an error of the run.
            #[must_use]
            pub fn buffer_at<T: bytemuck::NoUninit>(mut self, address: u64, elements: &[T]) -> Self {
                self.given.buffer_at(address, elements);
                self
            }

            /// Puts buffers and acceleration structures at their device addresses, for shaders
            /// that reach them by pointers. An address that something has already is an error of
            /// the run.
            #[must_use]
            pub fn device_buffers(mut self, buffers: &crate::device_buffers::DeviceBuffers) -> Self {
                self.given.device_buffers(buffers);
                self
            }

            /// Binds one of the device buffers, by its name, as a storage or uniform buffer.
            #[must_use]
            pub fn bind_buffer(mut self, set: u32, binding: u32, name: &str) -> Self {
                self.given.bind_buffer(set, binding, name);
                self
            }

            /// Puts a descriptor into the heap of its kind (`SPV_EXT_descriptor_heap`): a sampler
            /// into that of the samplers, any other into that of the resources. The index counts
            /// descriptors of 32 bytes; one of 2^20 or more is an error of the run.
            #[must_use]
            pub fn heap(mut self, index: u32, descriptor: anyhit_engine::machine::Descriptor) -> Self {
                self.given.heap(index, descriptor);
                self
            }

            /// Puts data between the descriptors of the resource heap, from its first byte on.
            #[must_use]
            pub fn heap_data<T: bytemuck::NoUninit>(self, elements: &[T]) -> Self {
                let at = anyhit_engine::machine::Binding::RESOURCE_HEAP.heap_data();
                self.buffer(at.set, at.binding, elements)
            }

            /// Puts a storage or uniform buffer with these elements into the resource heap.
            #[must_use]
            pub fn heap_buffer<T: bytemuck::NoUninit>(self, index: u32, elements: &[T]) -> Self {
                let buffer = anyhit_engine::machine::Buffer::new(bytemuck::cast_slice(elements));
                self.heap(index, anyhit_engine::machine::Descriptor::Buffer(buffer))
            }

            /// Binds a storage or sampled image. A format that contradicts what the shaders declare
            /// is an error of the run, with both.
            #[must_use]
            pub fn image(
                self,
                set: u32,
                binding: u32,
                image: std::sync::Arc<anyhit_engine::machine::image::Image>,
            ) -> Self {
                self.descriptor(set, binding, anyhit_engine::machine::Descriptor::Image(image))
            }

            /// Binds a combined image sampler.
            #[must_use]
            pub fn image_sampler(
                self,
                set: u32,
                binding: u32,
                image: std::sync::Arc<anyhit_engine::machine::image::Image>,
                sampler: anyhit_engine::machine::sampler::Sampler,
            ) -> Self {
                let sampler = std::sync::Arc::new(sampler);
                self.descriptor(
                    set,
                    binding,
                    anyhit_engine::machine::Descriptor::ImageSampler(image, sampler),
                )
            }

            /// Binds any descriptor.
            #[must_use]
            pub fn descriptor(
                mut self,
                set: u32,
                binding: u32,
                descriptor: anyhit_engine::machine::Descriptor,
            ) -> Self {
                self.given.descriptor(set, binding, descriptor);
                self
            }

            /// Sets the push constants. A size or a scalar that is not the shaders' is an error of
            /// the run, with both layouts.
            #[must_use]
            pub fn push_constants<T: bytemuck::NoUninit + std::fmt::Debug>(mut self, constants: &T) -> Self {
                self.given.push_constants(crate::data::HostBytes::of(constants));
                self
            }

            /// Sets the bytes of a bank of push constants beside the first one
            /// (`SPV_NV_push_constant_bank`), from the first byte of the bank on.
            #[must_use]
            pub fn push_constant_bank(self, bank: u32, bytes: &[u8]) -> Self {
                let at = anyhit_engine::machine::Binding::push_constant_bank(bank);
                self.buffer_bytes(at.set, at.binding, bytes)
            }

            /// Sets the push constants to these bytes, little-endian, whatever types the shaders
            /// declare.
            #[must_use]
            pub fn push_constants_bytes(mut self, bytes: &[u8]) -> Self {
                self.given.push_constants(crate::data::HostBytes::raw(bytes));
                self
            }

            /// Sets the push constants to a struct that is written by the names of its members.
            #[must_use]
            pub fn push_constants_data(mut self, data: &crate::struct_data::StructData) -> Self {
                self.given.push_constants(data.given());
                self
            }
        }
    };
}
pub(super) use gives_resources;
