//! Copies of resources, so that a run leaves what it was given as it was.
//!
//! A run copies the memory that its shaders may write, and shares the rest. Nobody writes to memory
//! that an outcome or a scene holds: the next run copies it again, so that both may keep it.

use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use rustc_hash::FxHashSet;

use crate::machine::image::Image;
use crate::machine::{Binding, Buffer, Descriptor, Resources};
use crate::pipeline::{Pipeline, SbtRecord};
use crate::program::Program;
use crate::program::race_analysis::Memory;
#[cfg(feature = "scenes")]
use crate::scene::Assembled;
use crate::sorted::SortedMap;

/// The memory of a buffer and of its views.
type Words = Arc<[AtomicU32]>;

/// The memory that shaders may write, as far as is known before they run.
#[derive(Debug, Default)]
pub(super) struct WrittenMemory {
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
    pub(super) fn of<'a>(
        programs: impl IntoIterator<Item = &'a Arc<Program>>,
        resources: &Resources,
    ) -> Self {
        let mut written = Self::default();
        written.add(programs, resources);
        written
    }

    /// The memory of these resources that passes and rays of a scene may write.
    #[cfg(feature = "scenes")]
    pub(super) fn of_scene(assembled: &Assembled, resources: &Resources) -> Self {
        let mut written = Self::of(assembled.programs(), resources);
        for pass in &assembled.passes {
            written.add(assembled.pass_programs(pass), &assembled.pass_resources(pass, resources));
        }
        written
    }

    /// Adds the memory of these resources that programs may write.
    fn add<'a>(&mut self, programs: impl IntoIterator<Item = &'a Arc<Program>>, resources: &Resources) {
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
    fn reaches_addresses(&self) -> bool {
        self.has_addresses || self.is_everything
    }

    fn contains(&self, place: usize) -> bool {
        self.is_everything || self.places.contains(&place)
    }

    /// Copies resources with this memory, and shares the rest; the copy collects printed lines of
    /// its own. Bindings that shared memory share the copy.
    pub(super) fn copied(&self, resources: &Resources) -> Resources {
        let printed = resources.printed.as_ref().map(|_| Arc::default());
        if !self.is_everything && self.places.is_empty() {
            return Resources { printed, ..resources.clone() };
        }
        let mut images: Vec<(Arc<Image>, Arc<Image>)> = Vec::new();
        let mut image = |image: &Arc<Image>| match self.contains(image_id(image)) {
            true => once(&mut images, image, || image.copied()),
            false => image.clone(),
        };
        let mut memories: Vec<(Words, Words)> = Vec::new();
        let words =
            |words: &[AtomicU32]| words.iter().map(|word| AtomicU32::new(word.load(Relaxed))).collect();
        let mut buffer = |buffer: &Arc<Buffer>| match self.contains(buffer.memory_id()) {
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

/// Copies resources with all of their memory, for runs in which not only shaders write: a debugger
/// sets variables.
pub(super) fn copied(resources: &Resources) -> Resources {
    let written = WrittenMemory { is_everything: true, ..WrittenMemory::default() };
    written.copied(resources)
}

/// A pipeline and resources to run it on: what its shaders may write is copied, the rest shared.
pub(super) fn copied_for_run<'p>(
    pipeline: &'p Pipeline,
    resources: &Resources,
) -> (Cow<'p, Pipeline>, Resources) {
    let written = WrittenMemory::of(&pipeline.programs, resources);
    let has_addresses = || pipeline.programs.iter().any(|program| program.addresses_records);
    let pipeline = match written.reaches_addresses() && has_addresses() {
        true => Cow::Owned(with_own_records(pipeline)),
        false => Cow::Borrowed(pipeline),
    };
    (pipeline, written.copied(resources))
}

/// A pipeline with copies of the shader records that have device addresses.
fn with_own_records(pipeline: &Pipeline) -> Pipeline {
    let mut own = pipeline.clone();
    let mut copies: Vec<(Arc<Buffer>, Arc<Buffer>)> = Vec::new();
    let records = own.sbt.hit.iter_mut().chain(&mut own.sbt.miss).flatten();
    for data in records.filter_map(|record: &mut SbtRecord| record.data.as_mut()) {
        *data = once(&mut copies, &*data, || Buffer::new(&data.bytes()));
    }
    own
}

/// A number that is equal for all descriptors of one image, and for these alone.
fn image_id(image: &Arc<Image>) -> usize {
    Arc::as_ptr(image).addr()
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
    #[cfg(feature = "scenes")]
    use crate::scene::{LoadOptions, SceneFiles, assemble, load};

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

    /// Runs the passes of a scene on a copy of everything, and returns how many buffers and images
    /// no shader can write by the analysis.
    ///
    /// # Panics
    /// Where one of these is not as it was.
    #[cfg(feature = "scenes")]
    fn unwritten(path: &std::path::Path) -> usize {
        let (files, options) = (SceneFiles::default(), LoadOptions::default());
        let Ok(assembled) = load(path, &files, &options).and_then(|scene| assemble(&scene)) else { return 0 };
        if assembled.invocations() > 2048 {
            return 0;
        }
        let resources = copied(&assembled.resources);
        let written = WrittenMemory::of_scene(&assembled, &resources);
        // Some of them trap.
        let _ = assembled.run::<64>(&resources, &|_| ());
        let kinds = |resources: &Resources| {
            let descriptors = resources.descriptors.values().flatten();
            let bound = descriptors.flat_map(|one| one.kinds().to_vec()).collect::<Vec<_>>();
            let addressed = resources.memory.buffers().cloned().map(Descriptor::Buffer);
            bound.into_iter().chain(addressed).collect::<Vec<_>>()
        };
        let mut count = 0;
        for (after, before) in kinds(&resources).iter().zip(kinds(&assembled.resources)) {
            let (place, is_same) = match (after, &before) {
                (Descriptor::Buffer(after), Descriptor::Buffer(before)) => {
                    (after.memory_id(), after.bytes() == before.bytes())
                }
                (
                    Descriptor::Image(after) | Descriptor::ImageSampler(after, _),
                    Descriptor::Image(before) | Descriptor::ImageSampler(before, _),
                ) => (image_id(after), after.is_like(&before.state())),
                _ => continue,
            };
            if !written.contains(place) {
                assert!(is_same, "{}: {before:?} was written", path.display());
                count += 1;
            }
        }
        count
    }

    #[cfg(feature = "scenes")]
    #[test]
    fn memory_that_no_shader_can_write_stays_in_the_cases() {
        let mut folders = vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/pass")];
        let mut count = 0;
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).expect("a folder") {
                let path = entry.expect("an entry").path();
                match path.extension() {
                    _ if path.is_dir() => folders.push(path),
                    Some(extension) if extension == "toml" => count += unwritten(&path),
                    _ => {}
                }
            }
        }
        assert!(count > 40, "only {count} buffers and images are not written");
    }
}
