//! What an invocation changed in buffers and images.

use std::sync::Arc;

use anyhit_base::sorted::SortedMap;
use anyhit_engine::machine::format::{Class, Format};
use anyhit_engine::machine::image::{Image, ImageState};
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::pipeline::{Pipeline, WrittenMemory};
use anyhit_engine::reflect::value::{TypedValue, ValueContent};
use anyhit_engine::reflect::{Layout, MemoryPart};
use anyhit_explain::layout::{member_at, of_binding};
use anyhit_explain::transcript::{ChangeLocation, MemoryChange};
use anyhit_scene::ResolvedScene;
use anyhit_scene::pass::Pass;
use anyhit_scene::resolved::{RebindingSource, ResolvedBinding};

/// The number of changes that are listed; the others are counted.
const MAX_CHANGES: usize = 256;

/// A copy of buffers and images before a run.
#[derive(Debug)]
pub(super) struct Snapshot {
    contents: SortedMap<(Binding, usize), ResourceContent>,
    /// By name, the words of the buffers that device addresses alone reach.
    unbound: SortedMap<String, Vec<u32>>,
}

#[derive(Debug)]
enum ResourceContent {
    Words(Vec<u32>),
    Image(ImageState),
}

impl Snapshot {
    /// Copies what shaders may write, and the image at the binding of the output.
    pub(super) fn take(scene: &ResolvedScene, written: &WrittenMemory, resources: &Resources) -> Self {
        let output = output(scene);
        let content = |at: (Binding, usize), descriptor: &Descriptor| match descriptor {
            Descriptor::Buffer(buffer) if written.contains_buffer(buffer) => {
                Some(ResourceContent::Words(words(buffer)))
            }
            Descriptor::Image(image) if written.contains_image(image) || Some(at) == output => {
                Some(ResourceContent::Image(image.state()))
            }
            _ => None,
        };
        let contents = descriptors(resources).filter_map(|(at, one)| Some((at, content(at, one)?)));
        let unbound = unbound(resources).filter(|(_, buffer)| written.contains_buffer(buffer));
        let unbound = unbound.map(|(name, buffer)| (name.to_string(), words(buffer)));
        Self { contents: contents.collect(), unbound: unbound.collect() }
    }

    /// The changes since the snapshot that a pass made in these resources, in their order, and how
    /// many are left out.
    ///
    /// The output image's texel at the launch index is listed even if it did not change.
    pub(super) fn changes(
        &self,
        scene: &ResolvedScene,
        pipeline: &Pipeline,
        resources: &Resources,
        pass: &Pass,
        id: Option<[u32; 3]>,
    ) -> (Vec<MemoryChange>, usize) {
        // Where the pass finds what is bound at a binding.
        let seen = |at: (Binding, usize)| {
            let source = RebindingSource::Bound([at.0.set, at.0.binding, at.1 as u32]);
            let rebound = pass.rebindings.iter().find(|one| one.source == source);
            if let Some(one) = rebound {
                return Some(Binding { set: one.at[0], binding: one.at[1] });
            }
            let own = pass.own_bindings.iter().find(|own| own.kept == at.0).map(|own| own.at);
            own.or(Some(at.0).filter(|at| pass.kept(*at) == *at))
        };
        let output = output(scene);
        let mut all = Vec::new();
        for (at, descriptor) in descriptors(resources) {
            let changes = match (self.contents.get(&at), descriptor) {
                (Some(ResourceContent::Image(before)), Descriptor::Image(after)) => {
                    changed_texels(before, after, id.filter(|_| Some(at) == output))
                }
                (Some(ResourceContent::Words(before)), Descriptor::Buffer(after)) => {
                    let layout = seen(at).and_then(|at| of_binding(pipeline, at));
                    changed_words(layout, before, &words(after))
                }
                _ => continue,
            };
            let is_it = |one: &&ResolvedBinding| one.kept_at() == at.0 && one.element as usize == at.1;
            let found = scene.resources.iter().find(is_it);
            let name = found.map_or_else(String::new, |one| one.name.clone());
            let place = found.map_or(at.0, |one| one.declared_at());
            let change = |change: Change| change.of(&name, Some(place), resources);
            all.extend(changes.into_iter().map(change));
        }
        for (name, buffer) in unbound(resources) {
            let Some(before) = self.unbound.get(&**name) else { continue };
            let changes = changed_words(None, before, &words(buffer));
            all.extend(changes.into_iter().map(|change| change.of(name, None, resources)));
        }
        let left_out = all.len().saturating_sub(MAX_CHANGES);
        all.truncate(MAX_CHANGES);
        (all, left_out)
    }
}

/// Binding and array element of the output image.
fn output(scene: &ResolvedScene) -> Option<(Binding, usize)> {
    scene.output().map(|output| (output.kept_at(), output.element as usize))
}

struct Change {
    target: ChangeLocation,
    member: Option<String>,
    before: TypedValue,
    after: TypedValue,
}

impl Change {
    fn of(self, resource: &str, place: Option<Binding>, resources: &Resources) -> MemoryChange {
        let Self { target, member, before, after } = self;
        MemoryChange {
            resource: resource.to_owned(),
            set: place.filter(|place| !place.is_heap()).map(|place| place.set),
            binding: place.filter(|place| !place.is_heap()).map(|place| place.binding),
            at: target,
            member,
            before: before.with_places(&resources.memory),
            after: after.with_places(&resources.memory),
        }
    }
}

