//! Where resources are kept: several may be bound at one set and binding, each for passes of its
//! own or for shaders that declare its type.

use std::collections::HashMap;
use std::ops::Range;

use crate::descriptor_kind::DescriptorKind;
use crate::pass::OWN_SET;
use crate::pass_entry::{PassKey, PassWorkEntry};
use crate::read::{Spanned, unknown_name};
use crate::resolve::Resolver;
use crate::resources::{Content, ResourceEntry};
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::machine::Binding;

/// Where a resource is kept, and who finds it where it is bound.
#[derive(Clone, Debug)]
pub(super) struct KeptPlace {
    /// Set and binding: those of the resource, unless another one has them.
    pub at: [u32; 2],
    /// The numbers of the passes that it is for; `None` for all that no other is for.
    pub passes: Option<Vec<usize>>,
    /// The shaders that may find it; none for all of the scene.
    pub readers: Vec<Spanned<String>>,
}

/// Resources that are bound together: the elements of one array.
struct BoundArray<'e> {
    at: [u32; 2],
    passes: Option<Vec<usize>>,
    kinds: Vec<DescriptorKind>,
    elements: Vec<Range<u32>>,
    names: Vec<&'e Spanned<String>>,
}

/// A pass with its name, the pipeline that it launches by name, and its shaders.
struct PassReaders {
    name: Option<String>,
    pipeline: Option<String>,
    shaders: Vec<Spanned<String>>,
}

impl Resolver<'_> {
    /// Decides where each resource is kept.
    pub(super) fn allot_places(&mut self) {
        let passes = self.pass_readers();
        let scoped = self.resource_entries.entries.iter().filter_map(|entry| {
            let content = entry.content.as_ref().filter(|content| kind(content).is_some())?;
            Some((&entry.name, content, self.passes_of(content, &passes)))
        });
        let mut scoped: Vec<_> = scoped.collect();
        // Those of all passes first: one of them is kept where it is bound.
        sort_by_key(&mut scoped, |(.., passes)| passes.is_some());
        let mut places: HashMap<[u32; 2], Vec<BoundArray<'_>>> = HashMap::new();
        let mut own = 0;
        for (name, content, passes) in scoped {
            let bound_at = [content.set, content.binding];
            let Some(kind) = kind(content) else { continue };
            let end = content.element.saturating_add(content.contents.len() as u32);
            let elements = content.element..end;
            let here = places.entry(bound_at).or_default();
            let has_kind = |one: &BoundArray<'_>| one.passes == passes && one.kinds.contains(&kind);
            let overlaps = |range: &Range<u32>| range.start < elements.end && elements.start < range.end;
            let is_free = |one: &BoundArray<'_>| one.passes == passes && !one.elements.iter().any(overlaps);
            // A heap is one array, whatever the types of its descriptors.
            let is_heap = Binding { set: content.set, binding: content.binding }.is_heap();
            let has_kind = |one: &BoundArray<'_>| is_heap || has_kind(one);
            let found = here.iter().position(has_kind).or_else(|| here.iter().position(is_free));
            let at = found.unwrap_or_else(|| {
                let at = match here.is_empty() && passes.is_none() {
                    true => bound_at,
                    false => {
                        own += 1;
                        [OWN_SET, own - 1]
                    }
                };
                let new =
                    BoundArray { at, passes, kinds: Vec::new(), elements: Vec::new(), names: Vec::new() };
                here.push(new);
                here.len() - 1
            });
            here[at].kinds.push(kind);
            here[at].elements.push(elements);
            here[at].names.push(name);
        }
        self.report_overlaps(&places, &passes);
        let mut kept = HashMap::new();
        for here in places.values() {
            for one in here {
                let readers = readers(one, here, &passes);
                for name in &one.names {
                    let place =
                        KeptPlace { at: one.at, passes: one.passes.clone(), readers: readers.clone() };
                    kept.insert(name.value.clone(), place);
                }
            }
        }
        self.kept_places = kept;
    }

    /// What the scene runs, in order.
    fn pass_readers(&self) -> Vec<PassReaders> {
        if self.passes.is_empty() {
            let launches = self.pipeline.as_ref().is_some_and(|pipeline| !pipeline.raygen.is_empty());
            let launch = launches.then(|| PassReaders {
                name: None,
                pipeline: None,
                shaders: self.pass_shaders(None),
            });
            let dispatches = self.dispatches.iter().map(|dispatch| PassReaders {
                name: None,
                pipeline: None,
                shaders: vec![dispatch.shader.clone()],
            });
            return launch.into_iter().chain(dispatches).collect();
        }
        let of = |pass: &crate::pass_entry::PassEntry| {
            let name = pass.name.as_ref().map(|name| name.value.clone());
            let (pipeline, shaders) = match &pass.work {
                PassWorkEntry::Launch { pipeline, .. } => {
                    (pipeline.as_ref().map(|name| name.value.clone()), self.pass_shaders(pipeline.as_ref()))
                }
                PassWorkEntry::Dispatch(dispatch) => (None, vec![dispatch.shader.clone()]),
            };
            PassReaders { name, pipeline, shaders }
        };
        self.passes.iter().map(of).collect()
    }

    /// The numbers of the passes that a resource is for; `None` where it does not say.
    fn passes_of(&self, content: &ResourceEntry, passes: &[PassReaders]) -> Option<Vec<usize>> {
        if content.passes.is_none() && content.pipelines.is_none() {
            return None;
        }
        let names = || passes.iter().map(|pass| pass.name.as_deref());
        let mut numbers = Vec::new();
        for key in content.passes.iter().flatten() {
            match key.value.find(names()) {
                Some(number) => numbers.push(number),
                None => {
                    let error = key.span.error(format!("the scene has no pass `{}`", key.value));
                    self.report.push(error.note(PassKey::known(names())));
                }
            }
        }
        for name in content.pipelines.iter().flatten() {
            if self.pipelines.get(&name.value).is_none() {
                let known = || self.pipelines.entries.iter().map(|entry| entry.name.value.as_str());
                let message = format!("no pipeline is named `{}`", name.value);
                self.report.push(unknown_name(name, message, "no `[pipelines]` table has this name", known));
            }
            let launches =
                passes.iter().enumerate().filter(|(_, pass)| pass.pipeline.as_ref() == Some(&name.value));
            numbers.extend(launches.map(|(number, _)| number));
        }
        numbers.sort_unstable();
        numbers.dedup();
        Some(numbers)
    }

    /// Reports resources of one type at one set and binding that are both for one pass.
    fn report_overlaps(&self, places: &HashMap<[u32; 2], Vec<BoundArray<'_>>>, passes: &[PassReaders]) {
        let mut all: Vec<_> = places.iter().collect();
        sort_by_key(&mut all, |(at, _)| **at);
        for ([set, binding], here) in all {
            for (index, one) in here.iter().enumerate() {
                let Some(own) = &one.passes else { continue };
                for other in &here[..index] {
                    let both = other.passes.iter().flatten().find(|pass| own.contains(pass));
                    let Some(&pass) =
                        both.filter(|_| one.kinds.iter().any(|kind| other.kinds.contains(kind)))
                    else {
                        continue;
                    };
                    let label = match &passes[pass].name {
                        Some(name) => format!("`{name}`"),
                        None => pass.to_string(),
                    };
                    let at = Binding { set: *set, binding: *binding };
                    let message = format!("two resources at {at} of pass {label}");
                    let error = one.names[0].span.error(message);
                    self.report.push(error.at_with(other.names[0].span.place(), "the other one"));
                }
            }
        }
    }
}

