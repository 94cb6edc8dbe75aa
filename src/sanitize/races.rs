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

use rspirv::spirv::{MemorySemantics, Op as Opcode, Scope};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::machine::{Batch, Binding, Bindings, OpIndex, Reg, ShaderIndex};
use crate::module::{Id, Module};
use crate::ops::atomic::{AtomicKind, AtomicOp, AtomicTarget};
use crate::ops::image::ImageOp;
use crate::ops::image::reader::LaneReader;
use crate::ops::image::texel_ref::TexelRef;
use crate::ops::memory::{BufferRef, Chunk, MemoryOp, access_location, is_workgroup};
use crate::ops::op::Op;
use crate::program::Program;
use crate::sanitize::cause::OpPlace;
use crate::sanitize::memory_shadow::{Access, Cell, MemoryKey, SharedAccesses};
use crate::sanitize::plan::{InstructionWords, ProgramPlan};
use crate::sanitize::rule::{Rule, race};

/// Kinds of memory that barriers tell apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    Workgroup,
    Buffer,
    Image,
}

/// A set of [`Class`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Classes(u8);

impl Classes {
    const NONE: Self = Self(0);
    const ALL: Self = Self(7);

    /// The classes that memory semantics name, if they order anything; all of them where the
    /// semantics are not known, or name none.
    fn of(semantics: Option<u64>) -> Self {
        let Some(bits) = semantics else { return Self::ALL };
        let semantics = MemorySemantics::from_bits_truncate(bits as u32);
        let orders = MemorySemantics::ACQUIRE
            | MemorySemantics::RELEASE
            | MemorySemantics::ACQUIRE_RELEASE
            | MemorySemantics::SEQUENTIALLY_CONSISTENT;
        if !semantics.intersects(orders) {
            return Self::NONE;
        }
        let named = [
            (MemorySemantics::WORKGROUP_MEMORY, Class::Workgroup),
            (MemorySemantics::UNIFORM_MEMORY, Class::Buffer),
            (MemorySemantics::IMAGE_MEMORY, Class::Image),
        ];
        let named = named.into_iter().filter(|&(bit, _)| semantics.contains(bit));
        match named.fold(Self::NONE, |all, (_, class)| all.with(Self(1 << class as u8))) {
            Self::NONE => Self::ALL,
            classes => classes,
        }
    }

    fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The numbers of its classes.
    fn each(self) -> impl Iterator<Item = usize> {
        (0..3).filter(move |class| self.0 >> class & 1 == 1)
    }
}

/// What an access does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum AccessKind {
    Load,
    Store,
    AtomicLoad,
    AtomicUpdate,
}

impl AccessKind {
    fn writes(self) -> bool {
        matches!(self, Self::Store | Self::AtomicUpdate)
    }

    /// What it does, said of an invocation.
    pub(super) fn says(self) -> &'static str {
        match self {
            Self::Load => "reads",
            Self::Store => "writes",
            Self::AtomicLoad => "reads atomically",
            Self::AtomicUpdate => "changes atomically",
        }
    }
}

/// An operation that accesses memory between two barriers of the invocation's workgroup.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Event {
    place: OpPlace,
    kind: AccessKind,
    /// Barriers of the workgroup before it that order its class of memory.
    epoch: u32,
    /// Atomic instructions of the launch before it that may release or acquire.
    clock: u32,
}

/// An invocation that accesses memory.
#[derive(Clone, Copy, Debug)]
struct Accessor {
    invocation: u32,
    group: u32,
    epoch: u32,
    class: Class,
}

/// The invocation of a lane of the batch that runs, until it waits for the next time.
#[derive(Clone, Copy, Debug)]
struct LaneOrder {
    invocation: u32,
    group: u32,
    /// By class: the barriers that it has passed.
    epochs: [u32; 3],
}

/// What orders accesses.
#[derive(Debug)]
struct Order {
    /// By number; the first stands for none.
    events: Vec<Event>,
    numbers: FxHashMap<Event, u32>,
    /// Invocations of a workgroup; 1 in ray tracing.
    group_size: u32,
    /// The invocations that control barriers of scope Subgroup order.
    ordered_subgroup: OrderedSubgroup,
    /// What the memory barriers of all modules order.
    fences: Classes,
    /// The number of the first invocation of the workgroups that run.
    first: u32,
    /// By invocation from the first one on, and class: the barriers that it has passed.
    epochs: Vec<[u32; 3]>,
    /// Atomic instructions so far that may release or acquire.
    clock: u32,
    /// By class and workgroup: the clock after the last of these that it executed.
    synchronized: [FxHashMap<u32, u32>; 3],
}

