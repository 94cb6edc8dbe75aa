//! Race analysis: which memory the invocations of a launch share, other than by commuting atomic
//! instructions.
//!
//! If one invocation stores non-atomically what another one loads or stores, the result depends on
//! the schedule. It also does if both modify it by atomic instructions of different kinds, for
//! example an addition and a bitwise or. (Atomic instructions whose results are read, or that do
//! not commute with themselves, always depend on the schedule: see [`crate::ops::atomic`].) To find
//! this before running, the index of every [`MemoryAccess`] is expressed by what distinguishes
//! invocations: the launch index, or workgroup and local index. Invocations access disjoint memory
//! if the index is an injective affine function of these. Accesses for which this cannot be shown
//! (an index that was loaded per lane, a neighbouring texel) count as shared.
//!
//! Different bindings may be the same memory: of one buffer or image, or of ranges of a buffer that
//! overlap (`AliasedMemory`). These count as one memory, in which an access is where its view of
//! the buffer begins and the offset in that. A binding whose buffer has a device address counts as
//! memory behind addresses. Non-atomic accesses to workgroup memory are not considered:
//! its purpose is to be shared, with barriers.

mod affine;
mod aliases;
mod image_rows;
mod through_floats;

use std::borrow::Cow;
use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::machine::{Binding, Bindings, Descriptor, OpIndex, Reg, Resources};
use crate::math::array;
use crate::ops::access::Access;
use crate::ops::arithmetic::{IAdd, IMul, ISub, SNegate};
use crate::ops::atomic::{AtomicKind, Update};
use crate::ops::bit::ShiftLeftLogical;
use crate::ops::image::texel_ref::TexelRef;
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::memory::{
    BufferRef, Chunk, ComputedOffset, Length, PUSH_CONSTANTS_HANDLE, SHADER_RECORD_HANDLE, WORKGROUP_HANDLE,
};
use crate::ops::op::Op;
use crate::ops::shared_access::SharedPart;
use crate::ops::translate::InputRegisters;
use crate::program::Program;
use affine::{AffineExpr, AffineRange, Symbol, both, scaled};
use aliases::AliasedMemory;

pub use image_rows::OwnRow;

/// How memory is accessed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Memory {
    /// By the descriptors of a binding.
    Binding(Binding),
    /// By device addresses.
    Addresses,
    /// By a descriptor that is not known before running.
    Unknown,
}

/// An access to memory that all invocations share.
#[derive(Clone, Debug, PartialEq)]
pub struct MemoryAccess {
    /// The memory that is accessed.
    pub memory: Memory,
    /// Whether it stores, atomically or not.
    pub stores: bool,
    /// What it does, where it is atomic.
    pub atomic: Option<Update>,
    /// The location in it, if known: the bytes of a buffer, or the coordinates of a texel.
    place: Option<SmallVec<[AffineRange; 3]>>,
}

/// The dimensions of a launch, and its resources.
#[derive(Clone, Copy, Debug)]
pub struct LaunchExtent<'a> {
    /// `LaunchSizeKHR`, or `NumWorkgroups`.
    pub count: [u32; 3],
    /// `WorkgroupSize`; 1 in ray-tracing pipelines.
    pub local: [u32; 3],
    /// Push constants and buffers, which may contain the length of a row.
    pub resources: &'a Resources,
}

