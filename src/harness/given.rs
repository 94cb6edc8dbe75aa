//! What shaders are given by binding: buffers, images, samplers and push constants, for a scene and
//! for a shader by itself.

use std::fmt::Debug;

use bytemuck::NoUninit;

use crate::error::{Error, ErrorKind, Result};
use crate::harness::bound::blocks;
use crate::harness::data::Bytes;
use crate::harness::device_buffers::DeviceBuffers;
use crate::harness::layout::{Layout, Rules};
use crate::harness::rust_layout::RustLayout;
use crate::harness::struct_data::StructData;
use crate::machine::{Binding, Buffer, Descriptor, Resources};
use crate::ops::pointer::storage;
use crate::program::Program;

/// Resources, and as what Rust types buffers were given.
#[derive(Clone, Debug, Default)]
pub(super) struct Given {
    pub resources: Resources,
    buffers: Vec<(Binding, RustLayout)>,
    push_constants: Option<RustLayout>,
    /// Why a buffer cannot lie at its address, or cannot be bound by its name.
    mistake: Option<Error>,
}

impl Given {
    pub(super) fn buffer<T: NoUninit>(&mut self, set: u32, binding: u32, elements: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(elements);
        self.descriptor(set, binding, Descriptor::Buffer(Buffer::new(bytes)));
        self.buffers.push((Binding { set, binding }, RustLayout::opaque::<[T]>(bytes.len())));
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
        self.buffers.retain(|(known, _)| *known != place);
        self.resources.insert(place, 0, descriptor);
    }

    pub(super) fn push_constants<T: NoUninit + Debug>(&mut self, constants: &T) {
        let given = Bytes::of(constants);
        self.resources.push_constants = Some(Buffer::new(&given.bytes));
        self.push_constants = Some(given.rust);
    }

    pub(super) fn push_constants_data(&mut self, data: &StructData) {
        let given = data.given();
        self.resources.push_constants = Some(Buffer::new(&given.bytes));
        self.push_constants = Some(given.rust);
    }

    /// Compares what was given with what a shader declares.
    ///
    /// # Errors
    /// `InvalidArgument` with both layouts.
    pub(super) fn check(&self, program: &Program) -> Result<()> {
        if let Some(mistake) = &self.mistake {
            return Err(mistake.clone());
        }
        if self.buffers.is_empty() && self.push_constants.is_none() {
            return Ok(());
        }
        for (ty, class, place) in blocks(program) {
            let layout = || Layout::new(&program.module, ty, Rules::Explicit);
            if let Some((Binding { set, binding }, rust)) =
                self.buffers.iter().find(|(known, _)| Some(*known) == place)
            {
                misfit(&layout(), &format!("buffer {binding} of set {set}"), rust)?;
            }
            if let Some(rust) = self.push_constants.as_ref().filter(|_| class == storage::PUSH_CONSTANT) {
                let layout = layout();
                misfit(&layout, "the push constants", rust)?;
                if rust.contradicts(layout) {
                    return Err(layout.mismatch("the push constants", rust));
                }
            }
        }
        Ok(())
    }
}

/// Why bytes cannot be the content of a block.
pub(super) fn misfit(layout: &Layout<'_>, what: &str, rust: &RustLayout) -> Result<(), Error> {
    let fits = match layout.runtime_stride() {
        Some((offset, stride)) => rust.size >= offset && (rust.size - offset).is_multiple_of(stride.max(1)),
        None => rust.size >= layout.size(),
    };
    if fits { Ok(()) } else { Err(layout.mismatch(what, rust)) }
}

/// The methods of a builder that bind resources.
macro_rules! gives_resources {
    ($builder:ty) => {
        impl $builder {
            /// Binds a storage or uniform buffer with these elements. A size that is not the
            /// shaders' is an error of the run, with both layouts.
            #[must_use]
            pub fn buffer<T: bytemuck::NoUninit>(mut self, set: u32, binding: u32, elements: &[T]) -> Self {
                self.given.buffer(set, binding, elements);
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
            pub fn device_buffers(mut self, buffers: &crate::harness::device_buffers::DeviceBuffers) -> Self {
                self.given.device_buffers(buffers);
                self
            }

            /// Binds one of the device buffers, by its name, as a storage or uniform buffer.
            #[must_use]
            pub fn bind_buffer(mut self, set: u32, binding: u32, name: &str) -> Self {
                self.given.bind_buffer(set, binding, name);
                self
            }

            /// Binds a storage or sampled image.
            #[must_use]
            pub fn image(
                self,
                set: u32,
                binding: u32,
                image: std::sync::Arc<crate::machine::image::Image>,
            ) -> Self {
                self.descriptor(set, binding, crate::machine::Descriptor::Image(image))
            }

            /// Binds a combined image sampler.
            #[must_use]
            pub fn image_sampler(
                self,
                set: u32,
                binding: u32,
                image: std::sync::Arc<crate::machine::image::Image>,
                sampler: crate::machine::sampler::Sampler,
            ) -> Self {
                let sampler = std::sync::Arc::new(sampler);
                self.descriptor(set, binding, crate::machine::Descriptor::ImageSampler(image, sampler))
            }

            /// Binds any descriptor.
            #[must_use]
            pub fn descriptor(
                mut self,
                set: u32,
                binding: u32,
                descriptor: crate::machine::Descriptor,
            ) -> Self {
                self.given.descriptor(set, binding, descriptor);
                self
            }

            /// Sets the push constants.
            #[must_use]
            pub fn push_constants<T: bytemuck::NoUninit + std::fmt::Debug>(mut self, constants: &T) -> Self {
                self.given.push_constants(constants);
                self
            }

            /// Sets the push constants to a struct that is written by the names of its members.
            #[must_use]
            pub fn push_constants_data(mut self, data: &crate::harness::struct_data::StructData) -> Self {
                self.given.push_constants_data(data);
                self
            }
        }
    };
}
pub(super) use gives_resources;
