//! Makes up the resources of an entry point from what it declares.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use crate::smoke::fill::{FillContent, Filler, MadeUpValues, PlaceId, ValueSource, mix};
use crate::smoke::images::MadeUpImages;
use anyhit_base::error::{Error, Result};
use anyhit_base::sorted::{SortedMap, sort_by_key};
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::format::Class;
use anyhit_engine::machine::resource::ELEMENT_BITS;
use anyhit_engine::machine::sampler::{CompareOp, Filter, Sampler};
use anyhit_engine::machine::{Binding, Buffer, Descriptor, Resources};
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::InterfaceVariable;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::heap::binding;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::InterfaceRegisters;
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::program::Program;

/// Descriptors of a runtime array.
const DESCRIPTORS: u32 = 16;
/// The bytes of a buffer to which no access gives a type.
const UNTYPED_BYTES: usize = 4096;
/// The bytes of the data in a heap.
const HEAP_DATA_BYTES: usize = 1 << 16;
/// Descriptors of an array that differ; the rest repeat them.
const DISTINCT: u32 = 4;

/// Everything that one invocation is given.
pub(super) struct Given {
    /// Descriptors, push constants and device memory.
    pub resources: Resources,
    /// The bytes of the shader record.
    pub record: Vec<u8>,
    /// Words of the payload or callable data that the shader is called with.
    pub payload: Vec<u32>,
    /// Words of the hit attributes.
    pub attributes: Vec<u32>,
    /// By region of device memory, the place whose address leads nowhere yet.
    pub places: Vec<Option<PlaceId>>,
    /// Bytes of all of it.
    pub made: u64,
}

/// Makes up what a program needs.
///
/// # Errors
/// What making a structure reports, and `UnsupportedModule` where a resource or all of them are
/// larger than the module's limits allow.
pub(super) fn given(
    program: &Program,
    variables: &[InterfaceVariable],
    values: MadeUpValues,
    known: &SortedMap<PlaceId, FillContent>,
    images: &MadeUpImages,
    tlas: &dyn Fn() -> Result<Arc<Tlas>>,
) -> Result<Given> {
    let module = &*program.module;
    let (numbers, extent) = (values.numbers, values.extent);
    let mut filler = Filler::new(module, numbers, values.wide, extent, known);
    let mut resources = Resources::default();
    let mut record = Vec::new();
    let mut structure = None;
    let mut bindings: SortedMap<Binding, Vec<DescriptorArray>> = SortedMap::new();
    // The order in which a module declares them changes nothing.
    let mut variables: Vec<_> = variables.iter().collect();
    sort_by_key(&mut variables, |variable| root(variable));
    let mut wanted: Vec<Wanted> = Vec::new();
    for variable in variables {
        let (Some(ty), root) = (variable.ty, root(variable)) else { continue };
        match variable.storage_class {
            storage::PUSH_CONSTANT => {
                resources.push_constants =
                    Some(filler.block(ty, root).map_err(named(&name_of(variable)))?.buffer());
            }
            storage::SHADER_RECORD_BUFFER => {
                record = filler.block(ty, root).map_err(named(&name_of(variable)))?.whole();
            }
            _ => {}
        }
        let Some((set, binding)) = variable.descriptor_set.zip(variable.binding) else { continue };
        let (element, count) = descriptor_array(module, ty, extent.scale.descriptors);
        wanted.push(Wanted {
            place: Binding { set, binding },
            element,
            count,
            root,
            name: name_of(variable),
        });
    }
    wanted.extend(wanted_in_heaps(program, extent.scale.descriptors));
    for Wanted { place, element, count, root, name } in wanted {
        let named = named(&name);
        let list = u64::from(count) * size_of::<Descriptor>() as u64;
        filler.made.add(module, list).map_err(&named)?;
        let mut distinct = Vec::new();
        for at in 0..count.min(DISTINCT) {
            let root = root.wrapping_add(u64::from(at) << 32);
            let descriptor = match module.ty(element) {
                Type::Struct { .. } => {
                    Descriptor::Buffer(filler.block(element, root).map_err(&named)?.buffer())
                }
                Type::AccelerationStructure => {
                    let tlas = structure.get_or_insert(tlas()?).clone();
                    Descriptor::AccelerationStructure(tlas)
                }
                Type::Sampler => Descriptor::Sampler(Arc::new(sampler(false))),
                Type::Image(image) => {
                    let texels = images.of(module, image, values, root, &mut filler.made);
                    match texels.map_err(&named)? {
                        Some(image) => Descriptor::Image(image),
                        None => continue,
                    }
                }
                Type::SampledImage(image) => {
                    let Type::Image(image) = module.ty(*image) else { continue };
                    let texels = images.of(module, image, values, root, &mut filler.made);
                    let Some(texels) = texels.map_err(&named)? else { continue };
                    let linear = texels.format().class() == Class::Float && !image.multisampled;
                    Descriptor::ImageSampler(texels, Arc::new(sampler(linear)))
                }
                // The bytes of a buffer in a heap to which no access gives a type.
                Type::Buffer { .. } => Descriptor::Buffer(Buffer::zeroed(UNTYPED_BYTES)),
                _ => continue,
            };
            distinct.push(descriptor);
        }
        if !distinct.is_empty() {
            bindings.entry(place).or_default().push(DescriptorArray { distinct, count: count as usize });
        }
    }
    for heap in program.heap_uses().into_iter().filter(|one| one.is_data(module)).map(|one| one.heap) {
        let data = Descriptor::Buffer(Buffer::zeroed(HEAP_DATA_BYTES));
        let array = DescriptorArray { distinct: vec![data], count: 1 };
        bindings.insert(binding(heap).heap_data(), vec![array]);
    }
    resources.descriptors = bindings.into_iter().map(|(place, arrays)| (place, merged(arrays))).collect();
    let mut words = |class: u32| {
        let registers = program.interface_registers(class)?;
        Some(filler.words(registers.ty, u64::from(class) << 48))
    };
    let payload = words(storage::INCOMING_RAY_PAYLOAD).or_else(|| words(storage::INCOMING_CALLABLE_DATA));
    let payload = payload.transpose()?;
    let attributes = words(storage::HIT_ATTRIBUTE).transpose()?;
    let (memory, places, made) = filler.device_memory(tlas)?;
    resources.memory = memory;
    Ok(Given {
        resources,
        record,
        payload: payload.unwrap_or_default(),
        attributes: attributes.unwrap_or_default(),
        places,
        made,
    })
}

