//! Data races: two invocations access the same bytes, at least one writes, not both are atomic, and
//! nothing orders them (Vulkan, "Memory Model", "Data Race").
//!
//! Each word keeps its latest accesses, in the manner of FastTrack: the last store, a load or two
//! since, the last atomic access. An access races with one of these unless it happens after it:
//!
//! * Accesses of one invocation are ordered; the shaders that a trace calls are of its invocation.
//! * A control barrier of scope Workgroup orders the invocations of a workgroup for the storage
//!   classes of its memory semantics, and for those of all memory barriers of the module: whether
//!   these stand beside the control barrier is not looked at.
//! * A control barrier of scope Subgroup orders the invocations of a subgroup. Where a module has
//!   one, accesses within a subgroup count as ordered throughout; in ray tracing, where subgroups
//!   change, all accesses do.
//! * Atomic instructions order what stands before a release with what stands behind an acquire.
//!   Where both workgroups (in ray tracing: invocations) have executed an atomic instruction that
//!   can release or acquire since the earlier access, it counts as ordered, whichever location the
//!   instructions were on.
//!
//! So a pair that is reported is not ordered, but not all that are unordered are found. Loads whose
//! result is unused, samples of images and read-only bindings are not looked at.

use rspirv::spirv::Op as Opcode;
use rustc_hash::FxHashSet;

use crate::machine::{Batch, Binding, Bindings, Reg};
use crate::module::Id;
use crate::ops::atomic::{AtomicKind, AtomicOp, AtomicTarget};
use crate::ops::image::ImageOp;
use crate::ops::image::reader::LaneReader;
use crate::ops::image::texel_ref::TexelRef;
use crate::ops::memory::{BufferRef, Chunk, MemoryOp, access_location, is_workgroup};
use crate::ops::op::Op;
use crate::program::Program;
use crate::sanitize::cause::OpPlace;
use crate::sanitize::memory_shadow::{Access, MemoryKey, SharedAccesses};
use crate::sanitize::plan::{InstructionWords, ProgramPlan};
use crate::sanitize::races::order::{Accessor, Class, Classes, Event, LaneOrder, Order};
use crate::sanitize::rule::{Rule, race};

mod order;

pub(super) use order::AccessKind;

/// Where two accesses meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Location {
    /// Bytes of a buffer: the descriptor's handle, if there is one.
    Buffer { handle: Option<u32>, offset: u64, bytes: u32 },
    /// Bytes of the workgroup's memory.
    Workgroup { offset: u32, bytes: u32 },
    /// A texel of an image, by the descriptor's handle.
    Texel { handle: u32 },
}

/// Two accesses that race.
#[derive(Clone, Copy, Debug)]
pub(super) struct Race {
    /// The rule that they break.
    pub rule: &'static Rule,
    /// The lane of the later one.
    pub lane: usize,
    /// What the later one does.
    pub kind: AccessKind,
    /// What both access.
    pub location: Location,
    /// Where the earlier one stands.
    pub other: OpPlace,
    /// What it does.
    pub other_kind: AccessKind,
    /// The number of its invocation in the launch.
    pub other_invocation: u32,
}

/// The accesses of a launch or dispatch so far.
#[derive(Debug)]
pub(super) struct Races {
    accesses: SharedAccesses,
    order: Order,
    /// The lanes of the batch that runs; none before its first access.
    lanes: Vec<LaneOrder>,
    /// The last event, and its number.
    event: (Event, u32),
    /// By shader and operation: whether it accesses memory that may be written.
    watched: Vec<Vec<bool>>,
}

impl Races {
    /// Nothing was accessed yet by the shaders of a pipeline, or of a dispatch.
    pub(super) fn new(plans: &[ProgramPlan]) -> Self {
        let programs = || plans.iter().map(|plan| &*plan.program);
        let written = Written::by(programs());
        let watched = programs().map(|program| written.watched(program)).collect();
        let order = Order::of(programs());
        Self {
            accesses: SharedAccesses::default(),
            order,
            lanes: Vec::new(),
            event: (Event::NONE, 0),
            watched,
        }
    }

    /// Other workgroups run, from one on.
    pub(super) fn begin_workgroups(&mut self, first: u32, subgroup_size: u32) {
        self.accesses.forget_workgroups();
        self.order.begin_workgroups(first, subgroup_size);
    }

    /// Whether an operation accesses memory that may be written.
    #[inline]
    pub(super) fn watches(&self, place: OpPlace) -> bool {
        self.watched[place.shader.index()][place.op.index()]
    }

