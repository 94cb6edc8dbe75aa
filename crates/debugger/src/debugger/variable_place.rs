//! Where a variable's value is: registers, memory, descriptors. Places are read when somebody asks,
//! part by part, as a buffer may be large.

use std::ops::Range;
use std::sync::Arc;

use crate::debugger::lane_state::LaneState;
use crate::debugger::object_state;
use crate::debugger::place_memory::{MemoryBase, MemoryPlace, PlaceContext, outside};
use crate::debugger::words_then::{UNWRITTEN, WordsThen};
use anyhit_engine::machine::device_memory::STRUCTURE_HANDLE;
use anyhit_engine::machine::{Bindings, Buffer, REGISTER_POINTER, Reg};
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::array_length;
use anyhit_engine::ops::value_registers::Words;
use anyhit_engine::reflect::value::{AddressValue, TypedValue, ValueContent, ValueMember, type_name};
use anyhit_engine::reflect::{Layout, MAX_WORDS, Rules};

/// A word of a value in a buffer: its byte offset and its bits.
type BufferWord = (u64, u32);

/// The most elements of an array that are read with the value that it is part of.
const MAX_LISTED: u64 = 256;

/// A value of a stopped shader, and where it is.
#[derive(Clone, Debug)]
pub struct VariablePlace {
    context: Arc<PlaceContext>,
    ty: TypeId,
    storage: PlaceStorage,
}

/// How a place holds its value.
#[derive(Clone, Debug)]
enum PlaceStorage {
    /// In registers.
    Registers {
        registers: Words,
        /// Why they cannot be set, where they cannot.
        fixed: Option<&'static str>,
    },
    /// The words themselves: a constant.
    Constant(Arc<[u32]>),
    /// In memory.
    Memory(MemoryPlace),
    /// A descriptor, or an array of them from this one on.
    Descriptors {
        first: u32,
        /// Whether they are buffers, whose contents further indices reach.
        buffers: bool,
    },
    /// A pointer to a place.
    Pointer(Box<VariablePlace>),
    /// The parts of the value by index.
    Parts(Vec<VariablePlace>),
    /// Nowhere, for this reason.
    Unavailable(Arc<str>),
}

impl VariablePlace {
    pub(super) fn registers(context: &Arc<PlaceContext>, ty: TypeId, registers: Words) -> Self {
        Self::new(context, ty, PlaceStorage::Registers { registers, fixed: None })
    }

    pub(super) fn constant(context: &Arc<PlaceContext>, ty: TypeId, words: Vec<u32>) -> Self {
        Self::new(context, ty, PlaceStorage::Constant(words.into()))
    }

    pub(super) fn memory(context: &Arc<PlaceContext>, ty: TypeId, memory: MemoryPlace) -> Self {
        Self::new(context, ty, PlaceStorage::Memory(memory))
    }

    pub(super) fn descriptors(context: &Arc<PlaceContext>, ty: TypeId, first: u32, buffers: bool) -> Self {
        Self::new(context, ty, PlaceStorage::Descriptors { first, buffers })
    }

    pub(super) fn pointer(context: &Arc<PlaceContext>, ty: TypeId, to: Self) -> Self {
        Self::new(context, ty, PlaceStorage::Pointer(Box::new(to)))
    }

    pub(super) fn parts(context: &Arc<PlaceContext>, ty: TypeId, parts: Vec<Self>) -> Self {
        Self::new(context, ty, PlaceStorage::Parts(parts))
    }

    pub(super) fn unavailable(context: &Arc<PlaceContext>, ty: TypeId, why: impl Into<Arc<str>>) -> Self {
        Self::new(context, ty, PlaceStorage::Unavailable(why.into()))
    }

    fn new(context: &Arc<PlaceContext>, ty: TypeId, storage: PlaceStorage) -> Self {
        Self { context: context.clone(), ty, storage }
    }

    /// The place as one that cannot be set, for this reason.
    pub(super) fn fixed(mut self, why: &'static str) -> Self {
        match &mut self.storage {
            PlaceStorage::Registers { fixed, .. } => *fixed = Some(why),
            PlaceStorage::Parts(parts) => {
                for part in parts {
                    *part = part.clone().fixed(why);
                }
            }
            _ => {}
        }
        self
    }

