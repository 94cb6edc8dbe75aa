//! Copies of resources, so that one scene can be run again and again.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::machine::image::Image;
use crate::machine::{Buffer, Descriptor, Resources};

/// Copies resources with their memory. Bindings that shared memory share the copy.
pub fn copied(resources: &Resources) -> Resources {
    let mut images: Vec<(Arc<Image>, Arc<Image>)> = Vec::new();
    let mut image = |image: &Arc<Image>| once(&mut images, image, || image.copied());
    let mut buffers: Vec<(Arc<Buffer>, Arc<Buffer>)> = Vec::new();
    let mut buffer = |buffer: &Arc<Buffer>| once(&mut buffers, buffer, || buffer.copy());
    let mut descriptors = BTreeMap::new();
    for (&binding, list) in &resources.descriptors {
        let copies = list.iter().map(|descriptor| match descriptor {
            Descriptor::Buffer(original) => Descriptor::Buffer(buffer(original)),
            Descriptor::Image(original) => Descriptor::Image(image(original)),
            Descriptor::ImageSampler(original, sampler) => {
                Descriptor::ImageSampler(image(original), sampler.clone())
            }
            other => other.clone(),
        });
        descriptors.insert(binding, copies.collect());
    }
    let memory = resources.memory.with_buffers(buffer);
    let printed = resources.printed.as_ref().map(|_| Arc::default());
    let (push_constants, policy) = (resources.push_constants.clone(), resources.policy);
    let printed_bytes = resources.printed_bytes;
    Resources { descriptors, push_constants, memory, printed, printed_bytes, policy }
}

/// The copy of an original, made at its first appearance.
fn once<T>(copies: &mut Vec<(Arc<T>, Arc<T>)>, original: &Arc<T>, copy: impl FnOnce() -> Arc<T>) -> Arc<T> {
    if let Some((_, known)) = copies.iter().find(|(known, _)| Arc::ptr_eq(known, original)) {
        return known.clone();
    }
    let copy = copy();
    copies.push((original.clone(), copy.clone()));
    copy
}
