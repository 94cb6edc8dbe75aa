//! Checks the formats of bound images against the image types that shaders declare.

use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::machine::format::{Class, Component, Format};
use anyhit_engine::machine::image::Image;
use anyhit_engine::machine::{Binding, Bindings, Descriptor, Reg, Resources};
use anyhit_engine::ops::image::declared::declared_format;
use anyhit_engine::ops::image::view::View;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::translate::Slot;
use anyhit_engine::program::Program;
use anyhit_engine::program::descriptors::image_of_slot;

/// Compares every image that is bound with what a shader declares.
///
/// # Errors
/// `InvalidArgument` for the first format that contradicts the declaration, with both.
pub(super) fn check(program: &Program, resources: &Resources) -> Result<()> {
    for slot in &program.slots {
        let Some(elements) = resources.descriptors.get(&slot.binding) else { continue };
        for (element, descriptor) in elements.iter().enumerate() {
            let images = || descriptor.kinds().iter().filter_map(image).filter(|image| !image.is_null());
            let mistake = |image: &Image| mistake(program, slot, element, image.format());
            if images().any(|image| mistake(image).is_none()) {
                continue;
            }
            if let Some(error) = images().find_map(mistake) {
                return Err(error);
            }
        }
    }
    Ok(())
}

/// Compares the format of an image that the launch itself binds with what a shader declares.
///
/// # Errors
/// As [`check`].
pub(super) fn check_format(program: &Program, binding: Binding, format: Format) -> Result<()> {
    format.check()?;
    let slots = program.slots.iter().filter(|slot| slot.binding == binding);
    slots.filter_map(|slot| mistake(program, slot, 0, format)).next().map_or(Ok(()), Err)
}

fn image(descriptor: &Descriptor) -> Option<&Image> {
    match descriptor {
        Descriptor::Image(image) | Descriptor::ImageSampler(image, _) => Some(image),
        _ => None,
    }
}

fn mistake(program: &Program, slot: &Slot, element: usize, format: Format) -> Option<Error> {
    let ty = image_of_slot(program, slot)?;
    let view = View::of(&program.module, &ty)?;
    let [declared, bound] = view.contradiction(format)?;
    if extends(program, slot, view, format) {
        return None;
    }
    let Binding { set, binding } = slot.binding;
    let name = if slot.name.is_empty() { String::new() } else { format!(" (`{}`)", slot.name) };
    let element = if element == 0 { String::new() } else { format!(", element {element}") };
    let format = format.name();
    let bound = if bound.starts_with("the format") { bound } else { format!("{bound} ({format})") };
    let message = format!(
        "the image at set {set}, binding {binding}{element} has {bound}, but the shader declares \
         {declared}{name}"
    );
    let write = written(declared_format(&program.module, &ty));
    let how = match view.format {
        Some(_) => format!("create the image with `{write}`"),
        None => format!("create the image with a format of {declared}, such as `{write}`"),
    };
    Some(Error::new(ErrorKind::InvalidArgument, message).note(how))
}

/// Returns whether an operation reads or writes the image as integers of the other sign
/// (`SignExtend`, `ZeroExtend`), and so as those of a format.
fn extends(program: &Program, slot: &Slot, view: View, format: Format) -> bool {
    if view.class == Class::Float || format.class() == Class::Float {
        return false;
    }
    let number = program.slots.iter().position(|one| std::ptr::eq(one, slot));
    // A handle that is no constant is that of an array's element, of any slot.
    let is_of_slot = |handle: Reg| {
        let constant = program.constants.iter().find(|(register, _)| *register == handle);
        constant.is_none_or(|(_, handle)| Bindings::slot_of(*handle).map(|(slot, _)| slot) == number)
    };
    program.ops.iter().any(|op| match op {
        Op::Image(op) => op.accessed_view().is_some_and(|(handle, other)| {
            other.dimension == view.dimension
                && other.class != view.class
                && other.contradiction(format).is_none()
                && is_of_slot(handle)
        }),
        _ => false,
    })
}

/// A format as Rust code writes it.
fn written(format: Format) -> String {
    if format == Format::new(Component::Float32, 4) {
        return "Format::RGBA32F".to_owned();
    }
    format!("Format::new(Component::{:?}, {})", format.component, format.channels)
}
