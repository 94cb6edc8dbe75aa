//! Buffers and images as shaders left them, by binding.

use std::sync::Arc;

use bytemuck::AnyBitPattern;

use crate::texels::Texels;
use crate::typed::{AddressRoots, pointed};
use crate::value::Value;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::{Binding, Descriptor, Resources};
use anyhit_engine::module::ty::TypeId;
use anyhit_engine::program::Program;
use anyhit_engine::program::descriptors::declared_blocks;
use anyhit_engine::reflect::{Layout, Rules};

/// What was bound for some shaders, and so how it is laid out.
#[derive(Clone, Debug)]
pub struct Bound {
    /// The shaders.
    pub programs: Vec<Arc<Program>>,
    /// The resources that they were given, with what they wrote.
    pub resources: Resources,
    /// What holds addresses beside resources and push constants.
    pub roots: AddressRoots,
    /// Of descriptors that are kept at another place than shaders declare: these places, and the
    /// shaders with where they declare them.
    pub readers: SortedMap<Binding, Vec<(Arc<Program>, Binding)>>,
}

impl Bound {
    /// The bytes of a buffer.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer is bound there.
    pub fn buffer_bytes(&self, set: u32, binding: u32) -> Result<Vec<u8>> {
        match self.resources.buffer(set, binding) {
            Some(buffer) => Ok(buffer.bytes()),
            None => Err(invalid(format!("no buffer is bound at set {set}, binding {binding}"))),
        }
    }

    /// The memory at an address as elements of a Rust type.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer lies there.
    pub fn read_buffer_at<T: AnyBitPattern>(&self, address: u64) -> Result<Vec<T>> {
        rows(&bytes_at(&self.resources, address)?)
    }

    /// The memory at an address as the type of a pointer to it.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer lies there, or nothing points to it.
    pub fn buffer_at(&self, address: u64) -> Result<Value> {
        bytes_at(&self.resources, address)?;
        let programs: Vec<_> = self.programs.iter().map(|program| &**program).collect();
        pointed(&programs, &self.resources, &self.roots, address).ok_or_else(|| {
            invalid(format!("no pointer refers to address {address:#x}"))
                .note("read the memory there with `read_buffer_at`")
        })
    }

    /// A buffer as the type that a shader declares.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer is bound there, or no shader declares it.
    pub fn buffer(&self, set: u32, binding: u32) -> Result<Value> {
        let bytes = self.buffer_bytes(set, binding)?;
        let kept = Binding { set, binding };
        let read = |program: &Arc<Program>, at: Binding| {
            let block = blocks(program).find(|block| block.2 == Some(at));
            block.map(|(ty, ..)| Layout::new(&program.module, ty, Rules::Explicit).read(&bytes))
        };
        let block = match self.readers.get(&kept) {
            Some(readers) => readers.iter().find_map(|(program, at)| read(program, *at)),
            None => self.programs.iter().find_map(|program| read(program, kept)),
        };
        block.ok_or_else(|| {
            invalid(format!("no shader uses a buffer at set {set}, binding {binding}"))
                .note("read its bytes with `buffer_bytes`")
        })
    }

    pub(super) fn read_buffer<T: AnyBitPattern>(&self, set: u32, binding: u32) -> Result<Vec<T>> {
        rows(&self.buffer_bytes(set, binding)?)
    }

    /// The texels of an image.
    ///
    /// # Errors
    /// `InvalidArgument` where no image is bound there.
    pub fn image(&self, set: u32, binding: u32) -> Result<Texels> {
        texels(&self.resources, set, binding)
    }

    /// The first descriptor of a binding.
    ///
    /// # Errors
    /// `InvalidArgument` where nothing is bound there.
    pub fn descriptor(&self, set: u32, binding: u32) -> Result<Descriptor> {
        let found = self.resources.descriptors.get(&Binding { set, binding });
        found
            .and_then(|elements| elements.first())
            .cloned()
            .ok_or_else(|| invalid(format!("nothing is bound at set {set}, binding {binding}")))
    }

    /// A descriptor of the resource heap.
    ///
    /// # Errors
    /// `InvalidArgument` where the heap has none at the index.
    pub fn heap(&self, index: u32) -> Result<Descriptor> {
        let heap = self.resources.descriptors.get(&Binding::RESOURCE_HEAP);
        let found = heap.and_then(|elements| elements.get(index as usize));
        found
            .filter(|found| !matches!(found, Descriptor::Unbound))
            .cloned()
            .ok_or_else(|| invalid(format!("nothing is at index {index} of the resource heap")))
    }

    pub(super) fn read_heap_buffer<T: AnyBitPattern>(&self, index: u32) -> Result<Vec<T>> {
        match self.heap(index)? {
            Descriptor::Buffer(buffer) => rows(&buffer.bytes()),
            _ => Err(invalid(format!("no buffer is at index {index} of the resource heap"))),
        }
    }

    /// The buffer with a name, which is bound nowhere.
    pub fn named_descriptor(&self, name: &str) -> Result<Descriptor> {
        let found = self.resources.memory.named_buffer(name);
        found
            .map(|(_, buffer)| Descriptor::Buffer(buffer.clone()))
            .ok_or_else(|| invalid(format!("no buffer with an address is named `{name}`")))
    }
}