/// The invocations among which all accesses count as ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OrderedSubgroup {
    /// None but the invocation itself.
    None,
    /// So many that follow each other in a workgroup.
    Size(u32),
    /// Those of the whole launch.
    Launch,
}

impl Order {
    fn event(&mut self, event: Event) -> u32 {
        let Self { events, numbers, .. } = self;
        *numbers.entry(event).or_insert_with(|| {
            events.push(event);
            events.len() as u32 - 1
        })
    }

    fn group(&self, invocation: u32) -> u32 {
        if self.group_size == 1 { invocation } else { invocation / self.group_size }
    }

    fn lane(&self, invocation: u32) -> LaneOrder {
        let at = invocation.wrapping_sub(self.first) as usize;
        let epochs = self.epochs.get(at).copied().unwrap_or_default();
        LaneOrder { invocation, group: self.group(invocation), epochs }
    }

    /// Whether an earlier access happens before one of an invocation now.
    fn is_before(&self, access: Access, now: &Accessor) -> bool {
        if access.invocation == now.invocation {
            return true;
        }
        let event = &self.events[access.event as usize];
        // No invocation accesses the memory of another workgroup.
        let group = if now.class == Class::Workgroup { now.group } else { self.group(access.invocation) };
        let ordered_subgroup = match self.ordered_subgroup {
            OrderedSubgroup::None => false,
            OrderedSubgroup::Size(size) => {
                let subgroup = |invocation: u32| invocation % self.group_size / size;
                group == now.group && subgroup(access.invocation) == subgroup(now.invocation)
            }
            OrderedSubgroup::Launch => true,
        };
        if ordered_subgroup || (group == now.group && event.epoch < now.epoch) {
            return true;
        }
        let synchronized = &self.synchronized[now.class as usize];
        let since = |group| synchronized.get(&group).is_some_and(|&clock| clock > event.clock);
        !synchronized.is_empty() && since(group) && since(now.group)
    }

    /// The earlier access, if it is not ordered before one of an invocation now.
    #[inline]
    fn unordered(&self, access: Access, now: &Accessor) -> Option<Access> {
        access.known().filter(|&access| !self.is_before(access, now))
    }