    /// The type of the value, in its module.
    pub fn ty(&self) -> TypeId {
        self.ty
    }

    /// The module that the type is of.
    pub fn module(&self) -> &Arc<Module> {
        &self.context.module
    }

    /// The name of the type, as GLSL has it.
    pub fn type_name(&self) -> String {
        type_name(self.module(), self.ty)
    }

    /// Why there is no value at all, where there is none.
    pub fn why_unavailable(&self) -> Option<&str> {
        match &self.storage {
            PlaceStorage::Unavailable(why) => Some(why),
            PlaceStorage::Parts(parts) if parts.iter().all(|part| part.why_unavailable().is_some()) => {
                parts.first()?.why_unavailable()
            }
            _ => None,
        }
    }

    /// Whether it is a pointer that [`VariablePlace::pointee`] follows.
    pub fn is_pointer(&self) -> bool {
        matches!(self.module().ty(self.ty), Type::Pointer { pointee: Some(_), .. })
    }

    /// The words of the value, as they lie in registers.
    ///
    /// # Errors
    /// The reason why it cannot be read.
    pub fn words(&self, state: &dyn LaneState) -> Result<Vec<u32>, String> {
        match &self.storage {
            PlaceStorage::Registers { registers, .. } => {
                Ok(registers.iter().map(|&reg| state.register(reg)).collect())
            }
            PlaceStorage::Constant(words) => Ok(words.to_vec()),
            PlaceStorage::Memory(memory) => {
                let (buffer, range) = memory.base.buffer(state)?;
                let load = |(offset, width): BufferWord| {
                    let found = range.start.checked_add(offset);
                    let found = found.filter(|at| at.saturating_add((width / 8).into()) <= range.end);
                    found.and_then(|at| buffer.load(at, width)).ok_or_else(|| outside(offset, &range))
                };
                self.scalars(memory)?.into_iter().map(load).collect()
            }
            PlaceStorage::Descriptors { first, buffers: false } => match self.module().ty(self.ty) {
                Type::AccelerationStructure => Ok(vec![*first, STRUCTURE_HANDLE]),
                Type::SampledImage(_) => Ok(vec![*first, *first]),
                Type::Array { .. } | Type::RuntimeArray { .. } => {
                    Err("an array of descriptors has no value".into())
                }
                _ => Ok(vec![*first]),
            },
            PlaceStorage::Descriptors { .. } => Err("an array of buffers has no value".into()),
            PlaceStorage::Pointer(_) => {
                Err("it is a pointer that the compiler resolved: it has no value".into())
            }
            PlaceStorage::Parts(parts) => {
                let mut words = Vec::new();
                for part in parts {
                    words.extend(part.words(state)?);
                }
                Ok(words)
            }
            PlaceStorage::Unavailable(why) => Err(why.to_string()),
        }
    }

    /// Whether any part of it is a variable that has not been written yet.
    pub(super) fn has_unwritten_part(&self, state: &dyn LaneState) -> bool {
        match &self.storage {
            PlaceStorage::Registers { registers, .. } => {
                registers.iter().any(|&register| !state.is_written(register))
            }
            PlaceStorage::Parts(parts) => parts.iter().any(|part| part.has_unwritten_part(state)),
            _ => false,
        }
    }