/// The methods of an outcome that read what its shaders had bound.
macro_rules! reads_what_is_bound {
    ($outcome:ty) => {
        impl $outcome {
            /// A buffer by the names of its members: `outcome.buffer(0, 1)?["outputs"][2].vec4()`.
            ///
            /// # Errors
            /// `InvalidArgument` where no buffer is bound there, or no shader uses it.
            pub fn buffer(&self, set: u32, binding: u32) -> Result<crate::value::Value> {
                self.bound.buffer(set, binding)
            }

            /// A buffer as a row of a plain Rust type.
            ///
            /// # Errors
            /// `InvalidArgument` where no buffer is bound there, or its size is no multiple.
            pub fn read_buffer<T: bytemuck::AnyBitPattern>(&self, set: u32, binding: u32) -> Result<Vec<T>> {
                self.bound.read_buffer(set, binding)
            }

            /// The bytes of a buffer.
            ///
            /// # Errors
            /// `InvalidArgument` where no buffer is bound there.
            pub fn buffer_bytes(&self, set: u32, binding: u32) -> Result<Vec<u8>> {
                self.bound.buffer_bytes(set, binding)
            }

            /// The buffer at a device address as a row of a plain Rust type, from that address on.
            ///
            /// # Errors
            /// `InvalidArgument` where no buffer lies there, or its size is no multiple.
            pub fn read_buffer_at<T: bytemuck::AnyBitPattern>(&self, address: u64) -> Result<Vec<T>> {
                self.bound.read_buffer_at(address)
            }

            /// What lies at a device address by the names of its members, as the type of the first
            /// pointer that leads there: a list where the buffer holds several.
            ///
            /// # Errors
            /// `InvalidArgument` where no buffer lies there, or no pointer leads there from push
            /// constants, shader records and what is bound.
            pub fn buffer_at(&self, address: u64) -> Result<crate::value::Value> {
                self.bound.buffer_at(address)
            }

            /// The texels of an image.
            ///
            /// # Errors
            /// `InvalidArgument` where no image is bound there.
            pub fn image(&self, set: u32, binding: u32) -> Result<crate::texels::Texels> {
                self.bound.image(set, binding)
            }

            /// The first descriptor of a binding, with what shaders wrote, to bind it elsewhere:
            /// `test.descriptor(0, 2, outcome.descriptor(0, 1)?)`. No run changes it.
            ///
            /// # Errors
            /// `InvalidArgument` where nothing is bound there.
            pub fn descriptor(&self, set: u32, binding: u32) -> Result<anyhit_engine::machine::Descriptor> {
                self.bound.descriptor(set, binding)
            }

            /// A descriptor of the resource heap, with what shaders wrote.
            ///
            /// # Errors
            /// `InvalidArgument` where the heap has none at the index.
            pub fn heap(&self, index: u32) -> Result<anyhit_engine::machine::Descriptor> {
                self.bound.heap(index)
            }

            /// A buffer of the resource heap as elements of a Rust type.
            ///
            /// # Errors
            /// `InvalidArgument` where the heap has no buffer at the index, or its size is no
            /// multiple of an element.
            pub fn read_heap_buffer<T: bytemuck::AnyBitPattern>(&self, index: u32) -> Result<Vec<T>> {
                self.bound.read_heap_buffer(index)
            }
        }
    };
}
pub(super) use reads_what_is_bound;

/// The content of the buffer at a device address, from that address on.
pub(super) fn bytes_at(resources: &Resources, address: u64) -> Result<Vec<u8>> {
    let found = resources.memory.buffer(address);
    let (buffer, offset) = found
        .filter(|(buffer, offset)| *offset <= buffer.size())
        .ok_or_else(|| invalid(format!("no buffer contains address {address:#x}")))?;
    Ok(buffer.bytes().split_off(offset as usize))
}

pub(super) fn texels(resources: &Resources, set: u32, binding: u32) -> Result<Texels> {
    let image = resources.image(set, binding).cloned();
    let image = image.ok_or_else(|| invalid(format!("no image is bound at set {set}, binding {binding}")))?;
    image.read()?;
    Ok(Texels::new(image))
}

/// Bytes as a row of a plain Rust type.
pub fn rows<T: AnyBitPattern>(bytes: &[u8]) -> Result<Vec<T>> {
    let size = size_of::<T>();
    if size == 0 || !bytes.len().is_multiple_of(size) {
        let name = std::any::type_name::<T>();
        let message = format!(
            "the size of the buffer, {} bytes, is not a multiple of the size of `{name}`, {size}",
            bytes.len()
        );
        return Err(invalid(message));
    }
    Ok(bytes.chunks_exact(size).map(bytemuck::pod_read_unaligned).collect())
}

/// The blocks of a program's module: type, storage class and binding.
pub fn blocks(program: &Program) -> impl Iterator<Item = (TypeId, u32, Option<Binding>)> + '_ {
    declared_blocks(program)
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
