//! The descriptors that shaders declare: their types, what may stand for them where nothing is
//! bound, and messages about those that are missing.

use std::sync::Arc;

use crate::accel::Tlas;
use crate::machine::format::{Class, Component, Format};
use crate::machine::image::{Dimension, Image, ImageShape};
use crate::machine::sampler::{CompareOp, Sampler};
use crate::machine::{AccessFault, Binding, BindingSummary, Buffer, Descriptor};
use crate::module::ty::{ImageType, Type, TypeId};
use crate::module::{GlobalVariable, Module};
use crate::ops::heap;
use crate::ops::image::view;
use crate::ops::pointer::storage;
use crate::ops::translate::Slot;
use crate::program::Program;
use crate::reflect::heap::{HeapUse, heap_uses};
use anyhit_base::sorted::sort_by_key;

/// The blocks that a program uses: type, storage class and binding.
pub fn declared_blocks(program: &Program) -> impl Iterator<Item = (TypeId, u32, Option<Binding>)> + '_ {
    let module = &*program.module;
    let entry =
        module.entry_points.iter().find(|entry| entry.stage == program.stage && entry.name == program.name);
    let variables = entry.map_or_else(Vec::new, |entry| module.interface_of(entry));
    variables.into_iter().filter_map(|variable| {
        let binding = variable.descriptor_set.zip(variable.binding);
        let ty = variable.ty.filter(|ty| matches!(module.ty(*ty), Type::Struct { .. }))?;
        Some((ty, variable.storage_class, binding.map(|(set, binding)| Binding { set, binding })))
    })
}

/// `VkDescriptorType`, as far as a module tells it: a dynamic buffer is declared like any other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptorType {
    /// `VK_DESCRIPTOR_TYPE_STORAGE_BUFFER`
    StorageBuffer,
    /// `VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER`
    UniformBuffer,
    /// `VK_DESCRIPTOR_TYPE_STORAGE_IMAGE`
    StorageImage,
    /// `VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE`
    SampledImage,
    /// `VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER`
    UniformTexelBuffer,
    /// `VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER`
    StorageTexelBuffer,
    /// `VK_DESCRIPTOR_TYPE_SAMPLER`
    Sampler,
    /// `VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER`
    CombinedImageSampler,
    /// `VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR`
    AccelerationStructure,
}

impl DescriptorType {
    /// The name in scene files: Vulkan's in small letters.
    pub fn name(self) -> &'static str {
        match self {
            Self::StorageBuffer => "storage_buffer",
            Self::UniformBuffer => "uniform_buffer",
            Self::StorageImage => "storage_image",
            Self::SampledImage => "sampled_image",
            Self::UniformTexelBuffer => "uniform_texel_buffer",
            Self::StorageTexelBuffer => "storage_texel_buffer",
            Self::Sampler => "sampler",
            Self::CombinedImageSampler => "combined_image_sampler",
            Self::AccelerationStructure => "acceleration_structure",
        }
    }

    /// Whether descriptors of these kinds ([`Descriptor::kind`]) hold all that it does.
    fn is_held(self, kinds: &[&str]) -> bool {
        const BOTH: &str = "an image with a sampler";
        let accepted: &[&str] = match self {
            Self::StorageBuffer | Self::UniformBuffer => &["a buffer"],
            Self::StorageImage | Self::SampledImage | Self::UniformTexelBuffer | Self::StorageTexelBuffer => {
                &["an image", BOTH]
            }
            Self::Sampler => &["a sampler", BOTH],
            Self::CombinedImageSampler => &[BOTH],
            Self::AccelerationStructure => &["an acceleration structure"],
        };
        kinds.iter().any(|kind| accepted.contains(kind))
    }

    /// The type of a variable's descriptors, given the type of one of them.
    fn of(module: &Module, storage_class: u32, ty: TypeId) -> Option<Self> {
        let image = |ty: TypeId, with_sampler| {
            let Type::Image(image) = module.ty(ty) else { return None };
            Some(match (image.dim, image.sampled) {
                (BUFFER, 2) => Self::StorageTexelBuffer,
                (BUFFER, _) => Self::UniformTexelBuffer,
                (_, 2) => Self::StorageImage,
                _ if with_sampler => Self::CombinedImageSampler,
                _ => Self::SampledImage,
            })
        };
        match (storage_class, module.ty(ty)) {
            (storage::STORAGE_BUFFER, _) | (storage::UNIFORM, Type::Struct { buffer_block: true, .. }) => {
                Some(Self::StorageBuffer)
            }
            (storage::UNIFORM, _) => Some(Self::UniformBuffer),
            (_, Type::Image(_)) => image(ty, false),
            (_, Type::SampledImage(of)) => image(*of, true),
            (_, Type::Sampler) => Some(Self::Sampler),
            (_, Type::AccelerationStructure) => Some(Self::AccelerationStructure),
            _ => None,
        }
    }
}