impl LaunchExtent<'_> {
    /// The dimensions larger than 1: the index along each, and its size.
    fn dimensions(&self) -> impl Iterator<Item = (Symbol, u64)> {
        let of = |dimensions: [u32; 3], symbol: fn(u8) -> Symbol| {
            dimensions.into_iter().enumerate().map(move |(axis, size)| (symbol(axis as u8), u64::from(size)))
        };
        of(self.count, Symbol::Index).chain(of(self.local, Symbol::Local)).filter(|&(_, size)| size > 1)
    }

    /// The dimensions in which an expression is injective, with steps of at least `count`; `None`
    /// where it may take one value twice.
    fn distinguished_dimensions(&self, sum: &AffineExpr, count: u64) -> Option<SmallVec<[Symbol; 6]>> {
        let dimensions: SmallVec<[(Symbol, u64); 6]> = self.dimensions().collect();
        let mut steps: SmallVec<[(i64, u64, Symbol); 6]> = SmallVec::new();
        for (symbols, factor) in &sum.0 {
            let (mut step, mut by, mut known) = (*factor, None, true);
            for symbol in symbols {
                match *symbol {
                    Symbol::Size(axis) => step = step.checked_mul(self.count[axis as usize].into())?,
                    Symbol::Index(_) | Symbol::Local(_) => {
                        match dimensions.iter().find(|dimension| dimension.0 == *symbol) {
                            // The only value is 0.
                            None => step = 0,
                            Some(_) if by.is_some() => return None,
                            Some(&dimension) => by = Some(dimension),
                        }
                    }
                    Symbol::Word(place, offset) => match self.word(place, offset) {
                        Some(word) => step = step.checked_mul(word.into())?,
                        None => known = false,
                    },
                }
            }
            match by {
                Some(_) if !known && step != 0 => return None,
                Some((symbol, size)) if step != 0 => match steps.iter_mut().find(|known| known.2 == symbol) {
                    Some(known) => known.0 = known.0.checked_add(step)?,
                    None => steps.push((step, size, symbol)),
                },
                _ => {}
            }
        }
        // The sign of a step does not matter.
        steps.sort_unstable_by_key(|&(step, size, symbol)| (step.unsigned_abs(), size, symbol));
        let mut extent = count;
        for &(step, size, _) in &steps {
            let step = step.unsigned_abs();
            if step < extent {
                return None;
            }
            extent = step.checked_mul(size - 1)?.checked_add(extent)?;
        }
        // Larger values wrap around in 32 bits.
        if extent > u64::from(u32::MAX) {
            return None;
        }
        Some(steps.into_iter().map(|(.., symbol)| symbol).collect())
    }

    /// The value of a word in memory that is uniform over all invocations.
    fn word(&self, place: Option<(Binding, u32)>, offset: u32) -> Option<u32> {
        let buffer = match place {
            None => self.resources.push_constants.as_ref()?,
            Some((binding, element)) => {
                let descriptor = self.resources.descriptors.get(&binding)?.get(element as usize)?;
                descriptor
                    .find(|kind| if let Descriptor::Buffer(buffer) = kind { Some(buffer) } else { None })?
            }
        };
        buffer.load(offset.into(), 32)
    }

    /// Whether these accesses of different invocations are disjoint; `stored` returns whether a
    /// binding may be stored to.
    fn are_disjoint(&self, accesses: &[&MemoryAccess], stored: impl Fn(Binding) -> bool) -> bool {
        let Some(first) = accesses[0].place.as_ref() else { return false };
        let mut distinguished: SmallVec<[Symbol; 6]> = SmallVec::new();
        for (at, range) in first.iter().enumerate() {
            let (_, rest) = range.from.split();
            let changes = |symbol: &Symbol| match symbol {
                Symbol::Word(Some((binding, _)), _) => stored(*binding),
                _ => false,
            };
            if rest.0.iter().any(|(symbols, _)| symbols.iter().any(changes)) {
                return false;
            }
            let (mut low, mut high) = (i64::MAX, i64::MIN);
            for access in accesses {
                let Some(own) = access.place.as_ref().and_then(|place| place.get(at)) else { return false };
                if !self.keeps_bounds(own, &stored) {
                    return false;
                }
                let (constant, other) = own.from.split();
                if other != rest || access.place.as_ref().is_some_and(|place| place.len() != first.len()) {
                    return false;
                }
                (low, high) = (low.min(constant), high.max(constant.saturating_add_unsigned(own.count)));
            }
            distinguished
                .extend(self.distinguished_dimensions(&rest, high.abs_diff(low)).unwrap_or_default());
        }
        self.dimensions().all(|(symbol, _)| distinguished.contains(&symbol))
    }

    /// The first memory that invocations share other than by commuting atomic instructions; `None`
    /// if there is none.
    pub fn shared(&self, programs: &[&Program]) -> Option<Memory> {
        self.dimensions().next()?;
        let accesses: Vec<&MemoryAccess> = programs.iter().flat_map(|program| &program.accesses).collect();
        let stored = StoredMemory::new(self, &accesses);
        let placed: Vec<Cow<'_, MemoryAccess>> =
            accesses.iter().map(|access| stored.aliases.placed(access)).collect();
        stored.memories.iter().copied().find(|&memory| {
            let unknown = memory == Memory::Unknown;
            let same = |access: &&Cow<'_, MemoryAccess>| {
                unknown || [memory, Memory::Unknown].contains(&stored.aliases.representative(access.memory))
            };
            let same: Vec<&MemoryAccess> = placed.iter().filter(same).map(|access| &**access).collect();
            !commute(&same) && !self.are_disjoint(&same, |binding| stored.may_change(binding))
        })
    }
}

