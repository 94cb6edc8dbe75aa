//! Buffers and images that the scene gives no content: which of their bytes and texels no shader
//! has written yet.
//!
//! They hold zeros here. On a device they hold what was in the memory before
//! (`vkBindBufferMemory`, `VK_IMAGE_LAYOUT_UNDEFINED`).

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::rule::{Level, memory};
use anyhit_base::error::{Error, ErrorKind};
use anyhit_engine::machine::image::{Image, ImageShape};
use anyhit_engine::machine::{Buffer, OpIndex, ShaderIndex};
use anyhit_engine::pipeline::with_location;
use anyhit_engine::program::Program;

/// The parts of buffers and images that nobody has written. It outlives a pass: what one pass
/// writes, the next may read.
#[derive(Clone, Debug, Default)]
pub struct UnwrittenMemory {
    /// By the id of the buffer's memory: its place in `objects`.
    buffers: FxHashMap<usize, u32>,
    /// By the image's address: its place in `objects`.
    images: FxHashMap<usize, u32>,
    objects: Vec<Unwritten>,
    /// The part of a launch that runs, in launch order.
    part: u64,
}

/// A buffer or an image.
#[derive(Clone, Debug)]
struct Unwritten {
    /// Its name in the scene.
    name: String,
    /// Of an image its shape.
    shape: Option<ImageShape>,
    /// By byte or texel, whether nobody has written it.
    parts: Vec<bool>,
    /// How many of them nobody has written.
    left: usize,
    /// The first instruction that writes it, with the part of a launch in which it did.
    writer: Option<(u64, (Arc<Program>, OpIndex))>,
}

impl Unwritten {
    fn new(name: &str, shape: Option<ImageShape>, parts: u64) -> Self {
        let parts = vec![true; parts as usize];
        Self { name: name.to_owned(), shape, left: parts.len(), parts, writer: None }
    }

    fn write(&mut self, first: usize, count: usize) {
        let end = (first + count).min(self.parts.len());
        for part in self.parts.get_mut(first..end).into_iter().flatten() {
            self.left -= usize::from(std::mem::take(part));
        }
    }
}

/// A part of a buffer or image that nobody has written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct UnwrittenPart {
    /// The number of the buffer or image.
    pub object: u32,
    /// The byte or texel.
    pub at: usize,
}

impl UnwrittenMemory {
    /// What follows belongs to a part of a launch, by its place in launch order.
    pub(super) fn begin_part(&mut self, part: u64) {
        self.part = part;
    }

    /// Adds what other parts of the launch have written, of which this one has a copy.
    pub(super) fn merge(&mut self, other: Self) {
        for (own, other) in self.objects.iter_mut().zip(other.objects) {
            own.parts.iter_mut().zip(other.parts).for_each(|(own, other)| *own &= other);
            own.left = own.parts.iter().filter(|&&unwritten| unwritten).count();
            let writers = own.writer.take().into_iter().chain(other.writer);
            own.writer = writers.min_by_key(|(part, _)| *part);
        }
    }

    /// Adds a buffer of which nothing is written, unless it is there already.
    pub fn add_buffer(&mut self, buffer: &Buffer, name: &str) {
        let Self { buffers, objects, .. } = self;
        buffers.entry(buffer.memory_id()).or_insert_with(|| {
            objects.push(Unwritten::new(name, None, buffer.size()));
            objects.len() as u32 - 1
        });
    }

    /// Adds an image of which nothing is written, unless it is there already.
    pub fn add_image(&mut self, image: &Image, name: &str) {
        let Self { images, objects, .. } = self;
        images.entry(std::ptr::from_ref(image).addr()).or_insert_with(|| {
            let shape = *image.shape();
            objects.push(Unwritten::new(name, Some(shape), shape.texels()));
            objects.len() as u32 - 1
        });
    }

    /// Whether there are buffers of which nobody may have written a part.
    #[inline]
    pub(super) fn has_buffers(&self) -> bool {
        !self.buffers.is_empty()
    }

    /// Whether there are images of which nobody may have written a part.
    #[inline]
    pub(super) fn has_images(&self) -> bool {
        !self.images.is_empty()
    }