    /// The running invocations wait at a control barrier of scope Workgroup.
    pub(super) fn barrier<const W: usize>(&mut self, batch: &Batch<W>, program: &Program, place: OpPlace) {
        let own = match instruction(program, place).words {
            &[_, _, _, semantics, ..] => Classes::of(program.module.scalar_value(Id(semantics))),
            _ => Classes::ALL,
        };
        for lane in batch.mask.lanes() {
            self.order.barrier(batch.invocations.number(lane) as u32, own);
        }
    }

    /// The running invocations have loaded or stored a part of a buffer, or of the workgroup's
    /// memory. `values` is the first register of what is stored.
    pub(super) fn access_buffer<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        bindings: &Bindings,
        place: OpPlace,
        chunk: &Chunk,
        kind: AccessKind,
        values: Option<Reg>,
    ) -> Vec<Race> {
        self.access_lanes(batch, bindings, place, chunk, values, |_| kind)
    }

    fn access_lanes<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        bindings: &Bindings,
        place: OpPlace,
        chunk: &Chunk,
        values: Option<Reg>,
        kind: impl Fn(usize) -> AccessKind,
    ) -> Vec<Race> {
        self.prepare_lanes(batch);
        let mut races = Vec::new();
        let bytes = chunk.width / 8 * chunk.count;
        for lane in batch.mask.lanes() {
            let Some((buffer, offset)) = access_location(batch, lane, bindings, chunk) else { continue };
            let handle = match chunk.buffer {
                BufferRef::PushConstants | BufferRef::ShaderRecord => continue,
                BufferRef::Handle(handle) => Some(handle),
                BufferRef::Computed(register) => Some(batch.registers[register].0[lane]),
                BufferRef::Workgroup | BufferRef::Address(_) => None,
            };
            let in_workgroup = is_workgroup(&batch.registers, lane, chunk.buffer);
            let class = if in_workgroup { Class::Workgroup } else { Class::Buffer };
            let now = self.accessor(lane, class);
            let (key, at) = match in_workgroup {
                true => (MemoryKey::Workgroup(now.group), offset),
                false => (MemoryKey::Buffer(buffer.memory_id()), buffer.offset() + offset),
            };
            let kind = kind(lane);
            let access = self.number(place, kind, &now);
            let value = |from: u32, size: u32| {
                values.map_or(0, |first| stored_bits(batch, lane, first, chunk.width / 8, from, size))
            };
            let mut worst: Option<(&'static Rule, Access, u32, u32)> = None;
            let Self { accesses, order, .. } = self;
            accesses.visit(key, at, bytes, |from, size, cell| {
                let found = order.access(cell, &now, kind, access, value(from, size));
                let Some((rule, other)) = found else { return };
                if worst.is_none_or(|(known, ..)| severity(rule) > severity(known)) {
                    worst = Some((rule, other, from, size));
                }
            });
            if let Some((rule, other, from, size)) = worst {
                let location = match in_workgroup {
                    true => Location::Workgroup { offset: offset as u32 + from, bytes: size },
                    false => Location::Buffer { handle, offset: offset + u64::from(from), bytes: size },
                };
                races.push(self.race(rule, lane, kind, location, other));
            }
        }
        races
    }

    /// The running invocations have executed an atomic instruction.
    pub(super) fn access_atomic<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        bindings: &Bindings,
        program: &Program,
        place: OpPlace,
        atomic: &AtomicOp,
    ) -> Vec<Race> {
        let kind = |lane: usize| match atomic.kind {
            AtomicKind::Load => AccessKind::AtomicLoad,
            AtomicKind::CompareExchange => {
                let word = |first: Reg, at: u32| batch.registers[first.plus(at)].0[lane];
                let fails = (0..atomic.words()).any(|at| word(atomic.to, at) != word(atomic.comparator, at));
                if fails { AccessKind::AtomicLoad } else { AccessKind::AtomicUpdate }
            }
            _ => AccessKind::AtomicUpdate,
        };
        let races = match &atomic.target {
            AtomicTarget::Buffer(chunk) => self.access_lanes(batch, bindings, place, chunk, None, kind),
            AtomicTarget::Texel(texel) => self.access_texels(batch, bindings, place, texel, kind, |_| 0),
            AtomicTarget::Registers { .. } => return Vec::new(),
        };
        let invocations = batch.mask.lanes().map(|lane| batch.invocations.number(lane) as u32);
        self.order.synchronize(invocations, atomic_classes(program, place));
        races
    }

    /// The running invocations have read or written texels.
    pub(super) fn access_image<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        bindings: &Bindings,
        place: OpPlace,
        image: &ImageOp,
    ) -> Vec<Race> {
        match image {
            ImageOp::Read(read) => {
                self.access_texels(batch, bindings, place, &read.texel, |_| AccessKind::Load, |_| 0)
            }
            ImageOp::Write(write) => {
                let words = if write.texel.view.wide { 2 } else { 1 };
                let value = |lane: usize| {
                    let registers = write.from.iter().flat_map(|from| (0..words).map(|word| from.plus(word)));
                    // Of different texels only few have the same number.
                    registers.fold(0u32, |all, register| {
                        (all.rotate_left(5) ^ batch.registers[register].0[lane]).wrapping_mul(0x9E37_79B9)
                    })
                };
                self.access_texels(batch, bindings, place, &write.texel, |_| AccessKind::Store, value)
            }
            _ => Vec::new(),
        }
    }

    fn access_texels<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        bindings: &Bindings,
        place: OpPlace,
        texel: &TexelRef,
        kind: impl Fn(usize) -> AccessKind,
        value: impl Fn(usize) -> u32,
    ) -> Vec<Race> {
        self.prepare_lanes(batch);
        let mut races = Vec::new();
        for lane in batch.mask.lanes() {
            let reader = LaneReader::new(&batch.registers, lane, bindings);
            let Ok((image, index)) = texel.resolve(reader) else { continue };
            let now = self.accessor(lane, Class::Image);
            let kind = kind(lane);
            let access = self.number(place, kind, &now);
            let key = MemoryKey::Image(std::ptr::from_ref(image).addr());
            let (mut found, value) = (None, value(lane));
            let Self { accesses, order, .. } = self;
            accesses.visit(key, 4 * index as u64, 4, |_, _, cell| {
                found = order.access(cell, &now, kind, access, value);
            });
            if let Some((rule, other)) = found {
                let location = Location::Texel { handle: reader.word(texel.image) };
                races.push(self.race(rule, lane, kind, location, other));
            }
        }
        races
    }

    /// A batch begins to run, or goes on.
    pub(super) fn resumed(&mut self) {
        self.lanes.clear();
    }

    fn prepare_lanes<const W: usize>(&mut self, batch: &Batch<W>) {
        if self.lanes.is_empty() {
            let order = &self.order;
            self.lanes.extend((0..W).map(|lane| order.lane(batch.invocations.number(lane) as u32)));
        }
    }

    #[inline]
    fn accessor(&self, lane: usize, class: Class) -> Accessor {
        let LaneOrder { invocation, group, epochs } = self.lanes[lane];
        Accessor { invocation, group, epoch: epochs[class as usize], class }
    }

    #[inline]
    fn number(&mut self, place: OpPlace, kind: AccessKind, now: &Accessor) -> Access {
        let event = self.order.new_event(place, kind, now.epoch);
        if self.event.0 != event {
            self.event = (event, self.order.number(event));
        }
        Access { invocation: now.invocation, event: self.event.1 }
    }

    fn race(
        &self,
        rule: &'static Rule,
        lane: usize,
        kind: AccessKind,
        location: Location,
        other: Access,
    ) -> Race {
        let Event { place, kind: other_kind, .. } = *self.order.event(other);
        Race { rule, lane, kind, location, other: place, other_kind, other_invocation: other.invocation }
    }
}

