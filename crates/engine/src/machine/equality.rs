//! Equality of what is bound, by value: two runs that leave the same bytes left the same.

use std::sync::Arc;

use crate::machine::device_memory::{buffers_equal, structures_equal};
use crate::machine::image::Image;
use crate::machine::resource::{Descriptor, Resources};

impl Resources {
    /// Returns whether the same is bound at the same bindings: buffers, push constants and images
    /// with equal contents, equal samplers, and structures of equal instances.
    pub fn has_equal_contents(&self, other: &Self) -> bool {
        let (own, others) = (&self.descriptors, &other.descriptors);
        own.len() == others.len()
            && own
                .iter()
                .zip(others.iter())
                .all(|((at, own), (other_at, others))| at == other_at && all_equal(own, others))
            && match (&self.push_constants, &other.push_constants) {
                (Some(own), Some(other)) => buffers_equal(own, other),
                (own, other) => own.is_none() && other.is_none(),
            }
            && self.memory.has_equal_contents(&other.memory)
    }
}

fn all_equal(own: &[Descriptor], others: &[Descriptor]) -> bool {
    own.len() == others.len() && own.iter().zip(others).all(|(own, other)| descriptors_equal(own, other))
}

fn descriptors_equal(own: &Descriptor, other: &Descriptor) -> bool {
    match (own, other) {
        (Descriptor::Buffer(own), Descriptor::Buffer(other)) => buffers_equal(own, other),
        (Descriptor::Image(own), Descriptor::Image(other)) => images_equal(own, other),
        (Descriptor::Sampler(own), Descriptor::Sampler(other)) => own == other,
        (Descriptor::ImageSampler(own, sampler), Descriptor::ImageSampler(other, other_sampler)) => {
            sampler == other_sampler && images_equal(own, other)
        }
        (Descriptor::AccelerationStructure(own), Descriptor::AccelerationStructure(other)) => {
            structures_equal(own, other)
        }
        (Descriptor::Mutable(own), Descriptor::Mutable(other)) => all_equal(own, other),
        (Descriptor::Unbound, Descriptor::Unbound) => true,
        _ => false,
    }
}

fn images_equal(own: &Arc<Image>, other: &Arc<Image>) -> bool {
    own.is_null() == other.is_null() && own.has_equal_texels(other)
}
