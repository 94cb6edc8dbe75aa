//! Data races: two invocations access the same bytes, at least one writes, not both are atomic, and
//! nothing orders them (Vulkan, "Memory Model", "Data Race").
//!
//! Each word keeps its latest accesses, in the manner of FastTrack: the last store, a load or two
//! since, the last atomic access. An access races with one of these unless it happens after it:
//!
//! * Accesses of one invocation of a shader are ordered. The shaders that a trace calls are
//!   invocations of their own: they are ordered with their caller, and with those of later traces,
//!   where the earlier shader has an instruction that releases and the later one has one that
//!   acquires. The shaders of one trace are not ordered among each other.
//! * A control barrier of scope Workgroup orders the invocations of a workgroup for the storage
//!   classes of its memory semantics; without the Vulkan memory model also for those of all memory
//!   barriers of the module, as whether these stand beside the control barrier is not looked at.
//! * A control barrier of scope Subgroup orders the invocations of a subgroup. Without the Vulkan
//!   memory model, where a module has one, accesses within a subgroup count as ordered throughout;
//!   in ray tracing, where subgroups change, all accesses do.
//! * Atomic instructions order what stands before a release with what stands behind an acquire,
//!   where the one that acquires reads what the other, or its release sequence, has written: their
//!   own, or those of a fence that the invocation has passed before the instruction, or passes
//!   behind it ([`synchronization`]).
//!
//! Atomic instructions are ordered among each other where they have one width, go through one
//! descriptor, and each is in the scope of the other. Ordered accesses through different
//! descriptors are looked at, too, and those that are not coherent. With the Vulkan memory model, a
//! write must be available, and visible to a read, by chains of operations that lead from one to
//! the other ([`knowledge`]).
//!
//! So a pair that is reported is not ordered, but not all that are unordered are found. Loads whose
//! result is unused, samples of images and read-only bindings are not looked at.

use anyhit_engine::module::Opcode;
use rustc_hash::FxHashSet;

use crate::cause::OpPlace;
use crate::memory_shadow::{Access, MemoryKey, SharedAccesses};
use crate::plan::{InstructionWords, ProgramPlan};
use crate::races::bindings::{References, Written};
use crate::races::class::Class;
use crate::races::conflict::rank;
use crate::races::order::{AccessForm, Accessor, Event, LaneOrder, Order};
use crate::races::ordering::Semantics;
use crate::races::synchronization::AtomicAccess;
use crate::rule::Rule;
use anyhit_engine::machine::{Batch, Binding, Bindings, Reg};
use anyhit_engine::math::array;
use anyhit_engine::ops::atomic::{AtomicKind, AtomicOp, AtomicTarget};
use anyhit_engine::ops::image::ImageOp;
use anyhit_engine::ops::image::reader::LaneReader;
use anyhit_engine::ops::image::texel_ref::TexelRef;
use anyhit_engine::ops::memory::{BufferRef, Chunk, access_location, is_workgroup};
use anyhit_engine::program::Program;

mod bindings;
mod calls;
mod class;
mod conflict;
mod knowledge;
mod level;
#[cfg(test)]
mod litmus;
#[cfg(test)]
mod litmus_calls;
#[cfg(test)]
mod litmus_families;
#[cfg(test)]
mod litmus_model;
#[cfg(test)]
mod litmus_oracle;
#[cfg(test)]
mod litmus_shapes;
mod order;
mod ordering;
mod synchronization;
mod traits;

pub(super) use bindings::overlapping_bindings;
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
    /// Whether that is the invocation of the later one, too.
    pub is_own: bool,
    /// The descriptor that it goes through, where that is another one.
    pub other_handle: Option<u32>,
}

/// The accesses of a launch or dispatch so far.
#[derive(Debug)]
pub(super) struct Races {
    accesses: SharedAccesses,
    order: Order,
    /// The lanes of the batch that runs; none before its first access.
    lanes: Vec<LaneOrder>,
    references: References,
    /// The shader call that runs.
    call: u32,
    /// The last event, and its number.
    event: (Event, u32),
    /// By shader and operation: whether it accesses memory that may be written.
    watched: Vec<Vec<bool>>,
}

