//! What instructions declare of their images and texels.

use crate::machine::Reg;
use crate::machine::format::{Class, Component, Format};
use crate::machine::image::Dimension;
use crate::module::ty::{ImageType, Type, TypeId};
use crate::module::{Id, Instruction, Module};
use crate::ops::image::TexelRegisters;
use crate::ops::image::view::{View, dimension};
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// Allocates the registers of an instruction's texel and defines its result; a sparse texel follows
/// its residency code. `checked` says that it comes from the image of operand 0.
pub(super) fn texel_result(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    sparse: bool,
    checked: bool,
) -> Result<TexelRegisters> {
    let mut ty = translator.result_type(instruction)?;
    let mut words = Words::new();
    if sparse {
        ty = match translator.module.ty(ty) {
            Type::Struct { members, .. } if members.len() == 2 => members[1].ty,
            _ => {
                return Err(translator.invalid(
                    "the result of a sparse image instruction must be a struct \
                     of a residency code and a texel",
                ));
            }
        };
        words.push(translator.constant(0)?);
    }
    if checked {
        check_texel(translator, translator.id(instruction, 0)?, ty)?;
    }
    let width = translator.scalar_width(ty)?;
    let texel = TexelRegisters { to: Reg(0), count: translator.component_count(ty), wide: width == 64 };
    if texel.count > 4 {
        return Err(translator.invalid("a texel must have at most four components"));
    }
    let texel = TexelRegisters { to: translator.fresh(texel.registers())?, ..texel };
    words.extend((0..texel.registers()).map(|register| texel.to.plus(register)));
    translator.define_result(instruction, words);
    Ok(texel)
}

/// The format that an image is declared with, or one of the same kind of numbers.
pub fn declared_format(module: &Module, image: &ImageType) -> Format {
    let (component, channels) = match *module.ty(image.sampled_type) {
        Type::Int { width: 64, signed: true } => (Component::Sint64, 1),
        Type::Int { width: 64, signed: false } => (Component::Uint64, 1),
        Type::Int { signed: true, .. } => (Component::Sint32, 4),
        Type::Int { signed: false, .. } => (Component::Uint32, 4),
        _ => (Component::Float32, 4),
    };
    Format::declared(image.format).unwrap_or(Format::new(component, channels))
}

/// The view that the type of an image or sampled image declares.
pub fn view_of(translator: &Translator<'_>, id: Id) -> Result<View> {
    view(translator, &image_type(translator, id)?)
}

/// The view that an image type declares.
pub fn view_of_type(translator: &Translator<'_>, id: Id) -> Result<(TypeId, View)> {
    match translator.module.type_with_id(id).map(|ty| (ty, translator.module.ty(ty))) {
        Some((ty, Type::Image(image))) => Ok((ty, view(translator, image)?)),
        _ => Err(translator.invalid(format!("%{} is not the type of an image", id.0))),
    }
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
    let message = format!("the texel type {texel} does not match the image's Sampled Type {sampled}");
    Err(translator.invalid(message).note("SPIR-V 3.3.10: its components must have the Sampled Type"))
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
        _ => Err(translator.invalid(format!("%{} is not an image", id.0))),
    }
}

fn view(translator: &Translator<'_>, image: &ImageType) -> Result<View> {
    let dimension = match (image.dim, dimension(image)) {
        (_, Some(dimension)) => dimension,
        (4, _) => {
            return Err(
                translator.unsupported("images of Dim Rect are not supported: Vulkan does not have them")
            );
        }
        (6, _) => {
            return Err(
                translator.unsupported("subpass images are not supported: only fragment stages have them")
            );
        }
        (dim, None) => {
            let arrayed = if image.arrayed { " (arrayed)" } else { "" };
            return Err(translator.unsupported(format!("images of Dim {dim}{arrayed} are not supported")));
        }
    };
    // No such image can be created, so nothing could be bound.
    if image.multisampled && !matches!(dimension, Dimension::D2 | Dimension::D2Array) {
        let message = "multisampled images of other dimensions than 2D are not supported";
        return Err(translator.unsupported(message).note("VUID-VkImageCreateInfo-samples-02257"));
    }
    let (class, width) = match *translator.module.ty(image.sampled_type) {
        Type::Float { width, encoding: None } => (Class::Float, width),
        Type::Int { width, signed: true } => (Class::Sint, width),
        Type::Int { width, signed: false } => (Class::Uint, width),
        _ => {
            return Err(translator.invalid(
                "the Sampled Type of an image is not a number (VUID-StandaloneSpirv-OpTypeImage-04656)",
            ));
        }
    };
    if width != 32 && !(width == 64 && class != Class::Float) {
        return Err(translator.unsupported(format!(
            "a Sampled Type of {width} bits is not supported (VUID-StandaloneSpirv-OpTypeImage-04656 \
             allows 32 bits, and 64-bit integers)"
        )));
    }
    let format = Format::declared(image.format);
    Ok(View { dimension, multisampled: image.multisampled, class, wide: width == 64, format })
}
