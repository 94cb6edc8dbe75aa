//! Copies of the memory that shaders can change, to go back in time.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use anyhit_engine::machine::image::{Image, ImageState};
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::WrittenMemory;
use anyhit_engine::program::Program;

/// The buffers and images that an invocation can change.
#[derive(Clone, Debug, Default)]
pub struct ChangingMemory {
    buffers: Vec<Arc<Buffer>>,
    images: Vec<Arc<Image>>,
}

/// What they held at one time. Those that have not changed since the copy before are shared with
/// it.
#[derive(Clone, Debug, Default)]
pub struct MemoryState {
    buffers: Vec<Arc<[u32]>>,
    images: Vec<Arc<ImageState>>,
}

impl ChangingMemory {
    /// The memory that shaders can store to, device addresses included; nothing where none of them
    /// stores.
    pub fn of(programs: &[Arc<Program>], resources: &Resources) -> Self {
        if !programs.iter().any(|program| program.accesses.iter().any(|access| access.stores)) {
            return Self::default();
        }
        let mut all = Self::of_written(&WrittenMemory::everything(), resources);
        resources.memory.named_buffers().for_each(|(_, buffer)| all.add(buffer));
        all
    }

    /// The bound memory that is written.
    pub fn of_written(written: &WrittenMemory, resources: &Resources) -> Self {
        let mut all = Self::default();
        for descriptor in resources.descriptors.values().flatten().flat_map(Descriptor::kinds) {
            match descriptor {
                Descriptor::Buffer(buffer) if written.contains_buffer(buffer) => all.add(buffer),
                Descriptor::Image(image)
                    if written.contains_image(image)
                        && !all.images.iter().any(|known| Arc::ptr_eq(known, image)) =>
                {
                    all.images.push(image.clone());
                }
                _ => {}
            }
        }
        all
    }

    /// Adds a buffer; of several views of one memory, each that is another part of it.
    fn add(&mut self, buffer: &Arc<Buffer>) {
        if !buffer.is_null() && !self.buffers.iter().any(|other| other.is_same(buffer)) {
            self.buffers.push(buffer.clone());
        }
    }

    /// A copy of what is there now.
    pub fn state(&self, before: Option<&MemoryState>) -> MemoryState {
        let buffers = self.buffers.iter().enumerate().map(|(at, buffer)| {
            let now = || buffer.words().iter().map(|word| word.load(Relaxed));
            shared_copy(now, before.and_then(|before| before.buffers.get(at)))
        });
        let images = self.images.iter().enumerate().map(|(at, image)| {
            let same = before.and_then(|before| before.images.get(at)).filter(|before| image.is_like(before));
            same.cloned().unwrap_or_else(|| Arc::new(image.state()))
        });
        MemoryState { buffers: buffers.collect(), images: images.collect() }
    }

    /// Puts back what was there.
    pub fn restore(&self, state: &MemoryState) {
        for (buffer, words) in self.buffers.iter().zip(&state.buffers) {
            buffer.words().iter().zip(&words[..]).for_each(|(word, &value)| word.store(value, Relaxed));
        }
        for (image, state) in self.images.iter().zip(&state.images) {
            image.restore(state);
        }
    }
}

/// A copy of words; the copy from before, where they are the same.
fn shared_copy<I: Iterator<Item = u32>>(now: impl Fn() -> I, before: Option<&Arc<[u32]>>) -> Arc<[u32]> {
    match before.filter(|before| now().eq(before.iter().copied())) {
        Some(same) => same.clone(),
        None => now().collect(),
    }
}