impl Races {
    /// Nothing was accessed yet by the shaders of a pipeline, or of a dispatch. `overlapping` has
    /// the bindings whose memory others reach, too.
    pub(super) fn new(plans: &[ProgramPlan], overlapping: &FxHashSet<Binding>) -> Self {
        let programs = || plans.iter().map(|plan| &*plan.program);
        let mut written = Written::by(programs());
        written.bindings.extend(overlapping);
        let watched: Vec<_> = programs().map(|program| written.watched(program)).collect();
        let order = Order::of(programs(), &watched);
        Self {
            accesses: SharedAccesses::default(),
            order,
            lanes: Vec::new(),
            references: References::new(plans),
            call: 0,
            event: (Event::NONE, 0),
            watched,
        }
    }

    /// A shader begins, which that of another call has called or nobody. Returns the number of its
    /// call.
    pub(super) fn begin_call(&mut self, caller: Option<u32>) -> u32 {
        if caller.is_none() && !self.order.sync.topology.is_compute {
            self.order.end_invocations();
        }
        self.order.calls.begin(caller)
    }

    /// The shader of a call hands its batch to the pipeline.
    pub(super) fn stop_call(&mut self, call: u32) {
        self.order.calls.stop(call);
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
        let semantics = self.order.barrier_semantics(&program.module, instruction(program, place));
        let invocations = batch.mask.lanes().map(|lane| batch.invocations.number(lane) as u32);
        self.order.barrier(invocations, semantics);
    }

    /// The running invocations have passed a memory barrier, or another instruction that orders
    /// nothing.
    pub(super) fn fence<const W: usize>(&mut self, batch: &Batch<W>, program: &Program, place: OpPlace) {
        let instruction = instruction(program, place);
        let of_subgroup = match instruction.opcode {
            Opcode::MemoryBarrier => false,
            opcode if opcode.is_control_barrier() => true,
            _ => return,
        };
        let Some(semantics) = self.order.semantics(&program.module, instruction, true) else { return };
        let invocations = batch.mask.lanes().map(|lane| batch.invocations.number(lane) as u32);
        self.order.fence(invocations, semantics, of_subgroup);
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
        self.access_lanes(batch, bindings, place, chunk, values, |_| (AccessForm::new(kind, 0), None))
    }

