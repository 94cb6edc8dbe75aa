//! Resources and the descriptors that they are bound to.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use crate::address_entry::AddressChoice;
use crate::descriptor_kind::DescriptorKind;
use crate::image_entry::ImageLoading;
use crate::read::Spanned;
use crate::resolve::Resolver;
use crate::resolve::kept_places::KeptPlace;
use crate::resolve::modules::SceneModules;
use crate::resolve::views::Viewed;
use crate::resolved::{ResolvedBinding, ResolvedGroup, UnboundBuffer};
use crate::resources::{Content, Resource, ResourceEntry, too_many_elements};
use crate::sampler::SamplerReference;
use crate::view_entry::ViewEntry;
use anyhit_base::error::{Place, Result};
use anyhit_base::sorted::{sort_by, sort_by_key};
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::resource::ELEMENT_BITS;
use anyhit_engine::machine::sampler::Sampler;
use anyhit_engine::machine::{Binding, Descriptor};
use anyhit_engine::reflect::lookup::DataBlock;

impl Resolver<'_> {
    pub(super) fn bindings(
        &self,
        tlas: &[(String, Option<Arc<Tlas>>)],
        unbound: &[UnboundBuffer],
        has_dispatches: bool,
    ) -> Vec<ResolvedBinding> {
        let mut bindings: Vec<ResolvedBinding> = Vec::new();
        let mut views: Vec<(&Spanned<String>, &ResourceEntry, u32, ViewEntry)> = Vec::new();
        let mut output: Option<Place> = None;
        let mut taken: HashMap<[u32; 3], Place> = HashMap::new();
        let mut lengths: HashMap<[u32; 2], u32> = HashMap::new();
        for entry in &self.resource_entries.entries {
            let Some(content) = &entry.content else { continue };
            if matches!(content.contents[..], [Content::Buffer(DescriptorKind::Unbound, _)]) {
                continue;
            }
            let place = entry.name.span.place();
            let other = if content.output.is_some() { output.replace(place.clone()) } else { None };
            if let Some(other) = other {
                let error = entry.name.span.error("two images are marked as output");
                self.report.push(error.at_with(other, "the other one"));
            }
            let Some(elements) = self.report.keep(self.elements(&content.contents)) else { continue };
            // A scene that is refused for its bindings is read to its end.
            let Some(kept) = self.kept_places.get(&entry.name.value) else { continue };
            let length = lengths.entry(kept.at).or_default();
            let count = content.element.saturating_add(elements.len() as u32);
            if count > 1 << ELEMENT_BITS {
                self.report.push(too_many_elements(&entry.name.span));
                continue;
            }
            let more = count.saturating_sub(*length);
            *length += more;
            if let Err(error) = self.reserve_descriptors(more, has_dispatches) {
                self.report.push(error.at(place));
                continue;
            }
            for (at, element) in (content.element..).zip(elements) {
                let key = [kept.at[0], kept.at[1], at];
                let binding = Binding { set: content.set, binding: content.binding };
                if let Some(other) = taken.get(&key) {
                    let message = match binding.is_heap() {
                        true => format!("two resources at index {at} of {binding}"),
                        false => format!("two resources at {binding}"),
                    };
                    let error = entry.name.span.error(message);
                    let error = error.at_with(other.clone(), "the other one");
                    self.report.push(if binding.is_heap() {
                        error
                    } else {
                        error.note(
                            "assign each resource to passes with `passes`; without it, each shader uses the \
                         resource of the type that it declares",
                        )
                    });
                }
                if let Content::View(view) = &*element {
                    views.push((&entry.name, content, at, view.clone()));
                } else if let Some(resource) =
                    self.resource(DataBlock::of_buffer(binding, at), kept, &element, tlas)
                {
                    bindings.push(bound(&entry.name, content, kept, at, &element, resource));
                } else {
                    continue;
                }
                taken.entry(key).or_insert_with(|| place.clone());
            }
        }
        // What a view is of may come after it.
        let viewed = Viewed { bound: &bindings, unbound };
        let view = |(name, entry, at, view): (&Spanned<String>, &ResourceEntry, u32, ViewEntry)| {
            let resource = self.view(&view, &viewed)?;
            let kept = self.kept_places.get(&name.value)?;
            Some(bound(name, entry, kept, at, &Content::View(view), resource))
        };
        let views: Vec<ResolvedBinding> = views.into_iter().filter_map(view).collect();
        bindings.extend(views);
        sort_by_key(&mut bindings, |binding| (binding.set, binding.binding, binding.element));
        bindings
    }

    /// The buffers that no descriptor refers to, sorted by name.
    pub(super) fn unbound_buffers(&self) -> Vec<UnboundBuffer> {
        let mut buffers = Vec::new();
        for entry in &self.resource_entries.entries {
            let contents = entry.content.as_ref().map_or(&[][..], |content| &content.contents);
            let [Content::Buffer(DescriptorKind::Unbound, buffer)] = contents else { continue };
            let modules = SceneModules { resolver: self, own: &[] };
            let data = buffer.load(&self.sources(), &modules, None);
            if let Some(data) = self.report.keep(data) {
                buffers.push(UnboundBuffer {
                    name: entry.name.value.clone(),
                    data,
                    address: buffer.address.clone(),
                    place: entry.name.span.place(),
                });
            }
        }
        sort_by(&mut buffers, |a, b| a.name.cmp(&b.name));
        buffers
    }

    /// The elements that are written: where they are the textures of a file, one for each.
    fn elements<'c>(&self, contents: &'c [Content]) -> Result<Vec<Cow<'c, Content>>> {
        let mut all = Vec::new();
        for content in contents {
            let texture = match content {
                Content::Image(_, entry) => entry.all_textures(),
                Content::Sampler(SamplerReference::Mesh(texture)) if texture.is_all() => Some(texture),
                _ => None,
            };
            let sources = self.sources();
            let Some((texture, meshes)) = texture.zip(sources.meshes.as_ref()) else {
                all.push(Cow::Borrowed(content));
                continue;
            };
            let textures = texture.each(meshes)?;
            if textures.is_empty() {
                all.push(match content {
                    Content::Image(kind, entry) => Cow::Owned(Content::Image(*kind, entry.white())),
                    _ => Cow::Owned(Content::Sampler(SamplerReference::Inline(Sampler::default()))),
                });
            }
            all.extend(textures.into_iter().map(|texture| match content {
                Content::Image(kind, entry) => {
                    Cow::Owned(Content::Image(*kind, entry.of_texture(texture, *kind)))
                }
                _ => Cow::Owned(Content::Sampler(SamplerReference::Mesh(texture))),
            }));
        }
        Ok(all)
    }

    /// Counts descriptors of an array, those included that nothing is bound to: every element in
    /// front of the last one takes memory. The scene has a list of them, and so has each program
    /// of the pipeline; of dispatches one runs at a time.
    fn reserve_descriptors(&self, count: u32, has_dispatches: bool) -> Result<()> {
        let shaders = |group: &ResolvedGroup| match group {
            ResolvedGroup::Hit(hit) => {
                [&hit.closest_hit, &hit.any_hit, &hit.intersection].into_iter().flatten().count()
            }
            _ => 1,
        };
        let programs: usize = self.groups.iter().map(shaders).sum();
        let lists = 1 + programs as u64 + u64::from(has_dispatches);
        self.files.reserve(lists * u64::from(count) * size_of::<Descriptor>() as u64)
    }

    fn resource(
        &self,
        block: DataBlock,
        kept: &KeptPlace,
        content: &Content,
        tlas: &[(String, Option<Arc<Tlas>>)],
    ) -> Option<Resource> {
        match content {
            Content::Buffer(kind, entry) => {
                let readers: Vec<_> = kept.readers.iter().collect();
                let modules = SceneModules { resolver: self, own: &readers };
                let data = self.report.keep(entry.load(&self.sources(), &modules, Some(block)))?;
                Some(match kind {
                    DescriptorKind::UniformBuffer | DescriptorKind::PushConstantBank => {
                        Resource::UniformBuffer(data)
                    }
                    _ => Resource::StorageBuffer(data),
                })
            }
            Content::Image(kind, entry) => {
                let sampler = match &entry.sampler {
                    None => Some(Sampler::default()),
                    Some(reference) => self.sampler(reference),
                };
                let loading = match kind {
                    DescriptorKind::StorageImage if self.options.streams => ImageLoading::Streamed,
                    DescriptorKind::SampledImage | DescriptorKind::CombinedImageSampler
                        if !self.files.read_all() =>
                    {
                        ImageLoading::Late
                    }
                    _ => ImageLoading::Now,
                };
                let image = self.report.keep(entry.load(&self.sources(), self.launch, loading))?;
                let image = Arc::new(image);
                Some(match kind {
                    DescriptorKind::SampledImage => Resource::SampledImage(image),
                    DescriptorKind::UniformTexelBuffer | DescriptorKind::StorageTexelBuffer => {
                        Resource::TexelBuffer(image)
                    }
                    DescriptorKind::CombinedImageSampler => Resource::CombinedImageSampler(image, sampler?),
                    _ => Resource::StorageImage(image),
                })
            }
            Content::View(_) => None,
            Content::Null(DescriptorKind::AccelerationStructure) => Some(Resource::NullAccelerationStructure),
            Content::Null(_) => Some(Resource::NullBuffer),
            Content::Sampler(reference) => self.sampler(reference).map(Resource::Sampler),
            Content::AccelerationStructure(name) => {
                let found = tlas.iter().position(|(known, _)| *known == name.value);
                if found.is_none() && self.report.is_empty() {
                    let message = format!("no instance is in the acceleration structure `{}`", name.value);
                    self.report.push(name.span.error(message));
                }
                found.map(Resource::AccelerationStructure)
            }
        }
    }

    pub(super) fn sampler(&self, reference: &SamplerReference) -> Option<Sampler> {
        match reference {
            SamplerReference::Inline(sampler) => Some(*sampler),
            SamplerReference::Mesh(texture) => {
                let sources = self.sources();
                let meshes = sources.meshes.as_ref()?;
                self.report.keep(texture.find(meshes)).map(|(texture, _)| texture.sampler)
            }
            SamplerReference::Named(name) => self.find(&self.samplers, name, "sampler").cloned(),
        }
    }
}

