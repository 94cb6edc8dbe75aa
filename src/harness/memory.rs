//! Copies of resources, so that one scene can be run again and again.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use crate::machine::image::Image;
use crate::machine::{Buffer, Descriptor, Resources};
use crate::sorted::SortedMap;

/// The memory of a buffer and of its views.
type Words = Arc<[AtomicU32]>;

/// Copies resources with their memory. Bindings that shared memory share the copy.
pub(super) fn copied(resources: &Resources) -> Resources {
    let mut images: Vec<(Arc<Image>, Arc<Image>)> = Vec::new();
    let mut image = |image: &Arc<Image>| once(&mut images, image, || image.copied());
    let mut memories: Vec<(Words, Words)> = Vec::new();
    let words = |words: &[AtomicU32]| words.iter().map(|word| AtomicU32::new(word.load(Relaxed))).collect();
    let mut buffer =
        |buffer: &Arc<Buffer>| buffer.copied(|memory| once(&mut memories, memory, || words(memory)));
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
    let memory = resources.memory.with_buffers(buffer);
    let printed = resources.printed.as_ref().map(|_| Arc::default());
    Resources { descriptors, memory, printed, ..resources.clone() }
}

/// The copy of an original, made at its first appearance.
fn once<T: ?Sized>(
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
    use crate::machine::Binding;

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
        let copy = copied(&original);
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