/// Says of an error what it is about.
fn named(name: &str) -> impl Fn(Error) -> Error {
    move |error| error.context(format_args!("synthetic memory of {name}"))
}

/// The name of a variable in messages.
fn name_of(variable: &InterfaceVariable) -> String {
    match (variable.name.as_str(), variable.descriptor_set.zip(variable.binding)) {
        ("", Some((set, binding))) => Binding { set, binding }.to_string(),
        ("", None) => format!("%{}", variable.id.0),
        (name, _) => format!("`{name}`"),
    }
}

/// The descriptors that a shader expects at a binding.
struct Wanted {
    place: Binding,
    /// The type of one descriptor; of a buffer that of its bytes.
    element: TypeId,
    count: u32,
    root: u64,
    name: String,
}

/// The descriptors that a program expects in its heaps: up to the constant index that it uses, or
/// a default number for a computed index.
fn wanted_in_heaps(program: &Program, scale: u32) -> Vec<Wanted> {
    let wanted = program.heap_uses().into_iter().enumerate().map(|(at, one)| {
        let place = binding(one.heap);
        let count = one.index.map_or(DESCRIPTORS.saturating_mul(scale), |index| index.saturating_add(1));
        Wanted {
            place,
            element: one.block.unwrap_or(one.ty),
            count: count.min(1 << ELEMENT_BITS),
            root: mix(u64::from(place.set) << 40 ^ u64::from(place.binding), at as u64),
            name: place.to_string(),
        }
    });
    wanted.collect()
}

/// What one variable asks of its binding: so many descriptors, of which the first few repeat.
struct DescriptorArray {
    /// At most [`DISTINCT`], and fewer only where there are not more.
    distinct: Vec<Descriptor>,
    count: usize,
}

