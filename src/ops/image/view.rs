//! The image type that a shader declares, and the image that is bound to it.

use crate::error::Result;
use crate::machine::format::Class;
use crate::machine::image::{Dimension, Image};
use crate::machine::{Bindings, Descriptor, TrapCode};
use crate::module::Id;
use crate::module::ty::{ImageType, Type, TypeId};
use crate::ops::memory::OUT_OF_BOUNDS;
use crate::ops::translate::Translator;

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

/// The view that the type of an image or sampled image declares.
pub fn view_of(translator: &Translator<'_>, id: Id) -> Result<View> {
    view(translator, &image_type(translator, id)?)
}

/// Checks the type of a texel that is read or written against the image's `Sampled Type`.
///
/// # Errors
/// `InvalidModule` where they differ.
pub fn check_texel(translator: &Translator<'_>, image: Id, texel: TypeId) -> Result<()> {
    let sampled = image_type(translator, image)?.sampled_type;
    let component = match *translator.module.ty(texel) {
        Type::Vector { component, .. } => component,
        _ => texel,
    };
    if component == sampled || *translator.module.ty(sampled) == Type::Void {
        return Ok(());
    }
    let [texel, sampled] = [texel, sampled].map(|ty| translator.module.describe_type(ty));
    let message = format!("a texel of type {texel} of an image whose Sampled Type is {sampled}");
    Err(translator.invalid(message).note("SPIR-V 3.3.10: its components are the same as Sampled Type"))
}

fn image_type(translator: &Translator<'_>, id: Id) -> Result<ImageType> {
    let mut ty = translator.type_of(id)?;
    if let Type::Pointer { pointee: Some(pointee), .. } = *translator.module.ty(ty) {
        ty = pointee;
    }
    if let Type::SampledImage(image) = *translator.module.ty(ty) {
        ty = image;
    }
    match *translator.module.ty(ty) {
        Type::Image(image) => Ok(image),
        _ => Err(translator.invalid(format!("%{} is no image", id.0))),
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

fn view(translator: &Translator<'_>, image: &ImageType) -> Result<View> {
    let dimension = match (image.dim, dimension(image)) {
        (_, Some(dimension)) => dimension,
        (4, _) => return Err(translator.unsupported("images of Dim Rect, which Vulkan does not have")),
        (6, _) => return Err(translator.unsupported("subpass images, which only fragment stages have")),
        (dim, None) => {
            let arrayed = if image.arrayed { ", arrayed" } else { "" };
            return Err(translator.unsupported(format!("images of Dim {dim}{arrayed}")));
        }
    };
    // No such image can be created, so nothing could be bound.
    if image.multisampled && !matches!(dimension, Dimension::D2 | Dimension::D2Array) {
        let message = "a multisampled image of another dimension than 2D";
        return Err(translator.unsupported(message).note("VUID-VkImageCreateInfo-samples-02257"));
    }
    let (class, width) = match *translator.module.ty(image.sampled_type) {
        Type::Float { width, encoding: None } => (Class::Float, width),
        Type::Int { width, signed: true } => (Class::Sint, width),
        Type::Int { width, signed: false } => (Class::Uint, width),
        _ => {
            return Err(translator
                .invalid("a Sampled Type that is no number (VUID-StandaloneSpirv-OpTypeImage-04656)"));
        }
    };
    if width != 32 && !(width == 64 && class != Class::Float) {
        return Err(translator.unsupported(format!(
            "a Sampled Type of {width} bits (VUID-StandaloneSpirv-OpTypeImage-04656 has 32, and 64-bit integers)"
        )));
    }
    Ok(View { dimension, multisampled: image.multisampled, class, wide: width == 64 })
}