/// Whether all of these accesses are atomic, and those that may overlap commute with each other.
fn commute(accesses: &[&MemoryAccess]) -> bool {
    let pairs = accesses.iter().enumerate().flat_map(|(at, a)| accesses[at..].iter().map(move |b| (a, b)));
    accesses.iter().all(|access| access.atomic.is_some())
        && pairs.into_iter().all(|(a, b)| {
            let commute = a.atomic.zip(b.atomic).is_some_and(|(a, b)| a.commutes_with(b));
            commute || never_overlap(a, b)
        })
}

/// Whether two accesses to one memory never overlap, whatever invocations make them.
fn never_overlap(a: &MemoryAccess, b: &MemoryAccess) -> bool {
    let (Some(a), Some(b)) = (&a.place, &b.place) else { return false };
    a.len() == b.len() && a.iter().zip(b).any(|(a, b)| a.is_disjoint_from(b))
}

/// The memory that shaders store to.
struct StoredMemory {
    aliases: AliasedMemory,
    memories: Vec<Memory>,
}

impl StoredMemory {
    fn new(extent: &LaunchExtent<'_>, accesses: &[&MemoryAccess]) -> Self {
        let aliases = AliasedMemory::of(extent.resources, accesses);
        let stores = accesses.iter().filter(|access| access.stores);
        let mut memories: Vec<Memory> = stores.map(|access| aliases.representative(access.memory)).collect();
        memories.sort_unstable();
        memories.dedup();
        Self { aliases, memories }
    }

    /// Whether something may be stored to a binding.
    fn may_change(&self, binding: Binding) -> bool {
        let memories = [self.aliases.representative(Memory::Binding(binding)), Memory::Unknown];
        memories.iter().any(|one| self.memories.contains(one))
    }
}

/// The accesses of a program to memory that all invocations share, without duplicates.
pub fn accesses(program: &Program) -> Vec<MemoryAccess> {
    let has_accesses = program.ops.iter().any(|op| {
        let mut found = false;
        op.shared_accesses(&mut |_, _| found = true);
        found
    });
    if !has_accesses {
        return Vec::new();
    }
    let mut values = ValueTracking::new(program);
    let mut found: Vec<MemoryAccess> = Vec::new();
    for op in &program.ops {
        op.shared_accesses(&mut |used, part| {
            let access = match part {
                SharedPart::Bytes(chunk) => values.bytes(chunk, used.stores(), used.update()),
                SharedPart::Texel(texel) => Some(values.texel(texel, used.stores(), used.update())),
                // The texels that a sampler reads are not analysed.
                SharedPart::Texels { image, .. } => Some(MemoryAccess::load_anywhere(values.handle(image))),
            };
            if let Some(access) = access.filter(|access| !found.contains(access)) {
                found.push(access);
            }
        });
    }
    found
}

impl MemoryAccess {
    /// A load from an unknown location.
    fn load_anywhere(memory: Memory) -> Self {
        Self { memory, stores: false, atomic: None, place: None }
    }
}

/// Whether the invocations of a workgroup modify its memory by atomic instructions that do not
/// commute: the result depends on which of them run together.
pub fn mixes_workgroup_atomics(program: &Program) -> bool {
    let mut found: SmallVec<[(Chunk, Update); 4]> = SmallVec::new();
    for op in &program.ops {
        op.shared_accesses(&mut |used, part| {
            if let (Some(update), SharedPart::Bytes(chunk)) = (used.update(), part)
                && let BufferRef::Workgroup | BufferRef::Computed(_) = chunk.buffer
            {
                found.push((*chunk, update));
            }
        });
    }
    if found.len() < 2 || program.workgroup.is_none_or(|layout| layout.memory == 0) {
        return false;
    }
    // A pointer that may point elsewhere counts as a pointer to workgroup memory.
    let mut values = ValueTracking::new(program);
    let access = |(chunk, update): &(Chunk, Update)| {
        let place = values.byte_range(chunk, None);
        MemoryAccess {
            memory: Memory::Unknown,
            stores: update.kind != AtomicKind::Load,
            atomic: Some(*update),
            place,
        }
    };
    let accesses: Vec<MemoryAccess> = found.iter().map(access).collect();
    !commute(&accesses.iter().collect::<Vec<_>>())
}

