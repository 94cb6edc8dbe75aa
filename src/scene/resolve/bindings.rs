//! Resources and the descriptors that they are bound to.

use std::collections::HashMap;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::error::{Place, Result};
use crate::machine::sampler::Sampler;
use crate::machine::{Binding, Descriptor};
use crate::scene::addresses::AddressChoice;
use crate::scene::read::Spanned;
use crate::scene::resolve::Resolver;
use crate::scene::resolve::modules::SceneModules;
use crate::scene::resolve::views::Viewed;
use crate::scene::resolved::{ResolvedBinding, ResolvedGroup, UnboundBuffer};
use crate::scene::resources::{Content, DescriptorKind, Resource, ResourceEntry};
use crate::scene::sampler::SamplerReference;
use crate::scene::struct_lookup::DataBlock;
use crate::scene::view_entry::ViewEntry;

impl Resolver<'_> {
    pub(super) fn bindings(
        &self,
        tlas: &[(String, Option<Arc<Tlas>>)],
        unbound: &[UnboundBuffer],
        has_dispatches: bool,
    ) -> Vec<ResolvedBinding> {
        let mut bindings: Vec<ResolvedBinding> = Vec::new();
        let mut views: Vec<(&Spanned<String>, &ResourceEntry, &ViewEntry)> = Vec::new();
        let mut output: Option<Place> = None;
        let mut taken: HashMap<[u32; 3], Place> = HashMap::new();
        let mut lengths: HashMap<[u32; 2], u32> = HashMap::new();
        for entry in &self.resource_entries.entries {
            let Some(content) = &entry.content else { continue };
            if matches!(content.content, Content::Buffer(DescriptorKind::Unbound, _)) {
                continue;
            }
            let place = entry.name.span.place();
            let key = [content.set, content.binding, content.element];
            if let Some(other) = taken.get(&key) {
                let message = format!("two resources at set {}, binding {}", content.set, content.binding);
                self.report.push(entry.name.span.error(message).at_with(other.clone(), "the other one"));
            }
            let other = if content.output.is_some() { output.replace(place.clone()) } else { None };
            if let Some(other) = other {
                let error = entry.name.span.error("two images are marked as output");
                self.report.push(error.at_with(other, "the other one"));
            }
            let length = lengths.entry([content.set, content.binding]).or_default();
            let more = (content.element + 1).saturating_sub(*length);
            *length += more;
            if let Err(error) = self.reserve_descriptors(more, has_dispatches) {
                self.report.push(error.at(place));
                continue;
            }
            let binding = Binding { set: content.set, binding: content.binding };
            if let Content::View(view) = &content.content {
                views.push((&entry.name, content, view));
            } else if let Some(resource) = self.resource(binding, &content.content, tlas) {
                bindings.push(bound(&entry.name, content, resource));
            } else {
                continue;
            }
            taken.entry(key).or_insert(place);
        }
        // What a view is of may come after it.
        let viewed = Viewed { bound: &bindings, unbound };
        let view = |(name, content, view)| Some(bound(name, content, self.view(view, &viewed)?));
        let views: Vec<ResolvedBinding> = views.into_iter().filter_map(view).collect();
        bindings.extend(views);
        bindings.sort_by_key(|binding| (binding.set, binding.binding, binding.element));
        bindings
    }

    /// The buffers that no descriptor refers to, sorted by name.
    pub(super) fn unbound_buffers(&self) -> Vec<UnboundBuffer> {
        let mut buffers = Vec::new();
        for entry in &self.resource_entries.entries {
            let Some(ResourceEntry { content: Content::Buffer(DescriptorKind::Unbound, buffer), .. }) =
                &entry.content
            else {
                continue;
            };
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
        buffers.sort_by(|a, b| a.name.cmp(&b.name));
        buffers
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
        binding: Binding,
        content: &Content,
        tlas: &[(String, Option<Arc<Tlas>>)],
    ) -> Option<Resource> {
        match content {
            Content::Buffer(kind, entry) => {
                let (modules, block) =
                    (SceneModules { resolver: self, own: &[] }, DataBlock::Buffer(binding));
                let data = self.report.keep(entry.load(&self.sources(), &modules, Some(block)))?;
                Some(match kind {
                    DescriptorKind::UniformBuffer => Resource::UniformBuffer(data),
                    _ => Resource::StorageBuffer(data),
                })
            }
            Content::Image(kind, entry) => {
                let sampler = match &entry.sampler {
                    None => Some(Sampler::default()),
                    Some(reference) => self.sampler(reference),
                };
                let streams = self.options.streams && *kind == DescriptorKind::StorageImage;
                let image = self.report.keep(entry.load(&self.sources(), self.launch, streams))?;
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

/// A resource where its entry binds it.
fn bound(name: &Spanned<String>, entry: &ResourceEntry, resource: Resource) -> ResolvedBinding {
    ResolvedBinding {
        name: name.value.clone(),
        set: entry.set,
        binding: entry.binding,
        element: entry.element,
        resource,
        address: match &entry.content {
            Content::Buffer(_, buffer) => buffer.address.clone(),
            _ => AddressChoice::Unsaid,
        },
        output: entry.output,
        place: name.span.place(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::error::Result;
    use crate::input::{InputLimit, InputLimits};
    use crate::machine::Descriptor;
    use crate::scene::{LoadOptions, ResolvedScene, SceneFiles, load_text};

    fn scene(elements: &[u32], more: &str, memory: u64) -> Result<ResolvedScene> {
        let buffer = |element: &u32| {
            format!(
                "[resources.r{element}]\ntype = 'storage_buffer'\nbinding = 3\nelement = {element}\nsize = 4\n"
            )
        };
        let text = format!("version = 1\n{}{more}", elements.iter().map(buffer).collect::<String>());
        let files =
            SceneFiles { limits: InputLimits::default().with(InputLimit::SceneMemory, memory), root: None };
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
        let module = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";
        let size = std::fs::metadata(module).unwrap().len();
        let dispatch = format!("[shaders.a]\npath = '{module}'\n[[dispatch]]\nshader = 'a'\n");
        assert!(scene(&[1_048_575], &dispatch, size + 2 * all + 4).is_ok());
        assert!(scene(&[1_048_575], &dispatch, size + 2 * all + 3).is_err());
    }
}