/// The descriptors of a binding that variables share. They are merged as often as they differ and
/// then repeated: there may be a million of them, each a buffer of a megabyte.
fn merged(mut arrays: Vec<DescriptorArray>) -> Vec<Descriptor> {
    // Up to the end of each array all that are longer are merged already.
    sort_by_key(&mut arrays, |array| std::cmp::Reverse(array.count));
    let longest = arrays.first().map_or(0, |array| array.count);
    let mut all = vec![Descriptor::Unbound; longest];
    for residue in 0..DISTINCT as usize {
        let mut held: Option<Descriptor> = None;
        for (at, array) in arrays.iter().enumerate() {
            let Some(new) = array.distinct.get(residue) else { break };
            match &mut held {
                Some(held) => share(held, new),
                None => held = Some(new.clone()),
            }
            let shorter = arrays.get(at + 1).map_or(0, |next| next.count);
            // The last of these arrays that reaches so far writes last, from its own end down to
            // where the next one joins.
            let first = residue + shorter.saturating_sub(residue).next_multiple_of(DISTINCT as usize);
            if let Some(held) = &held {
                let places = all.get_mut(first..array.count).unwrap_or_default();
                places.iter_mut().step_by(DISTINCT as usize).for_each(|place| place.clone_from(held));
            }
        }
    }
    all
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
        // Of equal ones the order in which they were declared must not decide.
        (Some(Descriptor::Buffer(held)), Descriptor::Buffer(new)) => {
            let order = new.size().cmp(&held.size()).then_with(|| bytes(new).cmp(bytes(held)));
            if order.is_gt() {
                held.clone_from(new);
            }
        }
        (Some(_), _) => {}
        (None, _) => kinds.push(new.clone()),
    }
    kinds.sort_by_cached_key(|kind| match kind {
        Descriptor::Image(image) => format!("image {:?} {:?}", image.shape(), image.format()),
        Descriptor::ImageSampler(image, _) => format!("sampled {:?} {:?}", image.shape(), image.format()),
        other => format!("{:?}", std::mem::discriminant(other)),
    });
    *held = match <[Descriptor; 1]>::try_from(kinds) {
        Ok([one]) => one,
        Err(several) => Descriptor::Mutable(several.into()),
    };
}

/// The bytes of a buffer, four by four, without a copy of all.
fn bytes(buffer: &Buffer) -> impl Iterator<Item = [u8; 4]> {
    buffer.words().iter().map(|word| word.load(Relaxed).to_le_bytes())
}

/// An answer to a trace or call that no shader gives: the words of the payload. `root` tells it
/// from others.
pub(super) fn answer(
    module: &Module,
    registers: &InterfaceRegisters,
    numbers: ValueSource,
    root: u64,
    far: u32,
) -> Vec<u32> {
    // One answer in four looks like that of a miss shader, and one has large integers, so that
    // loops over bounces end.
    let like = match mix(mix(numbers.seed, root), u64::MAX - 1) >> 61 {
        0 | 1 => Like::Missed,
        2 => Like::Far(far),
        _ => Like::Hit,
    };
    let (count, words) = (registers.count as usize, Vec::with_capacity(registers.count as usize));
    let mut answer = Answer { module, numbers, root, like, words, count, parts: 4 * count + MOST_EMPTY };
    answer.append(registers.ty);
    answer.words
}

/// Parts without words that an answer may have.
const MOST_EMPTY: usize = 1 << 10;

/// What an answer looks like.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Like {
    /// Floats are -1, integers 0.
    Missed,
    /// Integers are this number.
    Far(u32),
    /// Made up like any other resource.
    Hit,
}

struct Answer<'a> {
    module: &'a Module,
    numbers: ValueSource,
    root: u64,
    like: Like,
    words: Vec<u32>,
    /// Words of the whole answer.
    count: usize,
    /// Parts that may still be looked at.
    parts: usize,
}

