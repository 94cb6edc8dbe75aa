//! What an entry point has bound, made up from what it declares.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::error::Result;
use crate::harness::layout::array_length;
use crate::harness::smoke::fill::{Content, Filler, Integers, Numbers, Place, Wide};
use crate::machine::format::{Class, Component, Format};
use crate::machine::image::{Dimension, Image, Shape};
use crate::machine::sampler::{CompareOp, Filter, Sampler};
use crate::machine::{Binding, Buffer, Descriptor, Resources};
use crate::module::Module;
use crate::module::interface::InterfaceVariable;
use crate::module::ty::{ImageType, Type, TypeId};
use crate::ops::decode::InterfaceRows;
use crate::ops::pointer::storage;
use crate::program::Program;
use crate::scene::image::declared_format;

/// Descriptors of a runtime array.
const DESCRIPTORS: u32 = 16;
/// Descriptors of an array that differ; the rest repeat them.
const DISTINCT: u32 = 4;
/// Width, height and depth of images, as far as they have them.
const SIDE: u32 = 16;

/// Which values memory is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Values {
    /// `LaunchSizeKHR`
    pub launch_size: [u32; 3],
    /// The seed.
    pub seed: u64,
    /// What integers are.
    pub integers: Integers,
    /// What could be an address.
    pub wide: Wide,
}

/// Everything that one invocation is given.
pub struct Given {
    /// Descriptors, push constants and device memory.
    pub resources: Resources,
    /// The bytes of the shader record.
    pub record: Vec<u8>,
    /// Words of the payload or callable data that the shader is called with.
    pub payload: Vec<u32>,
    /// Words of the hit attributes.
    pub attributes: Vec<u32>,
    /// By region of device memory, the place whose address leads nowhere yet.
    pub places: Vec<Option<Place>>,
}

/// Makes up what a program needs.
///
/// # Errors
/// What making a structure reports.
pub fn given(
    program: &Program,
    variables: &[InterfaceVariable],
    values: Values,
    known: &BTreeMap<Place, Content>,
    tlas: &dyn Fn() -> Result<Arc<Tlas>>,
) -> Result<Given> {
    let module = &*program.module;
    let numbers = Numbers::new(values.seed, values.integers);
    let mut filler = Filler::new(module, numbers, values.wide, known);
    let mut resources = Resources::default();
    let mut record = Vec::new();
    let mut structure = None;
    for variable in variables {
        let (Some(ty), root) = (variable.ty, root(variable)) else { continue };
        match variable.storage_class {
            storage::PUSH_CONSTANT => {
                resources.push_constants = Some(Buffer::new(&filler.block(ty, root)));
            }
            storage::SHADER_RECORD_BUFFER => record = filler.block(ty, root),
            _ => {}
        }
        let Some((set, binding)) = variable.descriptor_set.zip(variable.binding) else { continue };
        let place = Binding { set, binding };
        let (element, count) = descriptor_array(module, ty);
        let mut descriptors = Vec::new();
        for at in 0..count.min(DISTINCT) {
            let root = root.wrapping_add(u64::from(at) << 32);
            let descriptor = match module.ty(element) {
                Type::Struct { .. } => Descriptor::Buffer(Buffer::new(&filler.block(element, root))),
                Type::AccelerationStructure => {
                    let tlas = structure.get_or_insert(tlas()?).clone();
                    Descriptor::AccelerationStructure(tlas)
                }
                Type::Sampler => Descriptor::Sampler(Arc::new(sampler(false))),
                Type::Image(image) => match made_up(module, image, filler.numbers())? {
                    Some(image) => Descriptor::Image(image),
                    None => continue,
                },
                Type::SampledImage(image) => {
                    let Type::Image(image) = module.ty(*image) else { continue };
                    let Some(texels) = made_up(module, image, filler.numbers())? else { continue };
                    let linear = texels.format().class() == Class::Float && !image.multisampled;
                    Descriptor::ImageSampler(texels, Arc::new(sampler(linear)))
                }
                _ => continue,
            };
            descriptors.push(descriptor);
        }
        if descriptors.is_empty() {
            continue;
        }
        let all = resources.descriptors.entry(place).or_default();
        for (at, new) in descriptors.iter().cycle().take(count as usize).enumerate() {
            match all.get_mut(at) {
                Some(held) => share(held, new),
                None => all.push(new.clone()),
            }
        }
    }
    let mut words = |class: u32| {
        let rows = program.interface_rows(class)?;
        Some(filler.words(rows.ty, u64::from(class) << 48))
    };
    let payload = words(storage::INCOMING_RAY_PAYLOAD).or_else(|| words(storage::INCOMING_CALLABLE_DATA));
    let attributes = words(storage::HIT_ATTRIBUTE);
    let (memory, places) = filler.device_memory(tlas)?;
    resources.memory = memory;
    Ok(Given {
        resources,
        record,
        payload: payload.unwrap_or_default(),
        attributes: attributes.unwrap_or_default(),
        places,
    })
}