/// The shaders that may find a resource; none for all of the scene.
fn readers(one: &BoundArray<'_>, here: &[BoundArray<'_>], passes: &[PassReaders]) -> Vec<Spanned<String>> {
    let is_others =
        |number: usize| here.iter().any(|one| one.passes.iter().flatten().any(|&pass| pass == number));
    let numbers: Vec<usize> = match &one.passes {
        Some(own) => own.clone(),
        None if here.iter().all(|one| one.passes.is_none()) => return Vec::new(),
        None => (0..passes.len()).filter(|&number| !is_others(number)).collect(),
    };
    numbers.into_iter().flat_map(|number| passes[number].shaders.iter().cloned()).collect()
}

/// The type of a resource's descriptors, without the way in which their offset is given; `None` of
/// a buffer that is bound nowhere.
pub(super) fn kind(entry: &ResourceEntry) -> Option<DescriptorKind> {
    let kind = match entry.contents.first()? {
        Content::Buffer(kind, _) | Content::Image(kind, _) | Content::Null(kind) => *kind,
        Content::View(view) => view.kind,
        Content::Sampler(_) => DescriptorKind::Sampler,
        Content::AccelerationStructure(_) => DescriptorKind::AccelerationStructure,
    };
    match kind {
        DescriptorKind::Unbound => None,
        DescriptorKind::StorageBufferDynamic => Some(DescriptorKind::StorageBuffer),
        DescriptorKind::UniformBufferDynamic => Some(DescriptorKind::UniformBuffer),
        kind => Some(kind),
    }
}