/// A resource where its entry binds it, with the number of its element and what is written of it.
fn bound(
    name: &Spanned<String>,
    entry: &ResourceEntry,
    kept: &KeptPlace,
    element: u32,
    content: &Content,
    resource: Resource,
) -> ResolvedBinding {
    let place = name.span.place();
    // The first element has the name by itself.
    let (name, output) = match element - entry.element {
        0 => (name.value.clone(), entry.output),
        at => (format!("{}[{at}]", name.value), None),
    };
    let keeps_alpha = entry.keeps_alpha;
    let address = match content {
        Content::Buffer(_, buffer) => buffer.address.clone(),
        _ => AddressChoice::Unsaid,
    };
    let [set, binding] = kept.at;
    let declared_at = [entry.set, entry.binding];
    let passes = kept.passes.clone();
    ResolvedBinding {
        name,
        set,
        binding,
        declared_at,
        passes,
        element,
        resource,
        address,
        output,
        keeps_alpha,
        place,
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::{LoadOptions, ResolvedScene, SceneFiles, load_text};
    use anyhit_base::error::Result;
    use anyhit_base::input::{InputLimit, InputLimits};
    use anyhit_engine::machine::Descriptor;

    fn scene(elements: &[u32], more: &str, memory: u64) -> Result<ResolvedScene> {
        let buffer = |element: &u32| {
            format!(
                "[resources.r{element}]\ntype = 'storage_buffer'\nbinding = 3\nelement = {element}\nsize = 4\n"
            )
        };
        let text = format!("version = 1\n{}{more}", elements.iter().map(buffer).collect::<String>());
        let files = SceneFiles {
            limits: InputLimits::default().with(InputLimit::SceneMemory, memory),
            ..SceneFiles::default()
        };
        load_text(Path::new("s.toml"), &text, &files, &LoadOptions::default())
    }

    #[test]
    fn elements_in_front_of_the_last_one_take_memory() {
        // Elements 0 to 2^20 - 1, and the buffers' own bytes.
        let all = (1 << 20) * size_of::<Descriptor>() as u64;
        let error = scene(&[1_048_575], "", all - 1).unwrap_err().render();
        assert!(error.contains(&format!("the limit `scene-memory` of {}", all - 1)), "{error}");
        assert!(error.contains("s.toml:2:"), "{error}");
        assert!(scene(&[1_048_575], "", all + 4).is_ok());
        // Further elements of an array lie in it.
        assert!(scene(&[1_048_575, 7, 8], "", all + 12).is_ok());
        // A dispatch has a list of its own, and a module that is read.
        let module = "../../spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";
        let size = std::fs::metadata(module).unwrap().len();
        let dispatch = format!("[shaders.a]\npath = '{module}'\n[[dispatch]]\nshader = 'a'\n");
        assert!(scene(&[1_048_575], &dispatch, size + 2 * all + 4).is_ok());
        assert!(scene(&[1_048_575], &dispatch, size + 2 * all + 3).is_err());
    }
}
