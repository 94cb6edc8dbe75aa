//! What orders accesses to memory, and which pairs nothing orders.

use rspirv::spirv::{MemorySemantics, Op as Opcode, Scope};
use rustc_hash::FxHashMap;

use crate::machine::{OpIndex, ShaderIndex};
use crate::module::{Id, Module};
use crate::program::Program;
use crate::sanitize::cause::OpPlace;
use crate::sanitize::memory_shadow::{Access, Cell};
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
pub(super) struct Classes(u8);

impl Classes {
    const NONE: Self = Self(0);
    pub(super) const ALL: Self = Self(7);

    /// The classes that memory semantics name, if they order anything; all of them where the
    /// semantics are not known, or name none.
    pub(super) fn of(semantics: Option<u64>) -> Self {
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

    pub(super) fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The numbers of its classes.
    fn each(self) -> impl Iterator<Item = usize> {
        (0..3).filter(move |class| self.0 >> class & 1 == 1)
    }
}

/// What an access does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::sanitize) enum AccessKind {
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
    pub(in crate::sanitize) fn says(self) -> &'static str {
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
pub(super) struct Event {
    pub place: OpPlace,
    pub kind: AccessKind,
    /// Barriers of the workgroup before it that order its class of memory.
    epoch: u32,
    /// Atomic instructions of the launch before it that may release or acquire.
    clock: u32,
}

impl Event {
    /// Stands for none.
    pub(super) const NONE: Self = Self {
        place: OpPlace { shader: ShaderIndex(u32::MAX), op: OpIndex(u32::MAX) },
        kind: AccessKind::Load,
        epoch: 0,
        clock: 0,
    };
}

/// An invocation that accesses memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accessor {
    pub invocation: u32,
    pub group: u32,
    pub epoch: u32,
    pub class: Class,
}

/// The invocation of a lane of the batch that runs, until it waits for the next time.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneOrder {
    pub invocation: u32,
    pub group: u32,
    /// By class: the barriers that it has passed.
    pub epochs: [u32; 3],
}

/// What orders accesses.
#[derive(Debug)]
pub(super) struct Order {
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
    /// Those of one invocation alone.
    None,
    /// So many that follow each other in a workgroup.
    Size(u32),
    /// Those of the whole launch.
    Launch,
}

impl Order {
    /// Before the shaders of a pipeline, or of a dispatch, have accessed anything.
    pub(super) fn of<'p>(programs: impl Iterator<Item = &'p Program> + Clone) -> Self {
        let layout = programs.clone().find_map(|program| program.workgroup);
        let barriers = programs.map(|program| ModuleBarriers::of(&program.module));
        let all = barriers.fold(ModuleBarriers::default(), |all, one| ModuleBarriers {
            fences: all.fences.with(one.fences),
            subgroup: all.subgroup || one.subgroup,
        });
        Self {
            events: vec![Event::NONE],
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
        }
    }

    /// Other workgroups run, from one on.
    pub(super) fn begin_workgroups(&mut self, first: u32, subgroup_size: u32) {
        self.first = first.wrapping_mul(self.group_size);
        self.epochs.clear();
        if let OrderedSubgroup::Size(size) = &mut self.ordered_subgroup {
            *size = subgroup_size.max(1);
        }
    }

    /// An invocation waits at a control barrier that orders some classes of memory by itself.
    pub(super) fn barrier(&mut self, invocation: u32, classes: Classes) {
        let at = invocation.wrapping_sub(self.first) as usize;
        if at >= self.epochs.len() {
            self.epochs.resize(at + 1, [0; 3]);
        }
        classes.with(self.fences).each().for_each(|class| self.epochs[at][class] += 1);
    }

    /// Invocations have executed an atomic instruction that releases or acquires some classes of
    /// memory by itself.
    pub(super) fn synchronize(&mut self, invocations: impl Iterator<Item = u32>, classes: Classes) {
        let classes = classes.with(self.fences);
        if classes == Classes::NONE {
            return;
        }
        self.clock += 1;
        for invocation in invocations {
            let group = self.group(invocation);
            for class in classes.each() {
                self.synchronized[class].insert(group, self.clock);
            }
        }
    }

    /// An operation that accesses memory now, after some barriers of the workgroup.
    #[inline]
    pub(super) fn new_event(&self, place: OpPlace, kind: AccessKind, epoch: u32) -> Event {
        Event { place, kind, epoch, clock: self.clock }
    }

    /// The event of an access.
    #[inline]
    pub(super) fn event(&self, access: Access) -> &Event {
        &self.events[access.event as usize]
    }

    /// The number of an event.
    pub(super) fn number(&mut self, event: Event) -> u32 {
        let Self { events, numbers, .. } = self;
        *numbers.entry(event).or_insert_with(|| {
            events.push(event);
            events.len() as u32 - 1
        })
    }

    fn group(&self, invocation: u32) -> u32 {
        if self.group_size == 1 { invocation } else { invocation / self.group_size }
    }

    /// An invocation, and the barriers that it has passed.
    pub(super) fn lane(&self, invocation: u32) -> LaneOrder {
        let at = invocation.wrapping_sub(self.first) as usize;
        let epochs = self.epochs.get(at).copied().unwrap_or_default();
        LaneOrder { invocation, group: self.group(invocation), epochs }
    }

    /// Whether an earlier access happens before one of an invocation now.
    fn is_before(&self, access: Access, now: &Accessor) -> bool {
        if access.invocation == now.invocation {
            return true;
        }
        let event = self.event(access);
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
    pub(super) fn access(
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
                    self.event(other).kind.writes().then_some(other)
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
                let updated = |cell: &Cell| self.event(cell.atomic).kind.writes();
                if kind.writes() || cell.atomic.event == 0 || !updated(cell) {
                    cell.atomic = access;
                }
                found
            }
        }
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
        let mut all = Self::default();
        let blocks = module.functions.iter().flat_map(|function| &function.blocks);
        for instruction in blocks.flat_map(|block| &block.instructions) {
            match (Opcode::from_u32(instruction.opcode.into()), module.operands(instruction)) {
                (Some(Opcode::MemoryBarrier), &[_, semantics]) => {
                    all.fences = all.fences.with(Classes::of(module.scalar_value(Id(semantics))));
                }
                (Some(Opcode::ControlBarrier), &[scope, ..]) => {
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

    /// An order of workgroups of four invocations.
    fn order() -> Order {
        Order { group_size: 4, ..Order::of([].into_iter()) }
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
        let event = order.number(order.new_event(place, kind, epoch));
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
}