/// Adds what another variable asks of a binding that several share; of buffers the largest is kept.
fn share(held: &mut Descriptor, new: &Descriptor) {
    let kinds: &[Descriptor] =
        if let Descriptor::Mutable(kinds) = held { kinds } else { std::slice::from_ref(held) };
    let mut kinds = kinds.to_vec();
    let same = |held: &&mut Descriptor| match (&**held, new) {
        (Descriptor::Image(a), Descriptor::Image(b))
        | (Descriptor::ImageSampler(a, _), Descriptor::ImageSampler(b, _)) => {
            (a.shape(), a.format()) == (b.shape(), b.format())
        }
        (held, new) => std::mem::discriminant(held) == std::mem::discriminant(new),
    };
    match (kinds.iter_mut().find(same), new) {
        (Some(Descriptor::Buffer(held)), Descriptor::Buffer(new)) if new.size() > held.size() => {
            held.clone_from(new);
        }
        (Some(_), _) => {}
        (None, _) => kinds.push(new.clone()),
    }
    *held = match <[Descriptor; 1]>::try_from(kinds) {
        Ok([one]) => one,
        Err(several) => Descriptor::Mutable(several.into()),
    };
}

/// An answer to a trace or call that no shader gives: the words of the payload.
pub fn answer(module: &Module, rows: &InterfaceRows, numbers: &mut Numbers) -> Vec<u32> {
    // One answer in four looks like that of a miss shader, so that loops over bounces end.
    let missed = numbers.unit() < 0.25;
    let mut words = Vec::new();
    answer_words(module, rows.ty, missed, numbers, &mut words);
    words
}

fn answer_words(module: &Module, ty: TypeId, missed: bool, numbers: &mut Numbers, words: &mut Vec<u32>) {
    match module.ty(ty) {
        ty @ Type::Float { width, .. } => {
            let value = if missed { -1.0 } else { numbers.unit() };
            let bits = Numbers::float(ty, value);
            words.push(bits as u32);
            if *width == 64 {
                words.push((bits >> 32) as u32);
            }
        }
        Type::Vector { component: part, count } | Type::Matrix { column: part, count } => {
            (0..*count).for_each(|_| answer_words(module, *part, missed, numbers, words));
        }
        Type::Array { element, length, .. } => {
            let length = array_length(module, *length);
            (0..length).for_each(|_| answer_words(module, *element, missed, numbers, words));
        }
        Type::Struct { members, .. } => {
            members.iter().for_each(|member| answer_words(module, member.ty, missed, numbers, words));
        }
        Type::Bool => words.push(if missed { 0 } else { numbers.integer() as u32 & 1 }),
        Type::Int { width, .. } => {
            words.push(if missed { 0 } else { numbers.integer() as u32 });
            if *width == 64 {
                words.push(0);
            }
        }
        _ => words.extend([0, 0]),
    }
}

