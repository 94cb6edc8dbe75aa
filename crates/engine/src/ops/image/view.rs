//! The image type that a shader declares, and the image that is bound to it.

use crate::machine::format::{Class, Format};
use crate::machine::image::{Dimension, Image};
use crate::machine::{AccessFault, Bindings, Descriptor, TrapCode};
use crate::module::Module;
use crate::module::ty::{ImageType, Type};
use crate::ops::memory::OUT_OF_BOUNDS;
use anyhit_base::error::Result;

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
    /// `Image Format`; `None` for `Unknown`.
    pub format: Option<Format>,
}

impl View {
    /// The view that an image type declares; `None` for one that no operation supports.
    pub fn of(module: &Module, image: &ImageType) -> Option<Self> {
        let (class, width) = match *module.ty(image.sampled_type) {
            Type::Float { width, .. } => (Class::Float, width),
            Type::Int { width, signed: true } => (Class::Sint, width),
            Type::Int { width, signed: false } => (Class::Uint, width),
            _ => return None,
        };
        Some(Self {
            dimension: dimension(image)?,
            multisampled: image.multisampled,
            class,
            wide: width == 64,
            format: Format::declared(image.format),
        })
    }

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

    /// The image with a handle, for an operation that reads or writes its texels.
    ///
    /// # Errors
    /// As [`View::image`], and `ImageUnreadable`.
    pub fn texels(self, bindings: &Bindings, handle: u32) -> Result<&Image, TrapCode> {
        let image = self.image(bindings, handle)?;
        if image.failure().is_some() { Err(TrapCode::ImageUnreadable) } else { Ok(image) }
    }

    /// What is told of the image with a handle where an operation cannot use it.
    #[cold]
    pub fn fault(self, bindings: &Bindings, handle: u32) -> AccessFault {
        let image = bindings.descriptor(handle).and_then(|descriptor| {
            descriptor.find(|descriptor| match descriptor {
                Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => Some(&**image),
                _ => None,
            })
        });
        match image.filter(|image| !self.is_compatible(image)) {
            Some(image) => {
                let (shape, format) = (image.shape(), image.format());
                let declared = describe(self.dimension, self.multisampled, self.class, self.wide);
                let bound = describe(shape.dimension, shape.samples > 1, format.class(), format.is_wide());
                AccessFault::ImageKind { handle, declared, bound }
            }
            None => match image.and_then(Image::failure) {
                Some(failure) => AccessFault::ImageFile(failure.clone()),
                None => AccessFault::descriptor(handle, bindings),
            },
        }
    }

    /// Returns how an image view of a format contradicts the declaration, in words for both; `None`
    /// where they agree (Vulkan, "Instruction/Format/Sampler/Image View Validation").
    pub fn contradiction(self, bound: Format) -> Option<[String; 2]> {
        if let Some(declared) = self.format.filter(|&declared| declared != bound) {
            return Some([declared, bound].map(|format| format!("the format {}", format.name())));
        }
        let differs = self.class != bound.class() || self.wide != bound.is_wide();
        let kinds = [(self.class, self.wide), (bound.class(), bound.is_wide())];
        differs.then(|| kinds.map(|(class, wide)| numbers(class, wide).to_owned()))
    }

    fn is_compatible(self, image: &Image) -> bool {
        let (shape, format) = (image.shape(), image.format());
        shape.dimension == self.dimension
            && (shape.samples > 1) == self.multisampled
            && (format.class() == Class::Float) == (self.class == Class::Float)
            && (self.wide || !format.is_wide())
    }
}

/// The kind of an image in words: `a 2D image of floats`.
fn describe(dimension: Dimension, multisampled: bool, class: Class, wide: bool) -> String {
    let shape = match dimension {
        Dimension::D1 => "1D image",
        Dimension::D1Array => "1D array",
        Dimension::D2 => "2D image",
        Dimension::D2Array => "2D array",
        Dimension::D3 => "3D image",
        Dimension::Cube => "cube",
        Dimension::CubeArray => "array of cubes",
        Dimension::Buffer => "texel buffer",
    };
    let article = if dimension == Dimension::CubeArray { "an" } else { "a" };
    let samples = if multisampled { ", multisampled," } else { "" };
    format!("{article} {shape}{samples} of {}", numbers(class, wide))
}

/// The numbers of texels in words.
fn numbers(class: Class, wide: bool) -> &'static str {
    match (class, wide) {
        (Class::Float, false) => "floats",
        (Class::Float, true) => "64-bit floats",
        (Class::Sint, false) => "signed integers",
        (Class::Uint, false) => "unsigned integers",
        (Class::Sint, true) => "signed 64-bit integers",
        (Class::Uint, true) => "unsigned 64-bit integers",
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::format::Component;

    /// Vulkan, "Compatibility Between SPIR-V Image Formats and Vulkan Formats": one format each.
    /// VUID-vkCmdDispatch-format-07753: the numeric types are the same.
    #[test]
    fn a_view_has_the_declared_format_and_type_of_numbers() {
        let view = |class, format| View {
            dimension: Dimension::D2,
            multisampled: false,
            class,
            wide: false,
            format,
        };
        let [r32f, rgba8] = [Format::new(Component::Float32, 1), Format::new(Component::Unorm8, 4)];
        let [r32i, r32ui] = [Component::Sint32, Component::Uint32].map(|component| Format::new(component, 1));
        let r64ui = Format::new(Component::Uint64, 1);
        let words = |one: &str, other: &str| Some([one.to_owned(), other.to_owned()]);
        assert_eq!(view(Class::Float, Some(r32f)).contradiction(r32f), None);
        assert_eq!(view(Class::Float, None).contradiction(rgba8), None);
        let formats = words("the format r32f", "the format rgba8");
        assert_eq!(view(Class::Float, Some(r32f)).contradiction(rgba8), formats);
        let numbers = words("unsigned integers", "signed integers");
        assert_eq!(view(Class::Uint, None).contradiction(r32i), numbers);
        assert_eq!(view(Class::Uint, None).contradiction(r32ui), None);
        let widths = words("unsigned 64-bit integers", "unsigned integers");
        assert_eq!(View { wide: true, ..view(Class::Uint, None) }.contradiction(r32ui), widths);
        assert_eq!(View { wide: true, ..view(Class::Uint, Some(r64ui)) }.contradiction(r64ui), None);
    }

    #[test]
    fn kinds_of_images_are_told_in_words() {
        let words = [
            describe(Dimension::D2, false, Class::Float, false),
            describe(Dimension::D2Array, true, Class::Uint, false),
            describe(Dimension::CubeArray, false, Class::Sint, true),
        ];
        let wanted = [
            "a 2D image of floats",
            "a 2D array, multisampled, of unsigned integers",
            "an array of cubes of signed 64-bit integers",
        ];
        assert_eq!(words, wanted);
    }
}
