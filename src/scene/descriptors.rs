//! Checks that a scene binds the descriptor types that its shaders declare.

use crate::error::{Error, ErrorKind, Place};
use crate::input::InputLimit;
use crate::machine::Binding;
use crate::module::Module;
use crate::module::ty::{Type, TypeId};
use crate::ops::pointer::storage;
use crate::program::Program;
use crate::scene::ResolvedScene;
use crate::scene::layout::Layout;
use crate::scene::resolved::ResolvedBinding;
use crate::scene::resources::{DescriptorKind, Resource};
use crate::scene::struct_lookup::{DataBlock, find_block};

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
                here.filter(|one| Binding { set: one.set, binding: one.binding } == slot.binding)
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
            let Binding { set, binding } = slot.binding;
            let names: Vec<_> = declared.iter().map(|kind| format!("`{}`", name(*kind))).collect();
            let message = format!(
                "{} `{}` declares `{}` (set {set}, binding {binding}) as {}",
                program.stage.name(),
                program.name,
                slot.name,
                names.join(" or ")
            );
            let rule = match program.workgroup {
                Some(_) => "VUID-VkComputePipelineCreateInfo-layout-07990",
                None => "VUID-VkRayTracingPipelineCreateInfoKHR-layout-07990",
            };
            errors.push(Error::new(ErrorKind::InvalidScene, message).at(first.place.clone()).note(rule));
        }
    }
    errors
}

/// Notes on storage buffers that end in a part of an element: the shader's runtime array has only
/// those elements that fit, without a word.
pub(super) fn stride_notes<'a>(
    scene: &ResolvedScene,
    programs: impl Iterator<Item = &'a Program>,
) -> Vec<String> {
    let mut notes: Vec<String> = Vec::new();
    for program in programs {
        let module = &*program.module;
        for slot in &program.slots {
            let here =
                |one: &&ResolvedBinding| Binding { set: one.set, binding: one.binding } == slot.binding;
            let block = find_block(module, DataBlock::Buffer(slot.binding)).ok().flatten();
            let Some((start, stride)) =
                block.and_then(Layout::runtime_stride).filter(|(_, stride)| *stride > 0)
            else {
                continue;
            };
            for bound in scene.resources.iter().filter(here) {
                if !is_compatible(DescriptorKind::StorageBuffer, &bound.resource) {
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
                    "{}the buffer `{}` (set {}, binding {}) has {} bytes: {header}{whole} element{plural} of {stride} \
                     and {odd} left over, which no index of `{}` reaches",
                    line_of(&bound.place),
                    bound.name,
                    bound.set,
                    bound.binding,
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

/// The file and line of a place, before a note.
fn line_of(place: &Place) -> String {
    let Place::Text { file, text, span } = place else { return String::new() };
    format!("{file}:{}: ", text[..span.start].matches('\n').count() + 1)
}

/// The descriptor types of a module's variables at a binding.
fn declared(module: &Module, binding: Binding) -> Vec<DescriptorKind> {
    let at = |id| {
        let number = |decoration| module.decorations.literal(id, decoration);
        number(34) == Some(binding.set) && number(33) == Some(binding.binding)
    };
    let mut kinds = Vec::new();
    for variable in module.variables.iter().filter(|variable| at(variable.id)) {
        let Type::Pointer { pointee: Some(ty), .. } = *module.ty(variable.pointer) else { continue };
        if let Some(kind) = kind(module, variable.storage_class, ty)
            && !kinds.contains(&kind)
        {
            kinds.push(kind);
        }
    }
    kinds
}

fn kind(module: &Module, storage_class: u32, mut ty: TypeId) -> Option<DescriptorKind> {
    while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = module.ty(ty) {
        ty = *element;
    }
    let image = |ty: TypeId, with_sampler| {
        let Type::Image(image) = module.ty(ty) else { return None };
        Some(match (image.dim, image.sampled) {
            (BUFFER, 2) => DescriptorKind::StorageTexelBuffer,
            (BUFFER, _) => DescriptorKind::UniformTexelBuffer,
            (_, 2) => DescriptorKind::StorageImage,
            _ if with_sampler => DescriptorKind::CombinedImageSampler,
            _ => DescriptorKind::SampledImage,
        })
    };
    match (storage_class, module.ty(ty)) {
        (storage::STORAGE_BUFFER, _) | (storage::UNIFORM, Type::Struct { buffer_block: true, .. }) => {
            Some(DescriptorKind::StorageBuffer)
        }
        (storage::UNIFORM, _) => Some(DescriptorKind::UniformBuffer),
        (_, Type::Image(_)) => image(ty, false),
        (_, Type::SampledImage(of)) => image(*of, true),
        (_, Type::Sampler) => Some(DescriptorKind::Sampler),
        (_, Type::AccelerationStructure) => Some(DescriptorKind::AccelerationStructure),
        _ => None,
    }
}

/// `Dim` of texel buffers.
const BUFFER: u32 = 5;

/// Whether a resource may be bound where a descriptor type is declared.
fn is_compatible(declared: DescriptorKind, bound: &Resource) -> bool {
    match bound {
        Resource::StorageBuffer(_) => declared == DescriptorKind::StorageBuffer,
        Resource::UniformBuffer(_) => declared == DescriptorKind::UniformBuffer,
        Resource::BufferView(view) => declared == view.kind.declared(),
        Resource::NullBuffer => {
            matches!(declared, DescriptorKind::StorageBuffer | DescriptorKind::UniformBuffer)
        }
        Resource::StorageImage(_) => declared == DescriptorKind::StorageImage,
        Resource::SampledImage(_) => declared == DescriptorKind::SampledImage,
        Resource::TexelBuffer(_) => {
            matches!(declared, DescriptorKind::UniformTexelBuffer | DescriptorKind::StorageTexelBuffer)
        }
        Resource::Sampler(_) => declared == DescriptorKind::Sampler,
        // Image and sampler may also be declared separately.
        Resource::CombinedImageSampler(..) => {
            matches!(
                declared,
                DescriptorKind::CombinedImageSampler | DescriptorKind::SampledImage | DescriptorKind::Sampler
            )
        }
        Resource::AccelerationStructure(_) | Resource::NullAccelerationStructure => {
            declared == DescriptorKind::AccelerationStructure
        }
    }
}

/// The name of a descriptor type in scene files.
fn name(kind: DescriptorKind) -> &'static str {
    use crate::scene::read::Named;
    DescriptorKind::NAMES.iter().find(|(_, known)| *known == kind).map_or("", |(name, _)| name)
}
