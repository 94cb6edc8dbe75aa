//! What orders accesses to memory.

use rspirv::spirv::Scope;
use rustc_hash::FxHashMap;

use crate::machine::{OpIndex, ShaderIndex};
use crate::module::interface::Stage;
use crate::program::Program;
use crate::sanitize::cause::OpPlace;
use crate::sanitize::memory_shadow::Access;
use crate::sanitize::races::calls::{Calls, Kinship};
use crate::sanitize::races::class::{Class, Classes};
use crate::sanitize::races::fences::{Fences, Times};
use crate::sanitize::races::ordering::Ordering;
use crate::sanitize::races::traits::{AccessTraits, Barriers, ProgramTraits};

/// What an access does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::sanitize) enum AccessKind {
    Load,
    Store,
    AtomicLoad,
    AtomicUpdate,
}

impl AccessKind {
    pub(super) fn writes(self) -> bool {
        matches!(self, Self::Store | Self::AtomicUpdate)
    }

    pub(super) fn is_atomic(self) -> bool {
        matches!(self, Self::AtomicLoad | Self::AtomicUpdate)
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

/// What an operation does to memory, through which descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct AccessForm {
    pub kind: AccessKind,
    /// The reference (Vulkan, Memory Model, "Reference"): the number of a descriptor; 0 for the
    /// workgroup's memory and for device addresses.
    pub reference: u32,
    /// The handle of the descriptor in the shader; [`AccessForm::ADDRESS`] for a device address.
    pub handle: u32,
    /// Bits of what an atomic instruction changes; 0 of another.
    pub width: u32,
}

impl AccessForm {
    /// Stands for a device address.
    pub(super) const ADDRESS: u32 = u32::MAX;

    /// An access of some bits, if it is atomic, through no descriptor.
    pub(super) fn new(kind: AccessKind, width: u32) -> Self {
        Self { kind, reference: 0, handle: 0, width }
    }

    /// The access through a descriptor.
    pub(super) fn through(self, reference: u32, handle: u32) -> Self {
        Self { reference, handle, ..self }
    }
}

/// An operation that accesses memory between two barriers of the invocation's workgroup.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Event {
    pub place: OpPlace,
    pub form: AccessForm,
    /// The shader call.
    pub call: u32,
    /// Barriers of the workgroup before it that order its class of memory.
    epoch: u32,
    /// Atomic instructions and fences of the launch before it.
    clock: u32,
}

impl Event {
    /// Stands for none.
    pub(super) const NONE: Self = Self {
        place: OpPlace { shader: ShaderIndex(u32::MAX), op: OpIndex(u32::MAX) },
        form: AccessForm { kind: AccessKind::Load, reference: 0, handle: 0, width: 0 },
        call: 0,
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
    pub call: u32,
    pub class: Class,
    pub place: OpPlace,
    pub form: AccessForm,
}

/// The invocation of a lane of the batch that runs, until it waits for the next time.
#[derive(Clone, Copy, Debug)]
pub(super) struct LaneOrder {
    pub invocation: u32,
    pub group: u32,
    /// By class: the barriers that it has passed.
    pub epochs: [u32; 3],
}

/// What orders an access before a later one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ordered {
    /// Both are of one invocation of a shader.
    ByProgram,
    /// Barriers or atomic instructions, or these may.
    BySynchronization,
    /// Nothing: they are of shaders of one ray-tracing call.
    NotInCall,
    /// Nothing orders them.
    Not,
}

/// What orders accesses.
#[derive(Debug)]
pub(super) struct Order {
    /// By number; the first stands for none.
    events: Vec<Event>,
    numbers: FxHashMap<Event, u32>,
    /// By shader.
    traits: Vec<ProgramTraits>,
    /// The shader calls so far.
    pub calls: Calls,
    /// Whether there are workgroups.
    is_compute: bool,
    /// Invocations of a workgroup; 1 in ray tracing.
    group_size: u32,
    /// Invocations of a subgroup of a workgroup.
    subgroup_size: u32,
    /// The invocations that control barriers of scope Subgroup order.
    ordered_subgroup: OrderedSubgroup,
    /// What the memory barriers of all modules order.
    fences: Ordering,
    /// The number of the first invocation of the workgroups that run.
    first: u32,
    /// By invocation from the first one on, and class: the barriers that it has passed.
    epochs: Vec<[u32; 3]>,
    /// Atomic instructions and fences so far that may release or acquire.
    clock: u32,
    /// The fences and atomic instructions of each invocation.
    passed: Fences,
    /// By workgroup: until when what was accessed is released through an atomic instruction, and
    /// what was released when is acquired.
    released: FxHashMap<u32, Times>,
    acquired: FxHashMap<u32, Times>,
}