/// `Dim` of texel buffers.
const BUFFER: u32 = 5;

/// The storage class of each of a module's variables at a binding, and the type of a descriptor.
fn variables(module: &Module, binding: Binding) -> impl Iterator<Item = (u32, TypeId)> {
    let at = move |id| {
        let number = |decoration| module.decorations.literal(id, decoration);
        number(34) == Some(binding.set) && number(33) == Some(binding.binding)
    };
    let here = module.variables.iter().filter(move |variable| at(variable.id));
    here.filter_map(|variable| element_of(module, variable))
}

/// The storage class of a variable, and the type of one of its descriptors.
fn element_of(module: &Module, variable: &GlobalVariable) -> Option<(u32, TypeId)> {
    let mut ty = variable.ty?;
    while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = *module.ty(ty) {
        ty = element;
    }
    Some((variable.storage_class, ty))
}

/// The descriptor type of the variable that a slot is of.
fn slot_type(program: &Program, slot: &Slot) -> Option<DescriptorType> {
    let module = &*program.module;
    let variable = module.variables.iter().find(|variable| variable.id == slot.variable)?;
    let (class, ty) = element_of(module, variable)?;
    DescriptorType::of(module, class, ty)
}

/// The image type that the variable of a slot declares, with or without a sampler; `None` for
/// another descriptor.
pub fn image_of_slot(program: &Program, slot: &Slot) -> Option<ImageType> {
    let module = &*program.module;
    let variable = module.variables.iter().find(|variable| variable.id == slot.variable)?;
    let (_, mut ty) = element_of(module, variable)?;
    if let Type::SampledImage(image) = *module.ty(ty) {
        ty = image;
    }
    match *module.ty(ty) {
        Type::Image(image) => Some(image),
        _ => None,
    }
}

/// The descriptor types of a module's variables at a binding.
pub fn declared(module: &Module, binding: Binding) -> Vec<DescriptorType> {
    let mut types = Vec::new();
    for ty in variables(module, binding).filter_map(|(class, ty)| DescriptorType::of(module, class, ty)) {
        if !types.contains(&ty) {
            types.push(ty);
        }
    }
    types
}

/// What stands at a binding of these programs where nothing is bound: buffers and images of which
/// every load is zero and to which no store does anything, structures that every ray misses.
pub fn stand_in<'a>(programs: impl Iterator<Item = &'a Program>, binding: Binding) -> Option<Descriptor> {
    let mut kinds: Vec<Descriptor> = Vec::new();
    let mut made: Vec<StandIn> = Vec::new();
    for program in programs.filter(|program| program.bindings().any(|one| one == binding)) {
        let module = &*program.module;
        let of_heap = if binding.is_heap() { program.heap_uses() } else { Vec::new() };
        let of_heap = of_heap.into_iter().filter(|one| heap::binding(one.heap) == binding);
        let types = variables(module, binding).map(|(_, ty)| ty).chain(of_heap.map(|one| one.ty));
        for ty in types {
            let Some(wanted) = StandIn::of(module, ty).filter(|wanted| !made.contains(wanted)) else {
                continue;
            };
            kinds.extend(wanted.descriptor());
            made.push(wanted);
        }
    }
    match <[Descriptor; 1]>::try_from(kinds) {
        Ok([one]) => Some(one),
        Err(several) if several.is_empty() => None,
        Err(several) => Some(Descriptor::Mutable(several.into())),
    }
}

/// What a stand-in is to suit.
#[derive(Clone, Copy, PartialEq, Eq)]
enum StandIn {
    Buffer,
    Structure,
    Sampler,
    Image { dimension: Dimension, multisampled: bool, class: Class, with_sampler: bool },
}

impl StandIn {
    fn of(module: &Module, ty: TypeId) -> Option<Self> {
        let image = |image: &ImageType, with_sampler| {
            let class = match *module.ty(image.sampled_type) {
                Type::Int { signed: true, .. } => Class::Sint,
                Type::Int { .. } => Class::Uint,
                _ => Class::Float,
            };
            let (dimension, multisampled) = (view::dimension(image)?, image.multisampled);
            Some(Self::Image { dimension, multisampled, class, with_sampler })
        };
        match module.ty(ty) {
            Type::Struct { .. } | Type::Buffer { .. } => Some(Self::Buffer),
            Type::AccelerationStructure => Some(Self::Structure),
            Type::Sampler => Some(Self::Sampler),
            Type::Image(of) => image(of, false),
            Type::SampledImage(of) => match module.ty(*of) {
                Type::Image(of) => image(of, true),
                _ => None,
            },
            _ => None,
        }
    }