/// Of the races of one access the one with the greatest number is told.
fn severity(rule: &Rule) -> u32 {
    match () {
        () if rule == &race::RACE_SAME_VALUE => 0,
        () if rule == &race::RACE_MIXED_ATOMIC => 1,
        () => 2,
    }
}

/// The bits that a lane has stored from a byte on: of a scalar of `width` bytes, or of several.
#[inline]
fn stored_bits<const W: usize>(
    batch: &Batch<W>,
    lane: usize,
    first: Reg,
    width: u32,
    from: u32,
    size: u32,
) -> u32 {
    let word = |scalar: u32| batch.registers[first.plus(scalar)].0[lane];
    if width == size {
        return word(from / width) & (u32::MAX >> (32 - 8 * size));
    }
    let byte = |at: u32| word(at / width) >> (8 * (at % width)) & 0xFF;
    (0..size).fold(0, |bits, at| bits | byte(from + at) << (8 * at))
}

/// The invocations of an invocation's number, for reports: its launch index.
pub(super) fn launch_id<const W: usize>(
    batch: &Batch<W>,
    lane: usize,
    program: &Program,
    invocation: u32,
) -> [u32; 3] {
    let unpack = |number: u32, [width, height, _]: [u32; 3]| {
        let (width, height) = (width.max(1), height.max(1));
        [number % width, number / width % height, number / width / height]
    };
    let (Some(layout), Some(workgroup)) = (program.workgroup, batch.invocations.workgroup(lane)) else {
        return unpack(invocation, batch.invocations.launch_size);
    };
    let size = workgroup.invocations();
    let id = unpack(invocation / size, workgroup.count);
    let local = workgroup.local_id(layout.index_of(invocation % size));
    std::array::from_fn(|axis| id[axis] * workgroup.size[axis] + local[axis])
}