/// Changed texels of the first mip level, and the texel at `wanted`, changed or not.
fn changed_texels(before: &ImageState, after: &Image, wanted: Option<[u32; 3]>) -> Vec<Change> {
    let shape = after.shape();
    let [width, height, _] = shape.extent.map(u64::from);
    let samples = u64::from(shape.samples);
    let place = |number: usize| {
        let texel = number as u64 / samples;
        [texel % width, texel / width % height, texel / (width * height)].map(|axis| axis as u32)
    };
    let first = |[x, y, z]: [u32; 3]| {
        let [x, y, z] = [x, y, z].map(u64::from);
        ((z * height + y) * width + x) * samples
    };
    let inside = |at: &[u32; 3]| at.iter().zip(shape.extent).all(|(&at, extent)| at < extent);
    let wanted = wanted.filter(inside).map_or(0..0, |at| first(at) as usize..(first(at) + samples) as usize);
    let format = after.format();
    let changed = after.texels_unlike(before).take_while(|&texel| (texel as u64) < shape.level_texels(0));
    let mut numbers: Vec<usize> = changed.chain(wanted).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let change = |number: usize| {
        let [before, after] = [before.load(number), after.load(number)].map(|bits| colour(format, bits));
        Change { target: ChangeLocation::Texel(place(number)), member: None, before, after }
    };
    numbers.into_iter().map(change).collect()
}

/// Changed words of a buffer; if the buffer's type is known, changed scalars and vectors.
fn changed_words(layout: Option<Layout<'_>>, before: &[u32], after: &[u32]) -> Vec<Change> {
    let mut changes = Vec::new();
    let mut done = 0;
    for at in 0..before.len().min(after.len()) {
        if at < done || before[at] == after[at] {
            continue;
        }
        let byte = 4 * at as u64;
        let member = layout.and_then(|layout| member_at(layout, byte));
        let member = member.filter(|member| member.end() <= 4 * before.len() as u64);
        changes.push(match member {
            Some(member) => {
                let words = (member.offset / 4) as usize..(member.end() / 4) as usize;
                done = words.end;
                let MemoryPart { path, layout, .. } = member;
                let value = |words: &[u32]| TypedValue::of_type(layout.module, layout.ty, words);
                Change {
                    target: ChangeLocation::Byte(member.offset),
                    before: value(&before[words.clone()]),
                    after: value(&after[words]),
                    member: Some(path),
                }
            }
            None => {
                let word =
                    |word: u32| TypedValue { ty: "uint".into(), content: ValueContent::Uint(word.into()) };
                let (before, after) = (word(before[at]), word(after[at]));
                Change { target: ChangeLocation::Byte(byte), member: None, before, after }
            }
        });
    }
    changes
}

/// The descriptors by binding and array element.
fn descriptors(resources: &Resources) -> impl Iterator<Item = ((Binding, usize), &Descriptor)> {
    resources.descriptors.iter().flat_map(|(&binding, all)| {
        all.iter().enumerate().map(move |(element, descriptor)| ((binding, element), descriptor))
    })
}

/// The buffers with a name that no descriptor refers to.
fn unbound(resources: &Resources) -> impl Iterator<Item = (&Arc<str>, &Arc<Buffer>)> {
    let is_bound = |buffer: &Arc<Buffer>| {
        descriptors(resources)
            .any(|(_, one)| matches!(one, Descriptor::Buffer(it) if Arc::ptr_eq(it, buffer)))
    };
    resources.memory.named_buffers().filter(move |(_, buffer)| !is_bound(buffer))
}

fn words(buffer: &Buffer) -> Vec<u32> {
    let word = |chunk: &[u8]| {
        let mut word = [0; 4];
        word[..chunk.len()].copy_from_slice(chunk);
        u32::from_le_bytes(word)
    };
    buffer.bytes().chunks(4).map(word).collect()
}

/// A texel as a shader reads it, without the components that the format lacks.
fn colour(format: Format, bits: u128) -> TypedValue {
    let (prefix, scalar) = match (format.class(), format.is_wide()) {
        (Class::Float, _) => ("", "float"),
        (Class::Sint, false) => ("i", "int"),
        (Class::Uint, false) => ("u", "uint"),
        (Class::Sint, true) => ("i64", "int64_t"),
        (Class::Uint, true) => ("u64", "uint64_t"),
    };
    let component = |bits: u64| match format.class() {
        Class::Float => ValueContent::f32(f32::from_bits(bits as u32)),
        Class::Sint => ValueContent::Int(bits as i64),
        Class::Uint => ValueContent::Uint(bits),
    };
    let parts: Vec<_> = format.decode(bits).into_iter().take(format.channels.into()).map(component).collect();
    match <[ValueContent; 1]>::try_from(parts) {
        Ok([content]) => TypedValue { ty: scalar.to_owned(), content },
        Err(parts) => {
            TypedValue { ty: format!("{prefix}vec{}", parts.len()), content: ValueContent::List(parts) }
        }
    }
}
