//! The memory that shaders may write, and copies of resources that share the rest.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use rustc_hash::FxHashSet;

use crate::machine::buffer::Words;
use crate::machine::image::Image;
use crate::machine::{Binding, Buffer, Descriptor, Resources};
use crate::program::Program;
use crate::program::race_analysis::Memory;
use anyhit_base::sorted::SortedMap;

/// The memory that shaders may write, as far as is known before they run.
#[derive(Debug, Default)]
pub struct WrittenMemory {
    /// True where a shader stores through a descriptor that is computed in a way that is not
    /// followed: then everything may be written.
    is_everything: bool,
    /// True where a shader stores to device addresses.
    has_addresses: bool,
    /// The memory of buffers ([`Buffer::memory_id`]) and images, by address.
    places: FxHashSet<usize>,
}

impl WrittenMemory {
    /// The memory of these resources that programs may write.
    pub fn of<'a>(programs: impl IntoIterator<Item = &'a Arc<Program>>, resources: &Resources) -> Self {
        let mut written = Self::default();
        written.add(programs, resources);
        written
    }

    /// Adds the memory of these resources that programs may write.
    pub fn add<'a>(&mut self, programs: impl IntoIterator<Item = &'a Arc<Program>>, resources: &Resources) {
        for access in programs.into_iter().flat_map(|program| &program.accesses) {
            match access.memory {
                _ if !access.stores => {}
                Memory::Binding(binding) => self.add_binding(binding, resources),
                Memory::Addresses if !self.has_addresses => {
                    self.has_addresses = true;
                    self.places.extend(resources.memory.buffers().map(|buffer| buffer.memory_id()));
                }
                Memory::Addresses => {}
                Memory::Unknown => self.is_everything = true,
            }
        }
    }

    fn add_binding(&mut self, binding: Binding, resources: &Resources) {
        let descriptors = resources.descriptors.get(&binding).into_iter().flatten();
        for kind in descriptors.flat_map(Descriptor::kinds) {
            let place = match kind {
                Descriptor::Buffer(buffer) => buffer.memory_id(),
                Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => image_id(image),
                _ => continue,
            };
            self.places.insert(place);
        }
    }

    /// Returns whether shaders may store to device addresses.
    pub fn reaches_addresses(&self) -> bool {
        self.has_addresses || self.is_everything
    }

    /// All memory, for runs in which not only shaders write: a debugger sets variables.
    pub fn everything() -> Self {
        Self { is_everything: true, ..Self::default() }
    }

    /// Returns whether a buffer may be written.
    pub fn contains_buffer(&self, buffer: &Buffer) -> bool {
        self.contains_place(buffer.memory_id())
    }

    /// Returns whether an image may be written.
    pub fn contains_image(&self, image: &Arc<Image>) -> bool {
        self.contains_place(image_id(image))
    }

    fn contains_place(&self, place: usize) -> bool {
        self.is_everything || self.places.contains(&place)
    }

    /// Resources of which this memory is copied; they collect printed lines of their own.
    pub fn own(&self, resources: Resources) -> Resources {
        if self.is_everything || !self.places.is_empty() {
            return self.copied(&resources);
        }
        Resources { printed: resources.printed.as_ref().map(|_| Arc::default()), ..resources }
    }

    /// Copies resources with this memory, and shares the rest; the copy collects printed lines of
    /// its own. Bindings that shared memory share the copy.
    pub fn copied(&self, resources: &Resources) -> Resources {
        let printed = resources.printed.as_ref().map(|_| Arc::default());
        if !self.is_everything && self.places.is_empty() {
            return Resources { printed, ..resources.clone() };
        }
        let mut images: Vec<(Arc<Image>, Arc<Image>)> = Vec::new();
        let mut image = |image: &Arc<Image>| match self.contains_image(image) {
            true => once(&mut images, image, || image.copied()),
            false => image.clone(),
        };
        let mut memories: Vec<(Words, Words)> = Vec::new();
        let words = |words: &Words| -> Words {
            Arc::new(words.iter().map(|word| AtomicU32::new(word.load(Relaxed))).collect())
        };
        let mut buffer = |buffer: &Arc<Buffer>| match self.contains_buffer(buffer) {
            true => buffer.copied(|memory| once(&mut memories, memory, || words(memory))),
            false => buffer.clone(),
        };
        let mut descriptors = SortedMap::new();
        for (&binding, list) in &resources.descriptors {
            let mut copy = |descriptor: &Descriptor| match descriptor {
                Descriptor::Buffer(original) => Descriptor::Buffer(buffer(original)),
                Descriptor::Image(original) => Descriptor::Image(image(original)),
                Descriptor::ImageSampler(original, sampler) => {
                    Descriptor::ImageSampler(image(original), sampler.clone())
                }
                other => other.clone(),
            };
            let copies = list.iter().map(|descriptor| match descriptor {
                Descriptor::Mutable(kinds) => Descriptor::Mutable(kinds.iter().map(&mut copy).collect()),
                other => copy(other),
            });
            descriptors.insert(binding, copies.collect());
        }
        let memory = resources.memory.with_buffers(&mut buffer);
        let indirect = resources.indirect.as_ref().map(buffer);
        Resources { descriptors, memory, indirect, printed, ..resources.clone() }
    }
}

/// A number that is equal for all descriptors of one image, and for these alone.
fn image_id(image: &Arc<Image>) -> usize {
    Arc::as_ptr(image).addr()
}

/// The copy of an original, made at its first appearance.
pub fn once<T: ?Sized>(
    copies: &mut Vec<(Arc<T>, Arc<T>)>,
    original: &Arc<T>,
    copy: impl FnOnce() -> Arc<T>,
) -> Arc<T> {
    if let Some((_, known)) = copies.iter().find(|(known, _)| Arc::ptr_eq(known, original)) {
        return known.clone();
    }
    let copy = copy();
    copies.push((original.clone(), copy.clone()));
    copy
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_of_one_buffer_are_views_of_one_copy() {
        let arena = Buffer::new(&[1, 2, 3, 4, 5, 6, 7, 8]);
        let view = arena.view(4, 4, "arena").unwrap();
        let mutable = Descriptor::Mutable([Descriptor::Buffer(arena.view(0, 4, "arena").unwrap())].into());
        let mut original = Resources::default()
            .bind(0, 0, Descriptor::Buffer(arena.clone()))
            .bind(0, 1, Descriptor::Buffer(view))
            .bind(0, 2, mutable);
        let address = original.memory.add_buffer(&arena);
        let copy = WrittenMemory::everything().copied(&original);
        copy.buffer(0, 1).unwrap().store(0, 32, 0).unwrap();
        assert_eq!(copy.buffer(0, 0).unwrap().bytes(), [1, 2, 3, 4, 0, 0, 0, 0]);
        assert_eq!(arena.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(copy.memory.address_of(copy.buffer(0, 1).unwrap()), Some(address + 4));
        let Descriptor::Mutable(kinds) = &copy.descriptors[&Binding { set: 0, binding: 2 }][0] else {
            panic!()
        };
        let Descriptor::Buffer(part) = &kinds[0] else { panic!() };
        assert_eq!(part.memory_id(), copy.buffer(0, 0).unwrap().memory_id());
    }
}