    /// The first of some bytes of a buffer that nobody has written.
    #[inline]
    pub(super) fn byte(&self, buffer: &Buffer, offset: u64, bytes: u32) -> Option<UnwrittenPart> {
        let &object = self.buffers.get(&buffer.memory_id())?;
        let unwritten = &self.objects[object as usize];
        if unwritten.left == 0 {
            return None;
        }
        let first = (buffer.offset() + offset) as usize;
        let parts = unwritten.parts.get(first..first + bytes as usize)?;
        let at = parts.iter().position(|&unwritten| unwritten)?;
        Some(UnwrittenPart { object, at: first + at })
    }

    /// A shader writes some bytes of a buffer.
    #[inline]
    pub(super) fn write_bytes(&mut self, buffer: &Buffer, offset: u64, bytes: u32) {
        if let Some(&object) = self.buffers.get(&buffer.memory_id()) {
            let unwritten = &mut self.objects[object as usize];
            if unwritten.left > 0 {
                unwritten.write((buffer.offset() + offset) as usize, bytes as usize);
            }
        }
    }

    /// The texel of an index, if nobody has written it.
    pub(super) fn texel(&self, image: &Image, index: usize) -> Option<UnwrittenPart> {
        let &object = self.images.get(&std::ptr::from_ref(image).addr())?;
        let is_unwritten = *self.objects[object as usize].parts.get(index)?;
        is_unwritten.then_some(UnwrittenPart { object, at: index })
    }

    /// The first texel of an image of which nobody has written any.
    pub(super) fn whole_image(&self, image: &Image) -> Option<UnwrittenPart> {
        let &object = self.images.get(&std::ptr::from_ref(image).addr())?;
        let unwritten = &self.objects[object as usize];
        (unwritten.left == unwritten.parts.len()).then_some(UnwrittenPart { object, at: 0 })
    }

    /// An instruction writes the texel of an index.
    pub(super) fn write_texel(
        &mut self,
        image: &Image,
        index: usize,
        writer: impl FnOnce() -> (Arc<Program>, OpIndex),
    ) {
        let Self { images, objects, part, .. } = self;
        if let Some(&object) = images.get(&std::ptr::from_ref(image).addr()) {
            let unwritten = &mut objects[object as usize];
            unwritten.write(index, 1);
            unwritten.writer.get_or_insert_with(|| (*part, writer()));
        }
    }

    /// A part as a report names it, given the source expression of a buffer's.
    pub(super) fn describe(&self, part: UnwrittenPart, member: Option<String>) -> String {
        let Unwritten { name, shape, .. } = &self.objects[part.object as usize];
        match shape {
            None => match member {
                Some(member) => format!("{member}, at offset {} of `{name}`,", part.at),
                None => format!("what lies at offset {} of `{name}`", part.at),
            },
            Some(shape) => format!("texel {} of `{name}`", texel_name(shape, part.at)),
        }
    }

    /// What is wrong with images that launches or dispatches of these many invocations have
    /// written in part: [`memory::OUTPUT_UNWRITTEN`].
    pub fn check_outputs(&self, launches: &[LaunchSize], levels: &Levels) -> Findings {
        let mut findings = Findings::default();
        let rule = &memory::OUTPUT_UNWRITTEN;
        let level = levels.of(rule);
        for (number, image) in (0..).zip(&self.objects) {
            let (Some(shape), Some((_, (program, op)))) = (&image.shape, &image.writer) else { continue };
            let Some(first) = image.parts.iter().position(|&unwritten| unwritten) else { continue };
            if level == Level::Allow || !launches.iter().any(|launch| launch.covers(shape)) {
                continue;
            }
            let (left, all, at) = (image.left, image.parts.len(), texel_name(shape, first));
            let were = if left == 1 { "texel was" } else { "texels were" };
            let message =
                format!("{left} of the {all} {were} never written in `{}`: the first is {at}", image.name);
            let error = Error::new(ErrorKind::Finding, message);
            let error = with_location(program, *op, error, "other texels are written here");
            let error = error.note(format!("in {} `{}`", program.stage.name(), program.name));
            let key = FindingKey { rule: rule.id, places: [(ShaderIndex(u32::MAX), number); 2] };
            let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
            findings.add(key, 1, Some(finding));
        }
        findings
    }
}

/// The invocations of a launch or dispatch.
#[derive(Clone, Copy, Debug)]
pub struct LaunchSize {
    /// Invocations along each axis.
    pub invocations: [u32; 3],
    /// Those of a workgroup: a dispatch may have more invocations than its image has texels.
    pub workgroup: [u32; 3],
}

