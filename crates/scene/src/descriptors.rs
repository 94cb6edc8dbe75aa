//! Checks that a scene binds the descriptor types that its shaders declare.

use crate::ResolvedScene;
use crate::file::MissingDescriptors;
use crate::pass::OwnBinding;
use crate::resolved::ResolvedBinding;
use crate::resources::Resource;
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_base::escape;
use anyhit_base::input::InputLimit;
use anyhit_engine::machine::Binding;
use anyhit_engine::program::Program;
use anyhit_engine::program::descriptors::{DescriptorType, declared, list, missing};
use anyhit_engine::reflect::Layout;
use anyhit_engine::reflect::lookup::{DataBlock, find_block};

/// The errors for bindings whose resources have types that the shaders do not declare.
///
/// For an array with elements of several types, one type must be declared by some variable
/// (`VK_DESCRIPTOR_TYPE_MUTABLE_EXT`).
pub(super) fn mismatches<'a>(
    scene: &ResolvedScene,
    programs: impl Iterator<Item = &'a Program>,
) -> Vec<Error> {
    let mut errors: Vec<Error> = Vec::new();
    let mut reported: Vec<Binding> = Vec::new();
    for program in programs {
        for slot in &program.slots {
            let bound = || {
                let here = scene.resources.iter();
                here.filter(|one| one.declared_at() == slot.binding)
            };
            let declared = declared(&program.module, slot.binding);
            let is_compatible = |one: &Resource| declared.iter().any(|kind| is_compatible(*kind, one));
            let Some(first) =
                bound().next().filter(|_| !declared.is_empty() && !reported.contains(&slot.binding))
            else {
                continue;
            };
            if bound().any(|one| is_compatible(&one.resource)) {
                continue;
            }
            reported.push(slot.binding);
            errors.push(mismatch(program, slot.binding, first));
        }
    }
    errors
}

/// The error for a resource of a type that a program does not declare at a binding.
pub(super) fn mismatch(program: &Program, at: Binding, bound: &ResolvedBinding) -> Error {
    let declared = declared(&program.module, at);
    let types: Vec<_> = declared.iter().map(|ty| format!("`{}`", ty.name())).collect();
    let slot = program.slots.iter().find(|slot| slot.binding == at);
    let message = format!(
        "{} `{}` declares `{}` ({at}) as {}",
        program.stage.name(),
        program.name,
        slot.map_or("", |slot| slot.name.as_str()),
        types.join(" or ")
    );
    let rule = match program.workgroup {
        Some(_) => "VUID-VkComputePipelineCreateInfo-layout-07990",
        None => "VUID-VkRayTracingPipelineCreateInfoKHR-layout-07990",
    };
    Error::new(ErrorKind::InvalidScene, message).at(bound.place.clone()).note(rule)
}

/// Notes on storage buffers that end in a part of an element: the shader's runtime array has only
/// those elements that fit, without a word. `of_passes` returns the own bindings of each pass that
/// runs a program.
pub(super) fn stride_notes<'a>(
    scene: &ResolvedScene,
    programs: impl Iterator<Item = &'a Program>,
    of_passes: &dyn Fn(&Program) -> Vec<&'a [OwnBinding]>,
) -> Vec<String> {
    let mut notes: Vec<String> = Vec::new();
    for program in programs {
        let module = &*program.module;
        let own_bindings = of_passes(program);
        for slot in &program.slots {
            let kept = |own: &&[OwnBinding]| {
                own.iter().find(|own| own.at == slot.binding).map_or(slot.binding, |own| own.kept)
            };
            let here = |one: &&ResolvedBinding| own_bindings.iter().any(|own| kept(own) == one.kept_at());
            let block = find_block(module, DataBlock::Buffer(slot.binding)).ok().flatten();
            let Some((start, stride)) =
                block.and_then(Layout::runtime_stride).filter(|(_, stride)| *stride > 0)
            else {
                continue;
            };
            for bound in scene.resources.iter().filter(here) {
                if !is_compatible(DescriptorType::StorageBuffer, &bound.resource) {
                    continue;
                }
                let Ok(Some(size)) = bound.resource.buffer_size() else { continue };
                let behind = (size as usize).saturating_sub(start);
                let (whole, odd) = (behind / stride, behind % stride);
                if odd == 0 {
                    continue;
                }
                let plural = if whole == 1 { "" } else { "s" };
                let header = match start {
                    0 => String::new(),
                    start => format!("{start} bytes before the array, "),
                };
                let note = format!(
                    "{}the buffer `{}` ({}) has {} bytes: {header}{whole} \
                     element{plural} of {stride} and {odd} left over, which no index into `{}` reaches",
                    line_of(&bound.place),
                    bound.name,
                    bound.declared_at(),
                    size,
                    slot.name,
                );
                if !notes.contains(&note)
                    && (notes.len() as u64) < scene.files.limits.get(InputLimit::ErrorsShown)
                {
                    notes.push(note);
                }
            }
        }
    }
    notes
}