    fn descriptor(self) -> Option<Descriptor> {
        // Whether an instruction compares is not known here, and those that do not ignore it.
        let sampler = || Arc::new(Sampler { compare_op: Some(CompareOp::LessOrEqual), ..Sampler::default() });
        Some(match self {
            Self::Buffer => Descriptor::Buffer(Buffer::null()),
            Self::Structure => Descriptor::AccelerationStructure(Tlas::empty().clone()),
            Self::Sampler => Descriptor::Sampler(sampler()),
            Self::Image { dimension, multisampled, class, with_sampler } => {
                let component = match class {
                    Class::Float => Component::Float32,
                    Class::Sint => Component::Sint32,
                    Class::Uint => Component::Uint32,
                };
                let layers = if dimension.is_cube() { 6 } else { 1 };
                let samples = if multisampled { 4 } else { 1 };
                let shape = ImageShape { dimension, extent: [1; 3], layers, levels: 1, samples };
                let texels = Image::null(Format::new(component, 4), shape).ok()?;
                match with_sampler {
                    true => Descriptor::ImageSampler(texels, sampler()),
                    false => Descriptor::Image(texels),
                }
            }
        })
    }
}

/// The most bindings that a message lists: more would hide the rest of it.
const SHOWN: usize = 16;

/// A list for a message, cut after some.
pub fn list(all: &[String]) -> String {
    let mut text = all.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join("; ");
    if all.len() > SHOWN {
        text += &format!("; and {} more", all.len() - SHOWN);
    }
    text
}

/// The descriptors that programs use and that are not bound, given the kinds of those that are at a
/// binding ([`Descriptor::kind`]). Several variables may share a binding, which then lacks the
/// descriptor of one: each binding and type once, with the name that the first of the programs
/// declares.
pub fn missing<'a>(
    programs: impl Iterator<Item = &'a Program>,
    bound: impl Fn(Binding) -> Vec<&'static str>,
) -> Vec<String> {
    let mut seen: Vec<(Binding, Option<DescriptorType>)> = Vec::new();
    let mut all: Vec<(Binding, String)> = Vec::new();
    for program in programs {
        for slot in &program.slots {
            let ty = slot_type(program, slot);
            let (one, kinds) = ((slot.binding, ty), bound(slot.binding));
            if seen.contains(&one) || ty.map_or(!kinds.is_empty(), |ty| ty.is_held(&kinds)) {
                continue;
            }
            seen.push(one);
            let name = if slot.name.is_empty() { String::new() } else { format!("`{}` ", slot.name) };
            let ty = ty.map_or_else(String::new, |ty| format!(", {}", ty.name()));
            all.push((slot.binding, format!("{name}({}{ty})", slot.binding)));
        }
    }
    sort_by_key(&mut all, |(binding, _)| *binding);
    all.into_iter().map(|(_, text)| text).collect()
}

impl Program {
    /// The descriptors in heaps that it uses.
    #[doc(hidden)]
    pub fn heap_uses(&self) -> Vec<HeapUse> {
        self.entry_point().map_or_else(Vec::new, |entry| heap_uses(&self.module, entry.function))
    }

    /// Lists what is bound and what is not, where a descriptor is missing; `others` run with this
    /// one.
    #[doc(hidden)]
    pub fn describe_bound(&self, accessed: Option<&AccessFault>, others: &[Arc<Self>]) -> Vec<String> {
        let Some(AccessFault::Descriptor { bound, .. }) = accessed else { return Vec::new() };
        let programs = || std::iter::once(self).chain(others.iter().map(|program| &**program));
        let one = |bound: &BindingSummary| {
            let slot = programs().flat_map(|one| &one.slots).find(|slot| slot.binding == bound.binding);
            let slot = slot.filter(|slot| !slot.name.is_empty());
            let name = slot.map_or_else(String::new, |slot| format!("`{}`, ", slot.name));
            let count = if bound.count == 1 { String::new() } else { format!(", {} elements", bound.count) };
            let given =
                bound.name.as_ref().map_or_else(String::new, |name| format!(", the scene's `{name}`"));
            let kinds = bound.kinds.join(" and ");
            format!("{} ({name}{kinds}{count}{given})", bound.binding)
        };
        let at = |binding| bound.iter().filter(move |one: &&BindingSummary| one.binding == binding);
        let missing = missing(programs(), |binding| at(binding).flat_map(|one| one.kinds.clone()).collect());
        let missing = (!missing.is_empty()).then(|| format!("not bound: {}", list(&missing)));
        let bound = match bound.is_empty() {
            true => "nothing is bound".to_owned(),
            false => format!("bound: {}", list(&bound.iter().map(one).collect::<Vec<_>>())),
        };
        std::iter::once(bound).chain(missing).collect()
    }
}