/// A number that tells a variable from others.
fn root(variable: &InterfaceVariable) -> u64 {
    let place = variable.descriptor_set.zip(variable.binding);
    let (set, binding) = place.unwrap_or((u32::MAX, variable.storage_class));
    u64::from(set) << 40 ^ u64::from(binding)
}

/// The type of a binding's descriptors, and how many there are.
fn descriptor_array(module: &Module, ty: TypeId) -> (TypeId, u32) {
    let (mut ty, mut count) = (ty, 1u32);
    loop {
        match *module.ty(ty) {
            Type::Array { element, length, .. } => {
                let length = array_length(module, length);
                count = count.saturating_mul(length.try_into().unwrap_or(u32::MAX));
                ty = element;
            }
            Type::RuntimeArray { element, .. } => {
                count = count.saturating_mul(DESCRIPTORS);
                ty = element;
            }
            _ => return (ty, count.min(1 << 20)),
        }
    }
}

/// A sampler: every one compares where the instruction asks for it.
fn sampler(linear: bool) -> Sampler {
    let filter = if linear { Filter::Linear } else { Filter::Nearest };
    Sampler {
        mag_filter: filter,
        min_filter: filter,
        mipmap_mode: filter,
        compare_op: Some(CompareOp::LessOrEqual),
        ..Sampler::default()
    }
}

/// An image of a type with random texels; `None` for a type that no descriptor has.
fn made_up(module: &Module, image: &ImageType, numbers: &mut Numbers) -> Result<Option<Arc<Image>>> {
    let Some(shape) = shape(image) else { return Ok(None) };
    let format = format(module, image);
    let size = format.texel_size() as usize;
    let mut bytes = Vec::with_capacity(shape.texels() as usize * size);
    for _ in 0..shape.texels() {
        let texel = match format.class() {
            Class::Float => format.encode_numbers([0; 4].map(|_| f64::from(numbers.unit()))),
            Class::Sint | Class::Uint => format.encode([0; 4].map(|_| numbers.integer()), false),
        };
        bytes.extend_from_slice(&texel.to_le_bytes()[..size]);
    }
    Image::new(format, shape, &bytes).map(Some)
}

fn shape(image: &ImageType) -> Option<Shape> {
    let (dimension, axes, layers) = match (image.dim, image.arrayed) {
        (0, false) => (Dimension::D1, 1, 1),
        (0, true) => (Dimension::D1Array, 1, 4),
        (1, false) => (Dimension::D2, 2, 1),
        (1, true) => (Dimension::D2Array, 2, 4),
        (2, false) => (Dimension::D3, 3, 1),
        (3, false) => (Dimension::Cube, 2, 6),
        (3, true) => (Dimension::CubeArray, 2, 12),
        (5, false) => (Dimension::Buffer, 1, 1),
        _ => return None,
    };
    let mut extent = [1; 3];
    extent[..axes].fill(SIDE);
    if dimension == Dimension::Buffer {
        extent[0] = SIDE * SIDE;
    }
    let samples = if image.multisampled { 4 } else { 1 };
    let one_level = image.sampled == 2 || image.multisampled || dimension == Dimension::Buffer;
    let levels = if one_level { 1 } else { SIDE.ilog2() + 1 };
    Some(Shape { dimension, extent, layers, levels, samples })
}

/// The format that an image type declares, or one that suits its component type.
fn format(module: &Module, image: &ImageType) -> Format {
    let integer = matches!(module.ty(image.sampled_type), Type::Int { .. });
    match declared_format(module, image) {
        format if image.format != 0 || format.is_wide() => format,
        // Atomic instructions want a single component; no shader can tell that the rest lacks.
        format if integer => Format { channels: 1, ..format },
        format if image.depth == 1 => Format { channels: 1, ..format },
        format if image.sampled == 2 => format,
        _ => Format::new(Component::Unorm8, 4),
    }
}
