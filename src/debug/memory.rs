//! What an invocation changed in buffers and images.

use std::collections::BTreeMap;

use crate::debug::story::{Target, Write};
use crate::debug::values::Content;
use crate::machine::format::Class;
use crate::machine::image::Image;
use crate::machine::{Binding, Descriptor, Resources};
use crate::scene::ResolvedScene;

/// Changes listed; the rest is counted.
const LISTED: usize = 256;

/// Buffers and images as they were.
#[derive(Debug)]
pub struct Snapshot {
    words: BTreeMap<(Binding, usize), Vec<u32>>,
}

impl Snapshot {
    /// Copies everything that a shader may write.
    pub fn take(resources: &Resources) -> Self {
        Self { words: descriptors(resources).filter_map(|(at, one)| Some((at, words(one)?))).collect() }
    }

    /// The changes since, those of the first resource first, and how many are left out.
    ///
    /// The output image's texel at the launch index is listed though nothing changed there.
    pub fn changes(
        &self,
        scene: &ResolvedScene,
        resources: &Resources,
        id: Option<[u32; 3]>,
    ) -> (Vec<Write>, usize) {
        let mut writes = Vec::new();
        let mut left_out = 0;
        let output = scene.output().map(|output| Binding { set: output.set, binding: output.binding });
        for (at, descriptor) in descriptors(resources) {
            let (Some(before), Some(after)) = (self.words.get(&at), words(descriptor)) else { continue };
            let expected = id.filter(|_| Some(at.0) == output && at.1 == 0);
            let step = step(descriptor);
            let chunks = before.chunks(step).zip(after.chunks(step)).enumerate();
            for (number, (before, after)) in chunks {
                let target = target(descriptor, number);
                let wanted = expected.is_some_and(|id| target == Target::Texel([id[0], id[1]]));
                if before == after && !wanted {
                    continue;
                }
                if writes.len() == LISTED {
                    left_out += 1;
                    continue;
                }
                writes.push(Write {
                    resource: name(scene, at.0),
                    set: at.0.set,
                    binding: at.0.binding,
                    at: target,
                    before: content(descriptor, before),
                    after: content(descriptor, after),
                });
            }
        }
        (writes, left_out)
    }
}

/// Buffers and images, each once though two bindings may name it.
fn descriptors(resources: &Resources) -> impl Iterator<Item = ((Binding, usize), &Descriptor)> {
    resources.descriptors.iter().flat_map(|(&binding, all)| {
        all.iter().enumerate().map(move |(element, descriptor)| ((binding, element), descriptor))
    })
}

fn words(descriptor: &Descriptor) -> Option<Vec<u32>> {
    match descriptor {
        Descriptor::Buffer(buffer) => Some(
            buffer
                .bytes()
                .chunks(4)
                .map(|chunk| {
                    let mut word = [0; 4];
                    word[..chunk.len()].copy_from_slice(chunk);
                    u32::from_le_bytes(word)
                })
                .collect(),
        ),
        Descriptor::Image(image) => Some(components(image)),
        _ => None,
    }
}

/// The components of every texel that the format has, as a shader reads them; 64-bit ones as two words.
fn components(image: &Image) -> Vec<u32> {
    let format = image.format();
    let texels = (0..image.shape().texels() as usize).map(|index| format.decode(image.load(index)));
    let parts = texels.flat_map(|texel| texel.into_iter().take(usize::from(format.channels)));
    parts
        .flat_map(|part| {
            [part as u32, (part >> 32) as u32].into_iter().take(if format.is_wide() { 2 } else { 1 })
        })
        .collect()
}

/// Words of a texel among its image's [`components`].
fn texel_words(image: &Image) -> usize {
    let format = image.format();
    usize::from(format.channels) * if format.is_wide() { 2 } else { 1 }
}

/// Words that are shown together: a texel, a word of a buffer.
fn step(descriptor: &Descriptor) -> usize {
    match descriptor {
        Descriptor::Image(image) => texel_words(image),
        _ => 1,
    }
}

fn target(descriptor: &Descriptor, number: usize) -> Target {
    match descriptor {
        Descriptor::Image(image) => {
            let width = image.shape().extent[0] as usize;
            Target::Texel([(number % width) as u32, (number / width) as u32])
        }
        _ => Target::Byte(4 * number as u64),
    }
}

fn content(descriptor: &Descriptor, words: &[u32]) -> Content {
    match descriptor {
        Descriptor::Image(image) => texel(image, words),
        // Without a type it may be either: the reader sees both.
        _ => Content::List(
            words
                .iter()
                .flat_map(|&word| [Content::Uint(word.into()), Content::f32(f32::from_bits(word))])
                .collect(),
        ),
    }
}

fn texel(image: &Image, words: &[u32]) -> Content {
    let components = match (image.format().class(), image.format().is_wide()) {
        (Class::Float, _) => words.iter().map(|&word| Content::f32(f32::from_bits(word))).collect(),
        (Class::Sint, false) => words.iter().map(|&word| Content::Int((word as i32).into())).collect(),
        (Class::Uint, false) => words.iter().map(|&word| Content::Uint(word.into())).collect(),
        (class, true) => {
            let bits = words.chunks_exact(2).map(|pair| u64::from(pair[0]) | u64::from(pair[1]) << 32);
            let signed = class == Class::Sint;
            bits.map(|bits| if signed { Content::Int(bits as i64) } else { Content::Uint(bits) }).collect()
        }
    };
    Content::List(components)
}

fn name(scene: &ResolvedScene, at: Binding) -> String {
    scene
        .resources
        .iter()
        .find(|one| one.set == at.set && one.binding == at.binding)
        .map_or_else(String::new, |one| one.name.clone())
}