    /// Sets the value, given the words of a value of its type.
    ///
    /// # Errors
    /// The reason why it cannot be set.
    pub fn set_words(&self, state: &mut dyn LaneState, words: &[u32]) -> Result<(), String> {
        if self.word_count() != Some(words.len()) {
            return Err(format!("the value is not of the type {}", self.type_name()));
        }
        match &self.storage {
            PlaceStorage::Registers { fixed: Some(why), .. } => Err((*why).to_owned()),
            PlaceStorage::Registers { registers, fixed: None } => {
                registers.iter().zip(words).for_each(|(&reg, &word)| state.set_register(reg, word));
                Ok(())
            }
            PlaceStorage::Memory(memory) => {
                let scalars = self.scalars(memory)?;
                let (buffer, range) = memory.base.buffer(state)?;
                let end = |&(offset, width): &BufferWord| {
                    range.start.saturating_add(offset).saturating_add((width / 8).into())
                };
                if let Some(&(offset, _)) = scalars.iter().find(|scalar| end(scalar) > range.end) {
                    return Err(outside(offset, &range));
                }
                for ((offset, width), &word) in scalars.into_iter().zip(words) {
                    buffer.store(range.start + offset, width, word);
                }
                Ok(())
            }
            PlaceStorage::Parts(parts) => {
                let mut rest = words;
                for part in parts {
                    let count = part.word_count().unwrap_or(0);
                    let (these, others) = rest.split_at(count.min(rest.len()));
                    part.set_words(state, these)?;
                    rest = others;
                }
                Ok(())
            }
            PlaceStorage::Constant(_) => Err("it is a constant".into()),
            PlaceStorage::Descriptors { .. } | PlaceStorage::Pointer(_) => Err("it has no value".into()),
            PlaceStorage::Unavailable(why) => Err(why.to_string()),
        }
    }

    /// The registers that hold the value, where registers do.
    pub fn own_registers(&self) -> Option<&[Reg]> {
        match &self.storage {
            PlaceStorage::Registers { registers, .. } => Some(registers),
            _ => None,
        }
    }

    /// The memory that the value is in, as a whole, and where in it the value begins.
    pub fn memory_and_offset(&self, state: &dyn LaneState) -> Option<(Arc<Buffer>, u64)> {
        let PlaceStorage::Memory(memory) = &self.storage else { return None };
        let (buffer, range) = memory.base.buffer(state).ok()?;
        let whole = buffer.view(range.start, range.end - range.start, "memory")?;
        Some((whole, memory.offset))
    }

    /// How many words a value of the type has in registers; `None` where that is not known.
    pub fn word_count(&self) -> Option<usize> {
        self.context.packed(self.ty).word_count().map(|count| count as usize)
    }

    /// The memory that holds the value, in whole words, where memory does.
    pub fn own_memory(&self, state: &dyn LaneState) -> Option<Arc<Buffer>> {
        let PlaceStorage::Memory(memory) = &self.storage else { return None };
        let scalars = self.scalars(memory).ok()?;
        let (buffer, range) = memory.base.buffer(state).ok()?;
        let first = scalars.iter().map(|&(offset, _)| range.start + offset).min()? / 4 * 4;
        let end = scalars.iter().map(|&(offset, width)| range.start + offset + u64::from(width / 8)).max()?;
        buffer.view(first, end.next_multiple_of(4) - first, "watched")
    }

    /// The value that words hold which lay here: those of its registers, or those of its memory, as
    /// [`VariablePlace::own_memory`] has it.
    pub fn value_of(&self, then: &WordsThen) -> TypedValue {
        let found = match &self.storage {
            PlaceStorage::Memory(memory) => {
                self.scalars(memory).ok().and_then(|scalars| scalars_among(&scalars, &then.words))
            }
            _ => None,
        };
        found.map(WordsThen::of_memory).as_ref().unwrap_or(then).value(self.module(), self.ty)
    }

    fn scalars(&self, memory: &MemoryPlace) -> Result<Vec<BufferWord>, String> {
        let too_large = || format!("{} cannot be read as a whole", self.module().describe_type(self.ty));
        self.word_count().ok_or_else(too_large)?;
        let words = self.layout_in(memory).words().into_iter();
        let placed = words.map(|(offset, width)| Some((memory.offset.checked_add(offset as u64)?, width)));
        placed.collect::<Option<_>>().ok_or_else(too_large)
    }

