//! The buffers and images of a scene that it gives no content.

use crate::ResolvedScene;
use anyhit_engine::machine::{Binding, Descriptor, Resources};
use anyhit_sanitize::UnwrittenMemory;

/// What nobody has written before the first pass of a scene: buffers and images of which the scene
/// says only how large they are.
pub fn unwritten_memory(scene: &ResolvedScene, resources: &Resources) -> UnwrittenMemory {
    let mut memory = UnwrittenMemory::default();
    for binding in &scene.resources {
        let is_unfilled = binding.resource.data().is_some_and(|data| data.is_unfilled())
            || binding.resource.image().is_some_and(|image| image.unfilled);
        if !is_unfilled {
            continue;
        }
        let key = Binding { set: binding.set, binding: binding.binding };
        let elements = resources.descriptors.get(&key);
        match elements.and_then(|elements| elements.get(binding.element as usize)) {
            Some(Descriptor::Buffer(buffer)) => memory.add_buffer(buffer, &binding.name),
            Some(Descriptor::Image(image) | Descriptor::ImageSampler(image, _)) => {
                memory.add_image(image, &binding.name);
            }
            _ => {}
        }
    }
    for unbound in scene.unbound.iter().filter(|unbound| unbound.data.is_unfilled()) {
        if let Some((_, buffer)) = resources.memory.named_buffer(&unbound.name) {
            memory.add_buffer(buffer, &unbound.name);
        }
    }
    memory
}