/// The memory that the shaders of a pipeline, or of a dispatch, may write.
#[derive(Debug, Default)]
struct Written {
    bindings: FxHashSet<Binding>,
    /// Whether a buffer is written that is only known while running.
    unknown: bool,
    images: bool,
}

impl Written {
    fn by<'p>(programs: impl Iterator<Item = &'p Program>) -> Self {
        let mut written = Self::default();
        for program in programs {
            for op in &program.ops {
                match op {
                    Op::Memory(MemoryOp::BufferStore { chunk, .. }) => written.add(program, chunk),
                    Op::Atomic(atomic) => match &atomic.target {
                        AtomicTarget::Buffer(chunk) => written.add(program, chunk),
                        AtomicTarget::Texel(_) => written.images = true,
                        AtomicTarget::Registers { .. } => {}
                    },
                    Op::Image(ImageOp::Write(_)) => written.images = true,
                    _ => {}
                }
            }
        }
        written
    }

    fn add(&mut self, program: &Program, chunk: &Chunk) {
        match chunk.buffer {
            BufferRef::Handle(handle) => self.bindings.extend(binding(program, handle)),
            BufferRef::Computed(_) | BufferRef::Address(_) => self.unknown = true,
            BufferRef::Workgroup | BufferRef::PushConstants | BufferRef::ShaderRecord => {}
        }
    }

    /// By operation of a program, whether it accesses memory that may be written.
    fn watched(&self, program: &Program) -> Vec<bool> {
        let chunk = |chunk: &Chunk| match chunk.buffer {
            BufferRef::Workgroup => true,
            BufferRef::PushConstants | BufferRef::ShaderRecord => false,
            BufferRef::Computed(_) | BufferRef::Address(_) => self.unknown || !self.bindings.is_empty(),
            BufferRef::Handle(handle) => {
                self.unknown || binding(program, handle).is_some_and(|one| self.bindings.contains(&one))
            }
        };
        let watched = program.ops.iter().enumerate().map(|(at, op)| match op {
            // Compilers drop loads whose result is unused.
            _ if program.silent.get(at) == Some(&true) => false,
            Op::Memory(
                MemoryOp::BufferLoad { chunk: part, .. } | MemoryOp::BufferStore { chunk: part, .. },
            ) => chunk(part),
            Op::Atomic(atomic) => match &atomic.target {
                AtomicTarget::Buffer(part) => chunk(part),
                AtomicTarget::Texel(_) => true,
                AtomicTarget::Registers { .. } => false,
            },
            Op::Image(ImageOp::Read(_)) => self.images,
            Op::Image(ImageOp::Write(_)) => true,
            _ => false,
        });
        watched.collect()
    }
}

/// The binding of a descriptor.
fn binding(program: &Program, handle: u32) -> Option<Binding> {
    Some(program.slots.get(Bindings::slot_of(handle)?.0)?.binding)
}

fn instruction(program: &Program, place: OpPlace) -> InstructionWords<'_> {
    let offset = program.origins.get(place.op.index()).map_or(u32::MAX, |origin| origin.offset);
    InstructionWords::at(&program.module, offset)
}

/// The classes that an atomic instruction releases or acquires by itself.
fn atomic_classes(program: &Program, place: OpPlace) -> Classes {
    let InstructionWords { opcode, words } = instruction(program, place);
    let classes = |at: usize| {
        let id = words.get(at).map(|&word| Id(word));
        Classes::of(id.and_then(|id| program.module.scalar_value(id)))
    };
    match opcode {
        Some(Opcode::AtomicStore) => classes(3),
        Some(Opcode::AtomicCompareExchange) => classes(5).with(classes(6)),
        _ => classes(5),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{Mask, Registers};

    #[test]
    fn bits_of_stores_are_taken_from_registers() {
        let mut batch = Batch::<1>::new(Registers::new(4));
        for (register, word) in [(0, 0x0403_0201), (1, 0xFFFF_0605), (2, 0x0807)] {
            batch.registers.set(Reg(register), word, Mask::ALL);
        }
        assert_eq!(stored_bits(&batch, 0, Reg(0), 4, 0, 4), 0x0403_0201);
        assert_eq!(stored_bits(&batch, 0, Reg(0), 4, 2, 1), 3);
        assert_eq!(stored_bits(&batch, 0, Reg(1), 2, 0, 4), 0x0807_0605);
        assert_eq!(stored_bits(&batch, 0, Reg(1), 2, 0, 2), 0x0605);
    }
}