/// The invocations among which all accesses count as ordered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OrderedSubgroup {
    /// Those of one invocation alone.
    None,
    /// Those of a subgroup of a workgroup.
    Subgroup,
    /// Those of the whole launch.
    Launch,
}

impl Order {
    /// Before the shaders of a pipeline, or of a dispatch, have accessed anything. `watched` says
    /// by shader and operation which accesses are looked at.
    pub(super) fn of<'p>(programs: impl Iterator<Item = &'p Program> + Clone, watched: &[Vec<bool>]) -> Self {
        let layout = programs.clone().find_map(|program| program.workgroup);
        let is_called = |program: &Program| !matches!(program.stage, Stage::RayGeneration | Stage::Compute);
        let shares_in_calls = programs
            .clone()
            .zip(watched)
            .any(|(program, watched)| is_called(program) && watched.contains(&true));
        let traits: Vec<_> =
            programs.zip(watched).map(|(program, watched)| ProgramTraits::of(program, watched)).collect();
        let all = traits.iter().fold(Barriers::default(), |all, one| all.with(one.barriers));
        // Where ray generation shaders alone access memory, no calls are told apart.
        let calls = if shares_in_calls { Calls::followed() } else { Calls::default() };
        Self {
            events: vec![Event::NONE],
            numbers: FxHashMap::default(),
            calls,
            is_compute: layout.is_some(),
            group_size: layout.map_or(1, |layout| layout.size.iter().product()),
            subgroup_size: 1,
            ordered_subgroup: match (all.subgroup, layout) {
                (false, _) => OrderedSubgroup::None,
                (true, Some(_)) => OrderedSubgroup::Subgroup,
                (true, None) => OrderedSubgroup::Launch,
            },
            fences: all.fences,
            traits,
            first: 0,
            epochs: Vec::new(),
            clock: 0,
            passed: Fences::default(),
            released: FxHashMap::default(),
            acquired: FxHashMap::default(),
        }
    }

    /// Other workgroups run, from one on.
    pub(super) fn begin_workgroups(&mut self, first: u32, subgroup_size: u32) {
        self.first = first.wrapping_mul(self.group_size);
        self.epochs.clear();
        self.subgroup_size = subgroup_size.max(1);
    }

    /// An invocation waits at a control barrier that orders some classes of memory by itself.
    pub(super) fn barrier(&mut self, invocation: u32, classes: Classes) {
        let at = invocation.wrapping_sub(self.first) as usize;
        if at >= self.epochs.len() {
            self.epochs.resize(at + 1, [0; 3]);
        }
        let fences = self.fences.releases.with(self.fences.acquires).across(false);
        classes.with(fences).each().for_each(|class| self.epochs[at][class] += 1);
    }

    /// Invocations have executed an atomic instruction that releases and acquires by itself what
    /// `own` says.
    pub(super) fn synchronize(
        &mut self,
        invocations: impl Iterator<Item = u32>,
        own: Ordering,
        scope: Option<Scope>,
    ) {
        self.clock += 1;
        let Ordering { releases, acquires } = own.within(scope);
        let [mut released, mut acquired] = [Times::default(); 2];
        released.set(releases, self.clock);
        acquired.set(acquires, self.clock);
        for invocation in invocations {
            let group = self.group(invocation);
            let fenced = self.passed.atomic(invocation, scope, self.clock);
            let of_group = self.released.entry(group).or_default();
            *of_group = of_group.later(released).later(fenced);
            let of_group = self.acquired.entry(group).or_default();
            *of_group = of_group.later(acquired);
        }
    }

    /// Invocations have executed a barrier, which orders through the atomic instructions before and
    /// behind it.
    pub(super) fn fence(&mut self, invocations: impl Iterator<Item = u32>, fence: Ordering) {
        if fence == Ordering::default() {
            return;
        }
        self.clock += 1;
        for invocation in invocations {
            let group = self.group(invocation);
            let acquired = self.passed.fence(invocation, fence, self.clock);
            let of_group = self.acquired.entry(group).or_default();
            *of_group = of_group.later(acquired);
        }
    }

    /// The event of an access that an invocation makes now.
    #[inline]
    pub(super) fn new_event(&self, now: &Accessor) -> Event {
        let &Accessor { place, form, call, epoch, .. } = now;
        Event { place, form, call, epoch, clock: self.clock }
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

    /// What an operation says of its access.
    #[inline]
    pub(super) fn traits(&self, place: OpPlace) -> &AccessTraits {
        self.traits[place.shader.index()].at(place.op.index())
    }

    /// What the barriers of a shader order.
    pub(super) fn barriers(&self, place: OpPlace) -> &Barriers {
        &self.traits[place.shader.index()].barriers
    }

    /// The workgroup of an invocation; in ray tracing itself.
    #[inline]
    pub(super) fn group(&self, invocation: u32) -> u32 {
        if self.group_size == 1 { invocation } else { invocation / self.group_size }
    }

    /// An invocation, and the barriers that it has passed.
    pub(super) fn lane(&self, invocation: u32) -> LaneOrder {
        let at = invocation.wrapping_sub(self.first) as usize;
        let epochs = self.epochs.get(at).copied().unwrap_or_default();
        LaneOrder { invocation, group: self.group(invocation), epochs }
    }

    /// Whether an invocation is in the instance of a scope that another one names.
    pub(super) fn is_in_scope(&self, scope: Option<Scope>, one: u32, other: u32) -> bool {
        match scope {
            _ if one == other => true,
            Some(Scope::Invocation | Scope::ShaderCallKHR) => false,
            Some(Scope::Workgroup) => !self.is_compute || self.group(one) == self.group(other),
            Some(Scope::Subgroup) => !self.is_compute || self.is_same_subgroup(one, other),
            _ => true,
        }
    }

    fn is_same_subgroup(&self, one: u32, other: u32) -> bool {
        let subgroup = |invocation: u32| invocation % self.group_size / self.subgroup_size;
        self.group(one) == self.group(other) && subgroup(one) == subgroup(other)
    }

    /// What orders an earlier access before one of an invocation now.
    #[inline]
    pub(super) fn between(&self, access: Access, now: &Accessor) -> Ordered {
        let event = self.event(access);
        if access.invocation == now.invocation {
            return if event.call == now.call { Ordered::ByProgram } else { self.in_call(event, now) };
        }
        // No invocation accesses the memory of another workgroup.
        let group = if now.class == Class::Workgroup { now.group } else { self.group(access.invocation) };
        let in_ordered_subgroup = match self.ordered_subgroup {
            OrderedSubgroup::None => false,
            OrderedSubgroup::Subgroup => self.is_same_subgroup(access.invocation, now.invocation),
            OrderedSubgroup::Launch => true,
        };
        if in_ordered_subgroup || (group == now.group && event.epoch < now.epoch) {
            return Ordered::BySynchronization;
        }
        let is_wide = group != now.group;
        let last = |times: &FxHashMap<u32, Times>, group: u32| {
            times.get(&group).map_or(0, |times| times.of(now.class as usize, is_wide))
        };
        let may_be_ordered =
            last(&self.released, group) > event.clock && last(&self.acquired, now.group) > event.clock;
        if may_be_ordered { Ordered::BySynchronization } else { Ordered::Not }
    }

    /// What orders accesses of two shaders of one ray-tracing call: a release of the earlier
    /// shader, and an acquire of the later one, unless one trace has called both.
    fn in_call(&self, event: &Event, now: &Accessor) -> Ordered {
        let is_ordered = self.ordered_subgroup == OrderedSubgroup::Launch
            || self.calls.kinship(event.call, now.call) == Kinship::InOrder
                && self.barriers(event.place).all.releases.across(true).contains(now.class)
                && self.barriers(now.place).all.acquires.across(true).contains(now.class);
        if is_ordered { Ordered::BySynchronization } else { Ordered::NotInCall }
    }
    /// The order of workgroups of some invocations, of whose accesses all are coherent.
    #[cfg(test)]
    pub(super) fn of_groups(group_size: u32) -> Self {
        let traits = vec![ProgramTraits::coherent(8)];
        Self { is_compute: true, group_size, traits, ..Self::of([].into_iter(), &[]) }
    }
}