/// No operation writes a register.
const NONE: OpIndex = OpIndex(u32::MAX);
/// Several operations write a register.
const SEVERAL: OpIndex = OpIndex(u32::MAX - 1);

/// Value tracking: expresses the values of registers by launch indices, through the operations that
/// write them.
struct ValueTracking<'a> {
    program: &'a Program,
    /// By register: the only operation that writes it, [`NONE`], or [`SEVERAL`].
    writers: Vec<OpIndex>,
    constants: FxHashMap<Reg, u32>,
    known: FxHashMap<Reg, Option<AffineRange>>,
}

impl<'a> ValueTracking<'a> {
    fn new(program: &'a Program) -> Self {
        let mut writers = vec![NONE; program.register_count as usize + 1];
        for (at, op) in (0..).map(OpIndex).zip(&program.ops) {
            op.accesses(|access| {
                if let Access::Write(first, count) = access {
                    for writer in &mut writers[first.0 as usize..(first.0 + count) as usize] {
                        *writer = if [NONE, at].contains(writer) { at } else { SEVERAL };
                    }
                }
            });
        }
        let constants = program.constants.iter().copied().collect();
        Self { program, writers, constants, known: FxHashMap::default() }
    }

    /// An access to a range of a buffer; `None` for memory that is not shared, or only read.
    fn bytes(&mut self, chunk: &Chunk, stores: bool, atomic: Option<Update>) -> Option<MemoryAccess> {
        let mut address = None;
        let memory = match chunk.buffer {
            BufferRef::PushConstants | BufferRef::ShaderRecord | BufferRef::Workgroup => return None,
            BufferRef::Handle(handle) => self.binding(handle),
            BufferRef::Computed(reg) => match self.constants.get(&reg) {
                Some(&(PUSH_CONSTANTS_HANDLE | SHADER_RECORD_HANDLE | WORKGROUP_HANDLE)) => return None,
                _ => self.handle(reg),
            },
            BufferRef::Address(reg) => {
                address = Some(reg);
                Memory::Addresses
            }
        };
        Some(MemoryAccess { memory, stores, atomic, place: self.byte_range(chunk, address) })
    }

    /// The bytes of an access, as offsets in the buffer or as addresses.
    fn byte_range(&mut self, chunk: &Chunk, address: Option<Reg>) -> Option<SmallVec<[AffineRange; 3]>> {
        let mut base = Some(AffineRange::exactly(AffineExpr::constant(chunk.offset.into())));
        if let Some(address) = address {
            base = plus(base, self.value(address));
        }
        if let Some(index) = chunk.index {
            base = plus(base, self.value(index));
        }
        let bytes = u64::from(chunk.count) * u64::from(chunk.width / 8);
        base.and_then(|range| {
            let count = (range.count - 1).checked_add(bytes)?;
            Some(SmallVec::from_iter([AffineRange { count, ..range }]))
        })
    }

    fn texel(&mut self, texel: &TexelRef, stores: bool, atomic: Option<Update>) -> MemoryAccess {
        let memory = self.handle(texel.image);
        let plain = texel.offset.is_none() && texel.level.is_none() && texel.sample.is_none();
        let place: Option<SmallVec<[AffineRange; 3]>> =
            texel.coordinate.iter().map(|&reg| self.value(reg)).collect();
        MemoryAccess { memory, stores, atomic, place: place.filter(|_| plain) }
    }

    fn binding(&self, handle: u32) -> Memory {
        let slot = Bindings::slot_of(handle).and_then(|(slot, _)| self.program.slots.get(slot));
        slot.map_or(Memory::Unknown, |slot| Memory::Binding(slot.binding))
    }

    /// The binding of a computed handle: its array element may be any.
    fn handle(&mut self, mut reg: Reg) -> Memory {
        // A chain has as many links as there are operations at most; more of them are a circle.
        for _ in 0..=self.program.ops.len() {
            if let Some(&handle) = self.constants.get(&reg) {
                return self.binding(handle);
            }
            let Some(writer) = self.writer(reg) else { return Memory::Unknown };
            reg = match (writer.computed_offset(), writer.copy()) {
                // An element's number, behind the handle of the first one: see `pointer::shifted`.
                (Some(ComputedOffset { base: Some(_), stride, index, .. }), _)
                    if self.constants.get(&index) == Some(&1) && Bindings::slot_of(stride).is_some() =>
                {
                    return self.binding(stride);
                }
                (Some(ComputedOffset { base: Some(base), .. }), _) => base,
                (_, Some(copy)) => copy.from,
                _ => {
                    let heap = writer.heap_descriptor();
                    return heap.map_or(Memory::Unknown, |found| self.binding(found.first));
                }
            };
        }
        Memory::Unknown
    }