/// A note on the descriptors that shaders use and the scene does not bind, where an access to one
/// traps.
pub(super) fn missing_note<'a>(
    scene: &ResolvedScene,
    programs: impl Iterator<Item = &'a Program>,
) -> Option<String> {
    if scene.missing_descriptors == MissingDescriptors::Zeros {
        return None;
    }
    let bound = |at: Binding| {
        let here = scene.resources.iter();
        let here = here.filter(|one| one.declared_at() == at);
        here.map(|one| kind(&one.resource)).collect()
    };
    let missing = missing(programs, bound);
    (!missing.is_empty()).then(|| {
        format!(
            "{}: the scene binds nothing to {}; an access traps unless [pipeline] sets `unbound = \
             \"zeros\"`",
            escape::path(&scene.path),
            list(&missing)
        )
    })
}

/// The file and line of a place, before a note.
pub(super) fn line_of(place: &Place) -> String {
    place.file_line().map_or_else(String::new, |(file, line)| format!("{file}:{line}: "))
}

/// The kind of descriptor that a resource becomes, as `Descriptor::kind` says it.
fn kind(bound: &Resource) -> &'static str {
    match bound {
        Resource::StorageBuffer(_)
        | Resource::UniformBuffer(_)
        | Resource::BufferView(_)
        | Resource::NullBuffer => "a buffer",
        Resource::StorageImage(_) | Resource::SampledImage(_) | Resource::TexelBuffer(_) => "an image",
        Resource::Sampler(_) => "a sampler",
        Resource::CombinedImageSampler(..) => "an image with a sampler",
        Resource::AccelerationStructure(_) | Resource::NullAccelerationStructure => {
            "an acceleration structure"
        }
    }
}

/// Whether a resource may be bound where a descriptor type is declared.
pub(super) fn is_compatible(declared: DescriptorType, bound: &Resource) -> bool {
    match bound {
        Resource::StorageBuffer(_) => declared == DescriptorType::StorageBuffer,
        Resource::UniformBuffer(_) => declared == DescriptorType::UniformBuffer,
        Resource::BufferView(view) => match view.kind.is_storage() {
            true => declared == DescriptorType::StorageBuffer,
            false => declared == DescriptorType::UniformBuffer,
        },
        Resource::NullBuffer => {
            matches!(declared, DescriptorType::StorageBuffer | DescriptorType::UniformBuffer)
        }
        Resource::StorageImage(_) => declared == DescriptorType::StorageImage,
        Resource::SampledImage(_) => declared == DescriptorType::SampledImage,
        Resource::TexelBuffer(_) => {
            matches!(declared, DescriptorType::UniformTexelBuffer | DescriptorType::StorageTexelBuffer)
        }
        Resource::Sampler(_) => declared == DescriptorType::Sampler,
        // Image and sampler may also be declared separately.
        Resource::CombinedImageSampler(..) => {
            matches!(
                declared,
                DescriptorType::CombinedImageSampler | DescriptorType::SampledImage | DescriptorType::Sampler
            )
        }
        Resource::AccelerationStructure(_) | Resource::NullAccelerationStructure => {
            declared == DescriptorType::AccelerationStructure
        }
    }
}
