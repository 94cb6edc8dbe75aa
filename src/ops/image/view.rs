//! The image type that a shader declares, and the image that is bound to it.

use crate::error::Result;
use crate::machine::format::Class;
use crate::machine::image::{Dimension, Image};
use crate::machine::{Bindings, Descriptor, TrapCode};
use crate::module::ty::ImageType;
use crate::ops::memory::OUT_OF_BOUNDS;

/// The image type (`OpTypeImage`) that a shader declares, as far as operations need it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct View {
    /// `Dim` and `Arrayed`.
    pub dimension: Dimension,
    /// `MS`.
    pub multisampled: bool,
    /// `Sampled Type`.
    pub class: Class,
    /// Whether `Sampled Type` has 64 bits.
    pub wide: bool,
}

impl View {
    /// The image with a handle.
    ///
    /// The image's own format is used, whatever `Image Format` says, as long as both are floats or
    /// both integers; the signedness of integers may differ, the bits are then kept.
    ///
    /// # Errors
    /// `DescriptorMissing`, `IndexOutOfBounds` for an index outside its array of descriptors, or
    /// `ImageMismatch` where the image is of another kind than declared.
    pub fn image(self, bindings: &Bindings, handle: u32) -> Result<&Image, TrapCode> {
        let missing = TrapCode::DescriptorMissing;
        let outside = handle == OUT_OF_BOUNDS;
        let descriptor =
            bindings.descriptor(handle).ok_or(if outside { TrapCode::IndexOutOfBounds } else { missing })?;
        let image = |descriptor| match descriptor {
            &Descriptor::Image(ref image) | &Descriptor::ImageSampler(ref image, _) => Some(&**image),
            _ => None,
        };
        let compatible = |descriptor| image(descriptor).filter(|image| self.is_compatible(image));
        match descriptor.find(compatible) {
            Some(image) => Ok(image),
            None if descriptor.find(image).is_some() => Err(TrapCode::ImageMismatch),
            None => Err(missing),
        }
    }

    fn is_compatible(self, image: &Image) -> bool {
        let (shape, format) = (image.shape(), image.format());
        shape.dimension == self.dimension
            && (shape.samples > 1) == self.multisampled
            && (format.class() == Class::Float) == (self.class == Class::Float)
            && (self.wide || !format.is_wide())
    }
}

/// The dimension of an image type (`Dim` and `Arrayed`); `None` where no image has it.
pub fn dimension(image: &ImageType) -> Option<Dimension> {
    Some(match (image.dim, image.arrayed) {
        (0, false) => Dimension::D1,
        (0, true) => Dimension::D1Array,
        (1, false) => Dimension::D2,
        (1, true) => Dimension::D2Array,
        (2, false) => Dimension::D3,
        (3, false) => Dimension::Cube,
        (3, true) => Dimension::CubeArray,
        (5, false) => Dimension::Buffer,
        _ => return None,
    })
}