    fn writer(&self, reg: Reg) -> Option<&'a Op> {
        self.program.ops.get(self.writers.get(reg.0 as usize)?.index())
    }

    /// The range of a register's values; `None` if it is not known.
    ///
    /// A chain of operations may be as long as the program: its operands are visited first, from a
    /// worklist.
    fn value(&mut self, reg: Reg) -> Option<AffineRange> {
        let mut open = vec![(reg, false)];
        while let Some((reg, ready)) = open.pop() {
            if ready {
                let value = self.compute_value(reg);
                self.known.insert(reg, value);
            } else if let Entry::Vacant(entry) = self.known.entry(reg) {
                // To arrive here again while it is looked for is a cycle.
                entry.insert(None);
                open.push((reg, true));
                let sources = self.sources(reg);
                open.extend(sources.into_iter().rev().map(|source| (source, false)));
            }
        }
        self.known_value(reg)
    }

    /// The value that was computed of a register before.
    fn known_value(&self, reg: Reg) -> Option<AffineRange> {
        self.known.get(&reg).cloned().flatten()
    }

    /// The registers that [`ValueTracking::compute_value`] reads for a register.
    fn sources(&self, reg: Reg) -> SmallVec<[Reg; 2]> {
        let is_given = self.constants.contains_key(&reg) || self.input_of(reg).is_some();
        let Some(writer) = self.writer(reg).filter(|_| !is_given) else { return SmallVec::new() };
        if let Some(copy) = writer.copy() {
            return SmallVec::from_slice(&[copy.from]);
        }
        if let Some(offset) = writer.computed_offset() {
            return offset.base.into_iter().chain([offset.index]).collect();
        }
        match *writer {
            Op::LaneKernel { kernel, from: [a, ..], .. } if through_floats::gives_integer(kernel) => {
                self.converted(a).into_iter().map(|converted| converted.integer).collect()
            }
            Op::LaneKernel { kernel, from: [a, b, _], .. } if is_followed(kernel) => {
                SmallVec::from_slice(&[a, b])
            }
            _ => SmallVec::new(),
        }
    }

    /// The builtin that lies in a register.
    fn input_of(&self, reg: Reg) -> Option<&InputRegisters> {
        let holds = |input: &&InputRegisters| (input.first.0..input.first.0 + input.count).contains(&reg.0);
        self.program.inputs.iter().find(holds)
    }

    /// What a register holds, given what is known of those that it is made of.
    fn compute_value(&self, reg: Reg) -> Option<AffineRange> {
        let exactly = |from| Some(AffineRange::exactly(from));
        if let Some(&word) = self.constants.get(&reg) {
            return exactly(AffineExpr::constant(word.into()));
        }
        if let Some(input) = self.input_of(reg) {
            return exactly(self.builtin(input.builtin.number, (reg.0 - input.first.0) as u8)?);
        }
        let writer = self.writer(reg)?;
        if let Some(copy) = writer.copy() {
            return self.known_value(copy.from);
        }
        if let Some(ComputedOffset { base, index, stride, length, .. }) = writer.computed_offset() {
            let base = base.map_or_else(|| exactly(AffineExpr::default()), |base| self.known_value(base));
            let by = match (self.known_value(index), length) {
                (Some(index), _) => scaled(index, stride.into()),
                (None, Length::Known(length)) => {
                    let count = u64::from(length.saturating_sub(1)) * u64::from(stride) + 1;
                    Some(AffineRange { count, ..AffineRange::exactly(AffineExpr::default()) })
                }
                (None, Length::Unknown) => None,
            };
            return plus(base, by);
        }
        if let Some((to, chunk)) = writer.buffer_load() {
            let index = chunk.index.map_or(Some(0), |index| self.constants.get(&index).copied())?;
            let offset = chunk.offset.checked_add(index)?.checked_add((reg.0 - to.0).checked_mul(4)?)?;
            let place = match chunk.buffer {
                BufferRef::PushConstants => None,
                BufferRef::Handle(handle) => match self.binding(handle) {
                    Memory::Binding(binding) => Some((binding, Bindings::slot_of(handle)?.1)),
                    _ => return None,
                },
                _ => return None,
            };
            return exactly(AffineExpr::symbol(Symbol::Word(place, offset))).filter(|_| chunk.width == 32);
        }
        match *writer {
            Op::LaneKernel { kernel, from: [a, b, _], .. } => {
                if is(kernel, IAdd.kernel(32)) || is(kernel, IAdd.kernel(64)) || is_address(kernel) {
                    return plus(self.known_value(a), self.known_value(b));
                }
                if is(kernel, IMul.kernel(32)) {
                    let (a, b) = (self.known_value(a)?, self.known_value(b)?);
                    return match (a.count, b.count) {
                        (1, 1) => {
                            let bounds = both(a.bounds, &b.bounds)?;
                            Some(AffineRange { from: a.from.times(&b.from)?, count: 1, bounds })
                        }
                        _ => None,
                    };
                }
                if is(kernel, ISub.kernel(32)) {
                    return minus(self.known_value(a), self.known_value(b));
                }
                if is(kernel, SNegate.kernel(32)) {
                    return minus(exactly(AffineExpr::default()), self.known_value(a));
                }
                if is(kernel, ShiftLeftLogical.kernel(32)) {
                    let by = *self.constants.get(&b)?;
                    return scaled(self.known_value(a)?, 1u64.checked_shl(by)?);
                }
                if through_floats::gives_integer(kernel) {
                    let converted = self.converted(a)?;
                    return converted.back(self.known_value(converted.integer)?);
                }
                None
            }
            _ => None,
        }
    }

    /// A component of a builtin as an expression.
    fn builtin(&self, number: u32, axis: u8) -> Option<AffineExpr> {
        let size = array::map(self.program.workgroup.map_or([1; 3], |layout| layout.size), i64::from);
        let of = |symbol, factor| AffineExpr::of(SmallVec::from_slice(&[symbol]), factor);
        match number {
            LAUNCH_ID | WORKGROUP_ID => Some(AffineExpr::symbol(Symbol::Index(axis))),
            LAUNCH_SIZE | NUM_WORKGROUPS => Some(AffineExpr::symbol(Symbol::Size(axis))),
            LOCAL_INVOCATION_ID => Some(AffineExpr::symbol(Symbol::Local(axis))),
            GLOBAL_INVOCATION_ID => {
                of(Symbol::Index(axis), size[axis as usize]).plus(&AffineExpr::symbol(Symbol::Local(axis)))
            }
            LOCAL_INVOCATION_INDEX => AffineExpr::symbol(Symbol::Local(0))
                .plus(&of(Symbol::Local(1), size[0]))?
                .plus(&of(Symbol::Local(2), size[0] * size[1])),
            _ => None,
        }
    }
}