impl Answer<'_> {
    /// Appends `count` values of a type.
    fn repeat(&mut self, ty: TypeId, count: usize) {
        for _ in 0..count {
            if self.words.len() >= self.count || self.parts == 0 {
                break;
            }
            self.append(ty);
        }
    }

    fn append(&mut self, ty: TypeId) {
        if self.parts == 0 {
            return;
        }
        self.parts -= 1;
        let at = self.words.len() as u64;
        match self.module.ty(ty) {
            ty @ Type::Float { width, .. } => {
                let value = if self.like == Like::Missed { -1.0 } else { self.numbers.float(self.root, at) };
                let bits = ValueSource::float_bits(ty, value);
                self.words.push(bits as u32);
                if *width == 64 {
                    self.words.push((bits >> 32) as u32);
                }
            }
            Type::Vector { component: part, count } | Type::Matrix { column: part, count } => {
                self.repeat(*part, *count as usize);
            }
            Type::Array { element, length, .. } => {
                let length = array_length(self.module, *length);
                self.repeat(*element, length);
            }
            Type::Struct { members, .. } => members.iter().for_each(|member| self.append(member.ty)),
            Type::Bool => {
                let value = self.integer(at) & 1;
                self.words.push(value);
            }
            Type::Int { width, .. } => {
                let value = self.integer(at);
                self.words.push(value);
                if *width == 64 {
                    self.words.push(0);
                }
            }
            _ => self.words.extend([0, 0]),
        }
    }

    fn integer(&self, at: u64) -> u32 {
        match self.like {
            Like::Missed => 0,
            Like::Far(far) => far,
            Like::Hit => self.numbers.integer(self.root, at) as u32,
        }
    }
}

/// A number that distinguishes a variable from others.
fn root(variable: &InterfaceVariable) -> u64 {
    let place = variable.descriptor_set.zip(variable.binding);
    let (set, binding) = place.unwrap_or((u32::MAX, variable.storage_class));
    u64::from(set) << 40 ^ u64::from(binding)
}

/// The type of a binding's descriptors, and how many there are.
fn descriptor_array(module: &Module, ty: TypeId, scale: u32) -> (TypeId, u32) {
    let (mut ty, mut count) = (ty, 1u32);
    loop {
        match *module.ty(ty) {
            Type::Array { element, length, .. } => {
                let length = array_length(module, length);
                count = count.saturating_mul(length.try_into().unwrap_or(u32::MAX));
                ty = element;
            }
            Type::RuntimeArray { element, .. } => {
                count = count.saturating_mul(DESCRIPTORS).saturating_mul(scale);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_of_a_binding_are_merged_where_they_overlap() {
        let array = |sizes: &[usize], count| {
            let distinct = sizes.iter().map(|&size| Descriptor::Buffer(Buffer::zeroed(size))).collect();
            DescriptorArray { distinct, count }
        };
        let sizes = |arrays| {
            let size = |descriptor: &Descriptor| match descriptor {
                Descriptor::Buffer(buffer) => buffer.size(),
                other => panic!("{other:?}"),
            };
            merged(arrays).iter().map(size).collect::<Vec<_>>()
        };
        assert_eq!(sizes(vec![array(&[4, 8, 12, 16], 6)]), [4, 8, 12, 16, 4, 8]);
        // The larger of the two where both have a descriptor; behind the shorter one the first four
        // of the longer go on.
        let both = || vec![array(&[10, 10, 10], 3), array(&[4, 8, 12, 16], 9)];
        let expected = [10, 10, 12, 16, 4, 8, 12, 16, 4];
        assert_eq!(sizes(both()), expected);
        assert_eq!(sizes(both().into_iter().rev().collect()), expected);
        // Arrays as long as each other, and one that ends within the second four.
        let three = vec![array(&[4, 4, 4, 9], 7), array(&[5, 3, 3, 3], 7), array(&[1, 6, 1, 1], 6)];
        assert_eq!(sizes(three), [5, 6, 4, 9, 5, 6, 4]);
    }

    #[test]
    fn of_buffers_of_a_size_the_bytes_decide() {
        // As numbers of 32 bits their order is the other one.
        let [low, high] = [[1, 0, 0, 9], [2, 0, 0, 1]].map(|bytes| Descriptor::Buffer(Buffer::new(&bytes)));
        for (held, new) in [(&low, &high), (&high, &low)] {
            let mut held = held.clone();
            share(&mut held, new);
            let Descriptor::Buffer(held) = held else { panic!("{held:?}") };
            assert_eq!(held.bytes(), [2, 0, 0, 1]);
        }
    }
}
