//! Buffers at device addresses, for shaders that reach them by pointers.

use bytemuck::NoUninit;
use std::fmt;

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::{InputLimit, InputLimits};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::{Buffer, DeviceMemory};

/// Buffers and acceleration structures with device addresses, which are known before the buffers
/// are filled: so that they hold each other's addresses, in circles, too.
///
/// The first address is `0x1_0000_0000`, and each further one is a multiple of 4 GiB: an access
/// past the end of a buffer meets no other one. A [`Scene`](crate::scene::Scene), a
/// [`ShaderTest`](crate::shader_test::ShaderTest) and a
/// [`ComputeTest`](crate::compute_test::ComputeTest) take a copy of the buffers (`device_buffers`),
/// and traps and explanations tell addresses by the buffers' names.
///
/// ```
/// use anyhit::{ComputeTest, DeviceBuffers, Module};
///
/// # fn main() -> anyhit::Result<()> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
/// // It lists five nodes from `first` on, `uint value; uint pad; Node next;`; the next becomes 77.
/// let module = Module::open("tests/scenes/addresses/nodes.spv")?;
/// let mut buffers = DeviceBuffers::new();
/// let first = buffers.reserve("first", 16)?;
/// let second = buffers.add("second", &[4, first])?;
/// buffers.write("first", &[3, second])?;
/// let outcome = ComputeTest::new(&module, "main")?
///     .device_buffers(&buffers)
///     .buffer(0, 0, &[0u32; 6])
///     .push_constants(&[first, 0])
///     .run()?;
/// assert_eq!(outcome.read_buffer::<u32>(0, 0)?, [3, 4, 3, 4, 3, 0]);
/// assert_eq!(outcome.read_buffer_at::<u64>(second)?, [77, first]);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Default)]
#[must_use]
pub struct DeviceBuffers {
    /// Addresses by name.
    memory: DeviceMemory,
    contents: SortedMap<String, Vec<u8>>,
}

/// The names with the sizes in bytes.
impl fmt::Debug for DeviceBuffers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sizes = self.contents.iter().map(|(name, bytes)| (name, bytes.len()));
        f.write_str("DeviceBuffers ")?;
        f.debug_map().entries(sizes).finish()
    }
}

impl DeviceBuffers {
    /// No buffers yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Gives an address to a buffer of zeros of a size in bytes; [`DeviceBuffers::write`] fills it.
    ///
    /// # Errors
    /// `InvalidArgument` where another buffer has the name, and for a size above the limit
    /// [`buffer-bytes`](anyhit_base::input::InputLimit::BufferBytes).
    pub fn reserve(&mut self, name: &str, size: usize) -> Result<u64> {
        if self.contents.contains_key(name) {
            return Err(invalid(format!("two buffers are named `{name}`")));
        }
        InputLimits::default().check(InputLimit::BufferBytes, size as u64, ErrorKind::InvalidArgument)?;
        self.contents.insert(name.to_owned(), vec![0; size]);
        Ok(self.memory.reserve(name, size as u64))
    }

    /// Gives an address to a buffer with these elements, or with the bytes of a
    /// [`StructData`](crate::struct_data::StructData).
    ///
    /// # Errors
    /// As [`DeviceBuffers::reserve`].
    pub fn add<T: NoUninit>(&mut self, name: &str, elements: &[T]) -> Result<u64> {
        let bytes: &[u8] = bytemuck::cast_slice(elements);
        let address = self.reserve(name, bytes.len())?;
        self.write(name, elements)?;
        Ok(address)
    }

    /// Overwrites a buffer from its beginning.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer has the name, or it has fewer bytes.
    pub fn write<T: NoUninit>(&mut self, name: &str, elements: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(elements);
        let content =
            self.contents.get_mut(name).ok_or_else(|| invalid(format!("no buffer is named `{name}`")))?;
        let size = content.len();
        let place = content.get_mut(..bytes.len()).ok_or_else(|| {
            invalid(format!("cannot write {} bytes to `{name}`, which has {size}", bytes.len()))
        })?;
        place.copy_from_slice(bytes);
        Ok(())
    }

    /// The address space, to give further addresses.
    pub(super) fn memory_mut(&mut self) -> &mut DeviceMemory {
        &mut self.memory
    }

    /// The address space, with buffers of its own.
    pub(super) fn memory(&self) -> DeviceMemory {
        self.memory.with_named(|name| self.contents.get(name).map(|bytes| Buffer::new(bytes)))
    }
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}

#[cfg(test)]
mod tests {
    use crate::scene::Scene;
    use std::sync::Arc;

    use super::*;
    use crate::instance::Instance;

    #[test]
    fn addresses_are_known_before_contents() {
        let mut buffers = DeviceBuffers::new();
        let a = buffers.reserve("a", 16).unwrap();
        let scene = Scene::new([Instance::sphere([0.0; 3], 1.0)]).unwrap();
        let structure = buffers.structure(&scene);
        let b = buffers.add("b", &[a, structure]).unwrap();
        assert_eq!([a, structure, b], [0x1_0000_0000, 0x2_0000_0000, 0x3_0000_0000]);
        assert_eq!(buffers.structure(&scene), structure);
        buffers.write("a", &[b]).unwrap();
        let memory = buffers.memory();
        let words = |name| {
            let bytes = memory.named_buffer(name).unwrap().1.bytes();
            [0, 8].map(|at| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()))
        };
        assert_eq!([words("a"), words("b")], [[b, 0], [a, structure]]);
        assert!(memory.structure(structure).is_some_and(|found| Arc::ptr_eq(found, scene.tlas())));
    }

    #[test]
    fn mistakes_name_the_buffer() {
        let mut buffers = DeviceBuffers::new();
        buffers.add("a", &[1u32]).unwrap();
        let message = |error: Error| error.message().to_owned();
        assert_eq!(message(buffers.reserve("a", 4).unwrap_err()), "two buffers are named `a`");
        assert_eq!(message(buffers.write("b", &[1u32]).unwrap_err()), "no buffer is named `b`");
        let error = message(buffers.write("a", &[1u32, 2]).unwrap_err());
        assert_eq!(error, "cannot write 8 bytes to `a`, which has 4");
        let huge = buffers.reserve("b", usize::MAX).unwrap_err();
        assert!(huge.message().contains("`buffer-bytes`"), "{huge}");
    }
}