    fn layout_in(&self, memory: &MemoryPlace) -> Layout<'_> {
        Layout { matrix: memory.matrix, ..Layout::new(self.module(), self.ty, memory.rules) }
    }

    /// The value. Where a part of it cannot be read, or is an array too long to be shown, a text
    /// stands for that.
    ///
    /// # Errors
    /// The reason why nothing of it can be read.
    pub fn value(&self, state: &dyn LaneState) -> Result<TypedValue, String> {
        let content = self.content(state, MAX_WORDS)?;
        Ok(TypedValue { ty: self.type_name(), content })
    }

    fn content(&self, state: &dyn LaneState, most: u32) -> Result<ValueContent, String> {
        if let Some(why) = self.why_unavailable() {
            return Err(why.to_owned());
        }
        if let PlaceStorage::Registers { registers, .. } = &self.storage
            && !registers.is_empty()
            && registers.iter().all(|&register| !state.is_written(register))
        {
            return Ok(ValueContent::Text(UNWRITTEN.into()));
        }
        let text_of = |result: Result<ValueContent, String>| {
            result.unwrap_or_else(|why| ValueContent::Text(format!("unavailable: {why}")))
        };
        match self.module().ty(self.ty) {
            Type::Struct { .. } => {
                let count = self.child_count(state)?;
                let members = self.children(0..count, state).into_iter().map(|(name, part)| {
                    let content = text_of(part.content(state, most / count.max(1) as u32 + 1));
                    ValueMember { name, value: TypedValue { ty: part.type_name(), content } }
                });
                Ok(ValueContent::Members(members.collect()))
            }
            Type::Array { .. } | Type::RuntimeArray { .. } => {
                let count = self.child_count(state)?;
                if count > MAX_LISTED.min(most.into()) {
                    return Ok(ValueContent::Text(format!("{count} elements")));
                }
                let parts = self.children(0..count, state).into_iter();
                let each = most / count.max(1) as u32;
                Ok(ValueContent::List(parts.map(|(_, part)| text_of(part.content(state, each))).collect()))
            }
            _ => self.leaf_content(state),
        }
    }

    /// The content of a value that is no struct and no array.
    fn leaf_content(&self, state: &dyn LaneState) -> Result<ValueContent, String> {
        if let PlaceStorage::Pointer(_) = self.storage {
            return Ok(ValueContent::Text("a pointer that the compiler resolved".into()));
        }
        if let PlaceStorage::Descriptors { first, .. } = self.storage {
            return Ok(ValueContent::Text(self.context.describe_descriptor(state, first)));
        }
        if self.has_unwritten_part(state) {
            let parts = self.children(0..self.child_count(state)?, state).into_iter();
            let parts: Result<_, String> = parts.map(|(_, part)| part.content(state, MAX_WORDS)).collect();
            return Ok(ValueContent::List(parts?));
        }
        let words = self.words(state)?;
        let descriptor = |handle| ValueContent::Text(self.context.describe_descriptor(state, handle));
        Ok(match (self.module().ty(self.ty), &words[..]) {
            (Type::Image(_) | Type::Sampler | Type::SampledImage(_), &[handle, ..]) => descriptor(handle),
            (Type::AccelerationStructure, &[handle, STRUCTURE_HANDLE]) => descriptor(handle),
            (Type::AccelerationStructure, &[low, high]) => {
                let address = u64::from(low) | u64::from(high) << 32;
                ValueContent::Address(AddressValue { address, place: None })
            }
            (Type::RayQuery, &[handle]) => {
                ValueContent::Text(object_state::describe_query(state.ray_query(handle)))
            }
            (Type::HitObject { .. }, &[handle]) => {
                ValueContent::Text(object_state::describe_hit_object(state.hit_object(handle)))
            }
            _ => {
                let value = TypedValue::of_type(self.module(), self.ty, &words);
                value.with_places(&state.bindings().memory).content
            }
        })
    }

    /// How many parts it has: members, elements, columns, components. A pointer has those of what
    /// it points to.
    ///
    /// # Errors
    /// The reason why that is not known.
    pub fn child_count(&self, state: &dyn LaneState) -> Result<u64, String> {
        match self.module().ty(self.ty) {
            Type::RuntimeArray { stride, .. } => match &self.storage {
                PlaceStorage::Memory(memory) => {
                    let (_, range) = memory.base.buffer(state)?;
                    let bytes = (range.end - range.start).saturating_sub(memory.offset);
                    let stride = stride.ok_or("the stride of the array is unknown")?;
                    Ok(bytes / u64::from(stride.max(1)))
                }
                PlaceStorage::Descriptors { first, .. } => {
                    let slot = Bindings::slot_of(*first).and_then(|(slot, _)| self.context.slots.get(slot));
                    let bound = state.bindings().bound.iter();
                    let known = slot.and_then(|(binding, _)| {
                        bound.into_iter().find(|summary| summary.binding == *binding)
                    });
                    Ok(known.map_or(0, |summary| summary.count as u64))
                }
                _ => Err("the length of the array is unknown".into()),
            },
            Type::Pointer { pointee: Some(_), .. } => match self.pointee(state) {
                Ok(pointee) if pointee.is_pointer() => Ok(1),
                Ok(pointee) => pointee.child_count(state).map(|count| count.max(1)),
                Err(_) => Ok(0),
            },
            _ => Ok(self.context.packed(self.ty).child_count() as u64),
        }
    }

    /// Parts in a range of indices, each with its name: `normal`, `[3]`, `x`. Those beyond the last
    /// are left out.
    pub fn children(&self, range: Range<u64>, state: &dyn LaneState) -> Vec<(String, Self)> {
        let count = self.child_count(state).unwrap_or(0);
        let range = range.start..range.end.min(count);
        if self.is_pointer() {
            let Ok(pointee) = self.pointee(state) else { return Vec::new() };
            return match pointee.child_count(state) {
                Ok(1..) if !pointee.is_pointer() => pointee.children(range, state),
                _ => range.map(|_| ("*".to_owned(), pointee.clone())).collect(),
            };
        }
        let name = |at: u64| match self.module().ty(self.ty) {
            Type::Struct { members, .. } => match members.get(at as usize) {
                Some(member) if !member.name.is_empty() => member.name.clone(),
                _ => format!("member {at}"),
            },
            Type::Vector { count: ..=4, .. } => ["x", "y", "z", "w"][at as usize % 4].to_owned(),
            _ => format!("[{at}]"),
        };
        range.filter_map(|at| Some((name(at), self.child(at).ok()?))).collect()
    }

    /// The member with a name, and its index.
    pub fn member(&self, name: &str) -> Option<Self> {
        let Type::Struct { members, .. } = self.module().ty(self.ty) else { return None };
        let at = members.iter().position(|member| member.name == name)?;
        self.child(at as u64).ok()
    }

    /// The part at an index.
    ///
    /// # Errors
    /// The message where there is none.
    pub fn child(&self, at: u64) -> Result<Self, String> {
        let packed = self.context.packed(self.ty);
        if packed.is_scalar() {
            return Err(format!("{} has no parts", self.type_name()));
        }
        let index = usize::try_from(at).unwrap_or(usize::MAX);
        let (offset, part) =
            packed.child(index).ok_or_else(|| format!("{at} is outside {}", self.type_name()))?;
        let (words, part) = (offset / 4..offset.saturating_add(part.size()) / 4, part.ty);
        let storage = match &self.storage {
            PlaceStorage::Registers { registers, fixed } => {
                let registers = registers.get(words).ok_or("the value has no such part")?.into();
                PlaceStorage::Registers { registers, fixed: *fixed }
            }
            PlaceStorage::Constant(all) => {
                PlaceStorage::Constant(all.get(words).ok_or("the value has no such part")?.into())
            }
            PlaceStorage::Memory(memory) => {
                let outside = "the offset is outside all memory";
                let (offset, part) = self.layout_in(memory).child(index).ok_or(outside)?;
                let offset = memory.offset.checked_add(offset as u64).ok_or(outside)?;
                PlaceStorage::Memory(MemoryPlace { offset, matrix: part.matrix, ..*memory })
            }
            PlaceStorage::Descriptors { first, buffers } => {
                self.part_descriptor(*first, *buffers, part, at)?
            }
            PlaceStorage::Parts(parts) => {
                return parts.get(at as usize).cloned().ok_or_else(|| "the value has no such part".into());
            }
            PlaceStorage::Pointer(_) => return Err(format!("{} has no parts", self.type_name())),
            PlaceStorage::Unavailable(why) => PlaceStorage::Unavailable(why.clone()),
        };
        Ok(Self::new(&self.context, part, storage))
    }

    fn part_descriptor(
        &self,
        first: u32,
        buffers: bool,
        part: TypeId,
        at: u64,
    ) -> Result<PlaceStorage, String> {
        // Arrays of arrays are flattened.
        let mut each = 1_u64;
        let mut inner = part;
        while let Type::Array { element, length, .. } = *self.module().ty(inner) {
            each = each.saturating_mul(array_length(self.module(), length) as u64);
            inner = element;
        }
        let (slot, element) = Bindings::slot_of(first).ok_or("it is a null descriptor")?;
        let element = at.checked_mul(each).and_then(|at| at.checked_add(element.into()));
        let element = element.and_then(|element| u32::try_from(element).ok());
        let handle = Bindings::handle(slot as u32, element.ok_or("the index is outside all descriptors")?);
        Ok(if buffers && inner == part {
            let base = MemoryBase::Descriptor(handle);
            PlaceStorage::Memory(MemoryPlace { base, offset: 0, rules: Rules::Explicit, matrix: None })
        } else {
            PlaceStorage::Descriptors { first: handle, buffers }
        })
    }

    /// What it points to.
    ///
    /// # Errors
    /// The reason why that is not known: it is no pointer, or its value cannot be read.
    pub fn pointee(&self, state: &dyn LaneState) -> Result<Self, String> {
        if let PlaceStorage::Pointer(to) = &self.storage {
            return Ok((**to).clone());
        }
        let Type::Pointer { pointee: Some(_), .. } = *self.module().ty(self.ty) else {
            return Err(format!("{} is not a pointer", self.type_name()));
        };
        Self::of_pointer(&self.context, self.ty, &self.words(state)?)
    }

    /// The place that a pointer of a type points to, given its words.
    pub(super) fn of_pointer(
        context: &Arc<PlaceContext>,
        pointer: TypeId,
        words: &[u32],
    ) -> Result<Self, String> {
        let module = &context.module;
        let Type::Pointer { storage_class, pointee: Some(ty), .. } = *module.ty(pointer) else {
            return Err(format!("{} is not a pointer", module.describe_type(pointer)));
        };
        let memory = |base, offset| {
            let rules = context.rules(storage_class);
            Self::memory(context, ty, MemoryPlace { base, offset, rules, matrix: None })
        };
        Ok(match (storage_class, words) {
            (storage::PHYSICAL_STORAGE_BUFFER, &[0, 0]) => return Err("the pointer is null".into()),
            (storage::PHYSICAL_STORAGE_BUFFER, &[low, high]) => {
                memory(MemoryBase::Address(u64::from(low) | u64::from(high) << 32), 0)
            }
            (storage::UNIFORM_CONSTANT, &[handle]) => Self::descriptors(context, ty, handle, false),
            (_, &[handle, offset]) => {
                let is_array = matches!(module.ty(ty), Type::Array { .. } | Type::RuntimeArray { .. });
                if is_array && is_array_of_blocks(module, ty) {
                    return Ok(Self::descriptors(context, ty, handle, true));
                }
                memory(MemoryBase::of_handle(handle), offset.into())
            }
            (_, &[register]) if register >= REGISTER_POINTER => {
                let first = register - REGISTER_POINTER;
                let count = context.packed(ty).word_count().ok_or("it cannot be read as a whole")?;
                Self::registers(context, ty, (first..first.saturating_add(count)).map(Reg).collect())
            }
            (_, [0]) => return Err("the pointer is null".into()),
            _ => return Err(format!("{} cannot be dereferenced", module.describe_type(pointer))),
        })
    }
}

/// The words of scalars among whole words of their buffer, from the first that holds one of them
/// on; between scalars there may be gaps.
fn scalars_among(scalars: &[BufferWord], words: &[u32]) -> Option<Vec<u32>> {
    let first = scalars.iter().map(|&(offset, _)| offset).min()? / 4 * 4;
    let word = |&(offset, width): &BufferWord| {
        let at = offset - first;
        let word = words.get((at / 4) as usize)? >> (8 * (at % 4));
        Some(word & u32::MAX >> (32 - width))
    };
    scalars.iter().map(word).collect()
}

/// Whether a type is an array of blocks, each in a buffer of its own.
fn is_array_of_blocks(module: &Module, mut ty: TypeId) -> bool {
    while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = *module.ty(ty) {
        ty = element;
    }
    matches!(module.ty(ty), Type::Struct { block: true, .. })
}
