//! The kinds of descriptors that a scene can bind.

use crate::read::Named;

/// A descriptor's type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptorKind {
    /// A storage buffer.
    StorageBuffer,
    /// A uniform buffer.
    UniformBuffer,
    /// A storage buffer whose offset is given when its set is bound.
    StorageBufferDynamic,
    /// A uniform buffer whose offset is given when its set is bound.
    UniformBufferDynamic,
    /// A storage image.
    StorageImage,
    /// A sampled image.
    SampledImage,
    /// A texel buffer that is only read.
    UniformTexelBuffer,
    /// A texel buffer that may be written.
    StorageTexelBuffer,
    /// A sampler.
    Sampler,
    /// An image with its sampler.
    CombinedImageSampler,
    /// A TLAS.
    AccelerationStructure,
    /// No descriptor: the data between the descriptors of the resource heap.
    HeapData,
    /// No descriptor: a bank of push constants beside the first one.
    PushConstantBank,
    /// No descriptor: a buffer that shaders reach by its address alone.
    Unbound,
}

impl DescriptorKind {
    /// Whether it is of a buffer's bytes.
    pub fn is_buffer(self) -> bool {
        matches!(self, Self::StorageBuffer | Self::UniformBuffer) || self.is_dynamic()
    }

    /// Whether it is of a buffer that shaders may store to.
    pub fn is_storage(self) -> bool {
        matches!(self, Self::StorageBuffer | Self::StorageBufferDynamic)
    }

    /// Whether the offset of its buffer is given when its set is bound.
    pub fn is_dynamic(self) -> bool {
        matches!(self, Self::StorageBufferDynamic | Self::UniformBufferDynamic)
    }

    /// Whether it is of a buffer's texels.
    pub fn is_texel_buffer(self) -> bool {
        matches!(self, Self::UniformTexelBuffer | Self::StorageTexelBuffer)
    }

    /// Whether it is of an image.
    pub fn is_image(self) -> bool {
        matches!(self, Self::StorageImage | Self::SampledImage | Self::CombinedImageSampler)
    }
}

impl Named for DescriptorKind {
    const WHAT: &'static str = "type of resource";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("storage_buffer", Self::StorageBuffer),
        ("uniform_buffer", Self::UniformBuffer),
        ("storage_buffer_dynamic", Self::StorageBufferDynamic),
        ("uniform_buffer_dynamic", Self::UniformBufferDynamic),
        ("storage_image", Self::StorageImage),
        ("sampled_image", Self::SampledImage),
        ("uniform_texel_buffer", Self::UniformTexelBuffer),
        ("storage_texel_buffer", Self::StorageTexelBuffer),
        ("sampler", Self::Sampler),
        ("combined_image_sampler", Self::CombinedImageSampler),
        ("acceleration_structure", Self::AccelerationStructure),
        ("heap_data", Self::HeapData),
        ("push_constant_bank", Self::PushConstantBank),
        ("buffer", Self::Unbound),
    ];
}