impl LaunchSize {
    /// Whether an image of one level has a texel for each invocation, or for all but those that
    /// fill up the last workgroups.
    fn covers(&self, shape: &ImageShape) -> bool {
        let axis = |at: usize| {
            let (texels, invocations) = (shape.extent[at], self.invocations[at]);
            texels <= invocations && invocations - texels < self.workgroup[at].max(1)
        };
        shape.levels == 1 && shape.layers == 1 && shape.samples == 1 && (0..3).all(axis)
    }
}

/// The coordinates of a texel, by its index.
fn texel_name(shape: &ImageShape, index: usize) -> String {
    let (mut level, mut rest) = (0, index as u64);
    while level + 1 < shape.levels && rest >= shape.level_texels(level) {
        rest -= shape.level_texels(level);
        level += 1;
    }
    rest /= u64::from(shape.samples);
    let [width, height, depth] = shape.level_extent(level).map(u64::from);
    let at = [rest % width, rest / width % height, rest / width / height % depth];
    let layer = rest / width / height / depth;
    let at: Vec<String> = at[..shape.dimension.axes()].iter().map(u64::to_string).collect();
    let mut name = format!("({})", at.join(", "));
    if shape.layers > 1 {
        name += &format!(" of layer {layer}");
    }
    if shape.levels > 1 {
        name += &format!(" of level {level}");
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::machine::format::{Component, Format};
    use anyhit_engine::machine::image::Dimension;

    #[test]
    fn bytes_are_unwritten_until_they_are_written_through_any_view() {
        let buffer = Buffer::zeroed(16);
        let view = buffer.view(8, 8, "all").unwrap();
        let mut memory = UnwrittenMemory::default();
        assert!(!memory.has_buffers());
        memory.add_buffer(&buffer, "all");
        assert_eq!(memory.byte(&view, 0, 4), Some(UnwrittenPart { object: 0, at: 8 }));
        memory.write_bytes(&view, 0, 2);
        assert_eq!(memory.byte(&buffer, 8, 4), Some(UnwrittenPart { object: 0, at: 10 }));
        assert_eq!(memory.byte(&buffer, 8, 2), None);
        memory.write_bytes(&buffer, 0, 16);
        assert_eq!(memory.byte(&view, 0, 8), None);
        assert_eq!(memory.byte(&Buffer::zeroed(4), 0, 4), None);
    }

    #[test]
    fn parts_of_a_launch_write_together() {
        let image =
            Image::filled(Format::new(Component::Float32, 1), ImageShape::plane(4, 1), &[0; 4]).unwrap();
        let mut before = UnwrittenMemory::default();
        before.add_image(&image, "picture");
        let write = |part, texels: &[usize]| {
            let mut memory = before.clone();
            memory.begin_part(part);
            texels.iter().for_each(|&texel| memory.objects[0].write(texel, 1));
            memory
        };
        let mut memory = write(64, &[2, 3]);
        memory.merge(write(0, &[0]));
        assert_eq!(memory.objects[0].left, 1);
        assert_eq!(memory.texel(&image, 1), Some(UnwrittenPart { object: 0, at: 1 }));
        assert_eq!(memory.texel(&image, 2), None);
    }

    #[test]
    fn texels_have_the_coordinates_of_their_level_and_layer() {
        assert_eq!(texel_name(&ImageShape::plane(4, 2), 6), "(2, 1)");
        let shape =
            ImageShape { dimension: Dimension::D2Array, extent: [4, 2, 1], layers: 3, levels: 2, samples: 1 };
        // Three layers of eight texels, then three of two.
        assert_eq!(texel_name(&shape, 8), "(0, 0) of layer 1 of level 0");
        assert_eq!(texel_name(&shape, 24 + 3), "(1, 0) of layer 1 of level 1");
    }

    #[test]
    fn a_dispatch_covers_an_image_that_ends_within_its_last_workgroups() {
        let dispatch = |x, y| LaunchSize { invocations: [x, y, 1], workgroup: [8, 8, 1] };
        let shape = ImageShape::plane(13, 8);
        assert!(dispatch(16, 8).covers(&shape));
        assert!(!dispatch(24, 8).covers(&shape));
        assert!(!dispatch(8, 8).covers(&shape));
    }
}