fn is(kernel: &LaneKernel, known: Option<&LaneKernel>) -> bool {
    known.is_some_and(|known| std::ptr::eq(kernel, known))
}

/// Whether [`ValueTracking::compute_value`] goes by the operands of a kernel.
fn is_followed(kernel: &LaneKernel) -> bool {
    let families = [&IAdd, &IMul, &ISub, &SNegate, &ShiftLeftLogical];
    families.iter().any(|family| is(kernel, family.kernel(32)))
        || is(kernel, IAdd.kernel(64))
        || is_address(kernel)
}

fn is_address(kernel: &LaneKernel) -> bool {
    std::ptr::eq(kernel, &crate::ops::address::kernels::AddressPlus.kernels[0])
}

fn plus(a: Option<AffineRange>, b: Option<AffineRange>) -> Option<AffineRange> {
    let (a, b) = (a?, b?);
    let bounds = both(a.bounds, &b.bounds)?;
    Some(AffineRange { from: a.from.plus(&b.from)?, count: a.count.checked_add(b.count - 1)?, bounds })
}

fn minus(a: Option<AffineRange>, b: Option<AffineRange>) -> Option<AffineRange> {
    let b = b?;
    // The negated range begins at the negated last value of `b`.
    let last = b.from.plus(&AffineExpr::constant(i64::try_from(b.count - 1).ok()?))?;
    plus(a, Some(AffineRange { from: last.times(&AffineExpr::constant(-1))?, ..b }))
}

/// Builtins, numbers of the specification.
const NUM_WORKGROUPS: u32 = 24;
const WORKGROUP_ID: u32 = 26;
const LOCAL_INVOCATION_ID: u32 = 27;
const GLOBAL_INVOCATION_ID: u32 = 28;
const LOCAL_INVOCATION_INDEX: u32 = 29;
const LAUNCH_ID: u32 = 5319;
const LAUNCH_SIZE: u32 = 5320;