    fn access_lanes<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        bindings: &Bindings,
        place: OpPlace,
        chunk: &Chunk,
        values: Option<Reg>,
        form: impl Fn(usize) -> (AccessForm, Option<Semantics>),
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
            let (form, semantics) = form(lane);
            let form = match (in_workgroup, handle) {
                (true, _) => form,
                (false, None) => AccessForm { handle: AccessForm::ADDRESS, ..form },
                (false, Some(handle)) => form.through(self.references.number(place.shader, handle), handle),
            };
            let now = self.accessor(lane, class, place, form);
            let (key, at) = match in_workgroup {
                true => (MemoryKey::Workgroup(now.group), offset),
                false => (MemoryKey::Buffer(buffer.memory_id()), buffer.offset() + offset),
            };
            let atomic = semantics.map(|semantics| self.atomic_access((key, at), &now, semantics));
            self.order.before_atomic(now.invocation, atomic.as_ref(), form.kind);
            let access = self.number(&now);
            let value = |from: u32, size: u32| {
                values.map_or(0, |first| stored_bits(batch, lane, first, chunk.width / 8, from, size))
            };
            let mut worst: Option<(&'static Rule, Access, u32, u32)> = None;
            let Self { accesses, order, .. } = self;
            let (keeps_seen, mut seen) = (order.keeps_seen(&now), Vec::new());
            accesses.visit(key, at, bytes, |from, size, cell| {
                let earlier = [cell.store, cell.atomic];
                let found = order.access(cell, &now, access, value(from, size));
                let Some((rule, other)) = found else {
                    if keeps_seen {
                        seen.extend(earlier.into_iter().filter_map(Access::known));
                    }
                    return;
                };
                if worst.is_none_or(|(known, ..)| rank(rule) < rank(known)) {
                    worst = Some((rule, other, from, size));
                }
            });
            seen.into_iter().for_each(|earlier| order.note_seen(earlier, &now));
            order.after_atomic(now.invocation, atomic.as_ref(), form.kind);
            if form.kind == AccessKind::Store {
                order.overwrite((key, at));
            }
            if let Some((rule, other, from, size)) = worst {
                let location = match in_workgroup {
                    true => Location::Workgroup { offset: offset as u32 + from, bytes: size },
                    false => Location::Buffer { handle, offset: offset + u64::from(from), bytes: size },
                };
                races.push(self.race(rule, lane, &now, location, other));
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
        let instruction = instruction(program, place);
        let kind = |lane: usize| match atomic.kind {
            AtomicKind::Load => AccessKind::AtomicLoad,
            _ if instruction.opcode == Opcode::AtomicStore => AccessKind::AtomicStore,
            AtomicKind::CompareExchange => {
                let word = |first: Reg, at: u32| batch.registers[first.plus(at)].0[lane];
                let fails = (0..atomic.words()).any(|at| word(atomic.to, at) != word(atomic.comparator, at));
                if fails { AccessKind::AtomicLoad } else { AccessKind::AtomicUpdate }
            }
            _ => AccessKind::AtomicUpdate,
        };
        let [equal, unequal] =
            [true, false].map(|is_equal| self.order.semantics(&program.module, instruction, is_equal));
        let form = |lane: usize| {
            let kind = kind(lane);
            let semantics = if kind == AccessKind::AtomicLoad { unequal } else { equal };
            (AccessForm::new(kind, atomic.width), semantics)
        };
        let races = match &atomic.target {
            AtomicTarget::Buffer(chunk) => self.access_lanes(batch, bindings, place, chunk, None, form),
            AtomicTarget::Texel(texel) => self.access_texels(batch, bindings, place, texel, form, |_| 0),
            AtomicTarget::Registers { .. } => return Vec::new(),
        };
        self.order.sync.clock += 1;
        races
    }

    /// An atomic instruction's access to a place in memory.
    fn atomic_access(
        &self,
        location: (MemoryKey, u64),
        now: &Accessor,
        semantics: Semantics,
    ) -> AtomicAccess {
        let Accessor { class, form: AccessForm { reference, width, .. }, .. } = *now;
        AtomicAccess { location, class, reference, width, level: semantics.level, semantics }
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
                let form = |_| (AccessForm::new(AccessKind::Load, 0), None);
                self.access_texels(batch, bindings, place, &read.texel, form, |_| 0)
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
                let form = |_| (AccessForm::new(AccessKind::Store, 0), None);
                self.access_texels(batch, bindings, place, &write.texel, form, value)
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
        form: impl Fn(usize) -> (AccessForm, Option<Semantics>),
        value: impl Fn(usize) -> u32,
    ) -> Vec<Race> {
        self.prepare_lanes(batch);
        let mut races = Vec::new();
        for lane in batch.mask.lanes() {
            let reader = LaneReader::new(&batch.registers, lane, bindings);
            let Ok((image, index)) = texel.resolve(reader) else { continue };
            let handle = reader.word(texel.image);
            let (form, semantics) = form(lane);
            let form = form.through(self.references.number(place.shader, handle), handle);
            let now = self.accessor(lane, Class::Image, place, form);
            let location = (MemoryKey::Image(std::ptr::from_ref(image).addr()), 4 * index as u64);
            let atomic = semantics.map(|semantics| self.atomic_access(location, &now, semantics));
            self.order.before_atomic(now.invocation, atomic.as_ref(), form.kind);
            let access = self.number(&now);
            let (mut found, value) = (None, value(lane));
            let Self { accesses, order, .. } = self;
            let (keeps_seen, mut earlier) = (order.keeps_seen(&now), [Access::default(); 2]);
            accesses.visit(location.0, location.1, 4, |_, _, cell| {
                earlier = [cell.store, cell.atomic];
                found = order.access(cell, &now, access, value);
            });
            if keeps_seen && found.is_none() {
                earlier.into_iter().filter_map(Access::known).for_each(|one| order.note_seen(one, &now));
            }
            order.after_atomic(now.invocation, atomic.as_ref(), form.kind);
            if form.kind == AccessKind::Store {
                order.overwrite(location);
            }
            if let Some((rule, other)) = found {
                let location = Location::Texel { handle: reader.word(texel.image) };
                races.push(self.race(rule, lane, &now, location, other));
            }
        }
        races
    }

    /// A batch begins to run, or goes on, of a shader call.
    pub(super) fn resumed(&mut self, call: u32) {
        self.call = call;
        self.lanes.clear();
    }

    fn prepare_lanes<const W: usize>(&mut self, batch: &Batch<W>) {
        if self.lanes.is_empty() {
            let order = &mut self.order;
            self.lanes.extend((0..W).map(|lane| order.lane(batch.invocations.number(lane) as u32)));
        }
    }

    #[inline]
    fn accessor(&self, lane: usize, class: Class, place: OpPlace, form: AccessForm) -> Accessor {
        let LaneOrder { invocation, group, passed } = self.lanes[lane];
        let (epoch, barriers) = (passed.epochs[class as usize], passed.all);
        Accessor { invocation, group, epoch, barriers, call: self.call, class, place, form }
    }

    #[inline]
    fn number(&mut self, now: &Accessor) -> Access {
        let event = self.order.new_event(now);
        if self.event.0 != event {
            self.event = (event, self.order.number(event));
        }
        Access { invocation: now.invocation, event: self.event.1 }
    }

    fn race(
        &self,
        rule: &'static Rule,
        lane: usize,
        now: &Accessor,
        location: Location,
        other: Access,
    ) -> Race {
        let Event { place, form, .. } = *self.order.event(other);
        Race {
            rule,
            lane,
            kind: now.form.kind,
            location,
            other: place,
            other_kind: form.kind,
            other_invocation: other.invocation,
            is_own: other.invocation == now.invocation,
            other_handle: (form.reference != now.form.reference).then_some(form.handle),
        }
    }
}

/// The number that stands for a device address in the place of a descriptor's handle.
pub(super) const ADDRESS: u32 = AccessForm::ADDRESS;

/// Why two accesses break a rule, said of the two.
pub(super) fn why(rule: &Rule) -> &'static str {
    match rule.id {
        "race-caller-callee" => "no release and acquire order the two",
        "race-atomic-width" => "atomic instructions of different widths are not ordered",
        "race-atomic-scope" => "the scope of one of them leaves the other out",
        "race-cross-reference" => "no barrier orders accesses through different descriptors",
        "restrict-broken" => "one of their declarations is Restrict",
        "alias-default" => "their declarations are not both Aliased",
        "order-assumed" => "they are ordered, but what is written is not made available and visible",
        "coherent-missing" => "they are ordered, but not both are coherent",
        _ => "nothing orders the two",
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
    array::from_fn(|axis| id[axis] * workgroup.size[axis] + local[axis])
}

fn instruction(program: &Program, place: OpPlace) -> InstructionWords<'_> {
    let offset = program.origins.get(place.op.index()).map_or(u32::MAX, |origin| origin.offset);
    InstructionWords::at(&program.module, offset)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::machine::Registers;

    #[test]
    fn bits_of_stores_are_taken_from_registers() {
        let mut batch = Batch::<1>::new(Registers::new(4));
        for (register, word) in [(0, 0x0403_0201), (1, 0xFFFF_0605), (2, 0x0807)] {
            batch.registers.set(Reg(register), word);
        }
        assert_eq!(stored_bits(&batch, 0, Reg(0), 4, 0, 4), 0x0403_0201);
        assert_eq!(stored_bits(&batch, 0, Reg(0), 4, 2, 1), 3);
        assert_eq!(stored_bits(&batch, 0, Reg(1), 2, 0, 4), 0x0807_0605);
        assert_eq!(stored_bits(&batch, 0, Reg(1), 2, 0, 2), 0x0605);
    }
}
