//! Resources and the descriptors that they are bound to.

use std::collections::HashMap;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::error::Place;
use crate::machine::sampler::Sampler;
use crate::scene::resolve::Resolver;
use crate::scene::resolved::ResolvedBinding;
use crate::scene::resources::{Content, DescriptorKind, Resource};
use crate::scene::sampler::SamplerReference;

impl Resolver<'_> {
    pub(super) fn bindings(&self, tlas: &[(String, Option<Arc<Tlas>>)]) -> Vec<ResolvedBinding> {
        let mut bindings: Vec<ResolvedBinding> = Vec::new();
        let mut output: Option<Place> = None;
        let mut taken: HashMap<[u32; 3], Place> = HashMap::new();
        for entry in &self.resource_entries.entries {
            let Some(content) = &entry.content else { continue };
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
            if let Some(resource) = self.resource(&content.content, tlas) {
                taken.entry(key).or_insert_with(|| place.clone());
                bindings.push(ResolvedBinding {
                    name: entry.name.value.clone(),
                    set: content.set,
                    binding: content.binding,
                    element: content.element,
                    resource,
                    output: content.output,
                    place,
                });
            }
        }
        bindings.sort_by_key(|binding| (binding.set, binding.binding, binding.element));
        bindings
    }

    fn resource(&self, content: &Content, tlas: &[(String, Option<Arc<Tlas>>)]) -> Option<Resource> {
        match content {
            Content::Buffer(kind, entry) => {
                let bytes = self.report.keep(entry.load(self.files, self.aspect()))?;
                Some(match kind {
                    DescriptorKind::UniformBuffer => Resource::UniformBuffer(bytes),
                    _ => Resource::StorageBuffer(bytes),
                })
            }
            Content::Image(kind, entry) => {
                let sampler = match &entry.sampler {
                    None => Some(Sampler::default()),
                    Some(reference) => self.sampler(reference),
                };
                let streams = self.options.streams && *kind == DescriptorKind::StorageImage;
                let image = self.report.keep(entry.load(self.files, self.launch, streams))?;
                Some(match kind {
                    DescriptorKind::SampledImage => Resource::SampledImage(image),
                    DescriptorKind::UniformTexelBuffer | DescriptorKind::StorageTexelBuffer => {
                        Resource::TexelBuffer(image)
                    }
                    DescriptorKind::CombinedImageSampler => Resource::CombinedImageSampler(image, sampler?),
                    _ => Resource::StorageImage(image),
                })
            }
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

    fn sampler(&self, reference: &SamplerReference) -> Option<Sampler> {
        match reference {
            SamplerReference::Inline(sampler) => Some(*sampler),
            SamplerReference::Named(name) => self.find(&self.samplers, name, "sampler").cloned(),
        }
    }
}