    /// Records an access to a cell. Returns the earlier one that it races with.
    fn access(
        &self,
        cell: &mut Cell,
        now: &Accessor,
        kind: AccessKind,
        access: Access,
        value: u32,
    ) -> Option<(&'static Rule, Access)> {
        let is_image = now.class == Class::Image;
        let plain = if is_image { &race::RACE_IMAGE } else { &race::RACE_BUFFER };
        let of = |rule: &'static Rule| move |other| (rule, other);
        let mixed = of(&race::RACE_MIXED_ATOMIC);
        match kind {
            AccessKind::Load => {
                if cell.loads[0] == access {
                    return None;
                }
                let updated = || {
                    let other = self.unordered(cell.atomic, now)?;
                    self.events[other.event as usize].kind.writes().then_some(other)
                };
                let found = self.unordered(cell.store, now).map(of(plain)).or_else(|| updated().map(mixed));
                let [last, other] = cell.loads;
                // The other load is rather one of another workgroup, which no barrier orders.
                let replaces = || {
                    other.event == 0
                        || self.group(last.invocation) != now.group
                        || self.group(other.invocation) == now.group
                };
                if last.event != 0 && last.invocation != access.invocation && replaces() {
                    cell.loads[1] = last;
                }
                cell.loads[0] = access;
                found
            }
            AccessKind::Store => {
                let stored = self.unordered(cell.store, now);
                let same = stored.filter(|_| cell.value == value);
                let differs = stored.filter(|_| cell.value != value);
                let loaded = || cell.loads.iter().find_map(|&load| self.unordered(load, now));
                let found = differs
                    .or_else(loaded)
                    .map(of(plain))
                    .or_else(|| self.unordered(cell.atomic, now).map(mixed))
                    .or_else(|| same.map(of(&race::RACE_SAME_VALUE)));
                // Loads stay, so that `x = x + 1` in all lanes is no store of the same value.
                (cell.store, cell.value) = (access, value);
                found
            }
            AccessKind::AtomicLoad | AccessKind::AtomicUpdate => {
                let loaded = || cell.loads.iter().find_map(|&load| self.unordered(load, now));
                let stored = self.unordered(cell.store, now);
                let found = stored.or_else(|| kind.writes().then(loaded).flatten()).map(mixed);
                let updated = |cell: &Cell| self.events[cell.atomic.event as usize].kind.writes();
                if kind.writes() || cell.atomic.event == 0 || !updated(cell) {
                    cell.atomic = access;
                }
                found
            }
        }
    }
}

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
        let layout = programs().find_map(|program| program.workgroup);
        let barriers = programs().map(|program| ModuleBarriers::of(&program.module));
        let all = barriers.fold(ModuleBarriers::default(), |all, one| ModuleBarriers {
            fences: all.fences.with(one.fences),
            subgroup: all.subgroup || one.subgroup,
        });
        let place = OpPlace { shader: ShaderIndex(u32::MAX), op: OpIndex(u32::MAX) };
        let none = Event { place, kind: AccessKind::Load, epoch: 0, clock: 0 };
        let order = Order {
            events: vec![none],
            numbers: FxHashMap::default(),
            group_size: layout.map_or(1, |layout| layout.size.iter().product()),
            ordered_subgroup: match (all.subgroup, layout) {
                (false, _) => OrderedSubgroup::None,
                (true, Some(_)) => OrderedSubgroup::Size(1),
                (true, None) => OrderedSubgroup::Launch,
            },
            fences: all.fences,
            first: 0,
            epochs: Vec::new(),
            clock: 0,
            synchronized: Default::default(),
        };
        Self { accesses: SharedAccesses::default(), order, lanes: Vec::new(), event: (none, 0), watched }
    }

    /// Other workgroups run, from one on.
    pub(super) fn begin_workgroups(&mut self, first: u32, subgroup_size: u32) {
        self.accesses.forget_workgroups();
        self.order.first = first.wrapping_mul(self.order.group_size);
        self.order.epochs.clear();
        if let OrderedSubgroup::Size(size) = &mut self.order.ordered_subgroup {
            *size = subgroup_size.max(1);
        }
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
        let classes = own.with(self.order.fences);
        for lane in batch.mask.lanes() {
            let at = (batch.invocations.number(lane) as u32).wrapping_sub(self.order.first) as usize;
            if at >= self.order.epochs.len() {
                self.order.epochs.resize(at + 1, [0; 3]);
            }
            classes.each().for_each(|class| self.order.epochs[at][class] += 1);
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
        let classes = atomic_classes(program, place).with(self.order.fences);
        if classes != Classes::NONE {
            self.order.clock += 1;
            for lane in batch.mask.lanes() {
                let group = self.order.group(batch.invocations.number(lane) as u32);
                for class in classes.each() {
                    self.order.synchronized[class].insert(group, self.order.clock);
                }
            }
        }
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
        let event = Event { place, kind, epoch: now.epoch, clock: self.order.clock };
        if self.event.0 != event {
            self.event = (event, self.order.event(event));
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
        let event = &self.order.events[other.event as usize];
        let (place, other_kind) = (event.place, event.kind);
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

/// What the barriers of a module order, wherever they stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct ModuleBarriers {
    /// The storage classes of all memory barriers.
    fences: Classes,
    /// Whether a control barrier may be of scope Subgroup.
    subgroup: bool,
}

impl ModuleBarriers {
    fn of(module: &Module) -> Self {
        /// Words of a module before its first instruction.
        const HEADER: usize = 5;
        let mut all = Self::default();
        let mut rest = module.words.get(HEADER..).unwrap_or_default();
        while let Some(&head) = rest.first() {
            let (count, opcode) = ((head >> 16) as usize, Opcode::from_u32(head & 0xFFFF));
            let Some((words, next)) = rest.split_at_checked(count.max(1)) else { break };
            rest = next;
            match (opcode, words) {
                (Some(Opcode::MemoryBarrier), &[_, _, semantics]) => {
                    all.fences = all.fences.with(Classes::of(module.scalar_value(Id(semantics))));
                }
                (Some(Opcode::ControlBarrier), &[_, scope, ..]) => {
                    let scope = module.scalar_value(Id(scope));
                    all.subgroup |= scope.is_none_or(|scope| scope == Scope::Subgroup as u64);
                }
                _ => {}
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{Mask, Registers};

    /// An order of workgroups of four invocations.
    fn order() -> Order {
        let mut races = Races::new(&[]);
        races.order.group_size = 4;
        races.order
    }

    /// An access of an invocation that has passed some barriers, by the operation `op`.
    fn access(
        order: &mut Order,
        cell: &mut Cell,
        (invocation, epoch): (u32, u32),
        op: u32,
        kind: AccessKind,
        value: u32,
    ) -> Option<(&'static str, u32)> {
        let class = Class::Buffer;
        let now = Accessor { invocation, group: order.group(invocation), epoch, class };
        let place = OpPlace { shader: ShaderIndex(0), op: OpIndex(op) };
        let event = order.event(Event { place, kind, epoch, clock: order.clock });
        let race = order.access(cell, &now, kind, Access { invocation, event }, value);
        race.map(|(rule, other)| (rule.id, other.invocation))
    }

    use AccessKind::{AtomicLoad, AtomicUpdate, Load, Store};

    #[test]
    fn a_barrier_orders_a_workgroup_and_no_other() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        assert_eq!(access(order, cell, (0, 0), 1, Store, 7), None);
        assert_eq!(access(order, cell, (0, 0), 2, Load, 0), None);
        assert_eq!(access(order, cell, (1, 1), 3, Load, 0), None);
        assert_eq!(access(order, cell, (5, 1), 3, Load, 0), Some(("race-buffer", 0)));
        // Of two loads that the store races with, the one of the other workgroup.
        assert_eq!(access(order, cell, (2, 2), 4, Store, 8), Some(("race-buffer", 5)));
        assert_eq!(access(order, cell, (3, 2), 5, Load, 0), Some(("race-buffer", 2)));
        assert_eq!(access(order, cell, (1, 3), 5, Load, 0), None);
    }

    #[test]
    fn loads_of_many_invocations_race_with_a_store_of_one_of_them() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        for invocation in 0..4 {
            assert_eq!(access(order, cell, (invocation, 0), 1, Load, 0), None);
        }
        assert_eq!(access(order, cell, (3, 0), 2, Store, 1), Some(("race-buffer", 2)));
    }

    #[test]
    fn stores_of_one_value_are_told_apart() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        assert_eq!(access(order, cell, (0, 0), 1, Store, 7), None);
        assert_eq!(access(order, cell, (1, 0), 1, Store, 7), Some(("race-same-value", 0)));
        assert_eq!(access(order, cell, (2, 0), 1, Store, 8), Some(("race-buffer", 1)));
    }

    #[test]
    fn atomic_accesses_race_with_others_alone() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        assert_eq!(access(order, cell, (0, 0), 1, Store, 0), None);
        assert_eq!(access(order, cell, (1, 1), 2, AtomicUpdate, 0), None);
        assert_eq!(access(order, cell, (6, 1), 2, AtomicUpdate, 0), Some(("race-mixed-atomic", 0)));
        assert_eq!(access(order, cell, (2, 1), 3, AtomicLoad, 0), None);
        assert_eq!(access(order, cell, (3, 1), 4, Load, 0), Some(("race-mixed-atomic", 6)));
        // A load does not race with one that is atomic.
        let cell = &mut Cell::default();
        assert_eq!(access(order, cell, (0, 0), 5, Load, 0), None);
        assert_eq!(access(order, cell, (1, 0), 6, AtomicLoad, 0), None);
        assert_eq!(access(order, cell, (2, 0), 5, Load, 0), None);
        assert_eq!(access(order, cell, (2, 0), 7, Store, 0), Some(("race-buffer", 0)));
    }

    #[test]
    fn atomic_instructions_that_both_workgroups_executed_may_order_them() {
        let (order, cell) = (&mut order(), &mut Cell::default());
        assert_eq!(access(order, cell, (0, 0), 1, Store, 0), None);
        order.clock = 1;
        order.synchronized[Class::Buffer as usize].insert(0, 1);
        assert_eq!(access(order, cell, (4, 0), 2, Load, 0), Some(("race-buffer", 0)));
        order.synchronized[Class::Buffer as usize].insert(1, 1);
        assert_eq!(access(order, cell, (5, 0), 2, Load, 0), None);
    }

    #[test]
    fn semantics_name_the_memory_that_a_barrier_orders() {
        let classes = |semantics| Classes::of(Some(semantics)).each().collect::<Vec<_>>();
        assert_eq!(classes(0x108), [Class::Workgroup as usize]);
        assert_eq!(classes(0x948), [0, 1, 2]);
        assert_eq!(classes(0x8), [0, 1, 2]);
        assert_eq!(classes(0x100), [0; 0]);
        assert_eq!(Classes::of(None), Classes::ALL);
    }

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
