//! What orders accesses to memory.

use rspirv::spirv::Scope;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::cause::OpPlace;
use crate::memory_shadow::Access;
use crate::plan::InstructionWords;
use crate::races::calls::{Calls, Kinship};
use crate::races::class::{Class, Classes};
use crate::races::knowledge::Write;
use crate::races::level::{Level, Topology};
use crate::races::ordering::{Ordering, Semantics};
use crate::races::synchronization::{AtomicAccess, Location, Synchronization};
use crate::races::traits::{AccessTraits, Barriers, ProgramTraits};
use anyhit_engine::machine::{OpIndex, ShaderIndex};
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::program::Program;

/// What an access does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum AccessKind {
    Load,
    Store,
    AtomicLoad,
    AtomicStore,
    /// A read-modify-write.
    AtomicUpdate,
}

impl AccessKind {
    pub(super) fn writes(self) -> bool {
        matches!(self, Self::Store | Self::AtomicStore | Self::AtomicUpdate)
    }

    pub(super) fn reads(self) -> bool {
        matches!(self, Self::Load | Self::AtomicLoad | Self::AtomicUpdate)
    }

    pub(super) fn is_atomic(self) -> bool {
        matches!(self, Self::AtomicLoad | Self::AtomicStore | Self::AtomicUpdate)
    }

    /// What it does, said of an invocation.
    pub(crate) fn says(self) -> &'static str {
        match self {
            Self::Load => "reads",
            Self::Store => "writes",
            Self::AtomicLoad => "reads atomically",
            Self::AtomicStore => "writes atomically",
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
    /// Atomic instructions, fences and barriers of the launch before it.
    pub clock: u32,
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
    /// Control barriers of the workgroup that it has passed.
    pub barriers: usize,
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
    pub passed: PassedBarriers,
}

/// The control barriers of its workgroup that an invocation has passed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PassedBarriers {
    /// By class: those that order it.
    pub epochs: [u32; 3],
    /// All of them.
    pub all: usize,
    /// The semantics of the last one, until the invocation goes on: what it releases to others by
    /// the atomic instructions behind it, and makes visible.
    last: Option<Semantics>,
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
    /// Which fence and atomic instruction synchronizes with which.
    pub sync: Synchronization,
    /// Whether anything orders accesses but the control barriers of workgroups.
    synchronizes: bool,
    /// The invocations that control barriers of scope Subgroup order.
    ordered_subgroup: OrderedSubgroup,
    /// What the memory barriers of all modules order.
    fences: Ordering,
    /// The number of the first invocation of the workgroups that run.
    first: u32,
    /// By invocation from the first one on.
    passed: Vec<PassedBarriers>,
    /// Accesses that loads have seen, with the invocation that has made them visible to itself.
    seen: FxHashSet<(Access, u32)>,
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
        let is_exact = !traits.is_empty() && traits.iter().all(|traits| traits.has_model);
        let topology = Topology {
            is_compute: layout.is_some(),
            group_size: layout.map_or(1, |layout| layout.size.iter().product()),
            subgroup_size: 1,
        };
        Self {
            events: vec![Event::NONE],
            numbers: FxHashMap::default(),
            calls,
            sync: Synchronization::new(topology, is_exact),
            synchronizes: all.all != Ordering::default() && (is_exact || all.atomics),
            ordered_subgroup: match (all.subgroup, layout) {
                (false, _) => OrderedSubgroup::None,
                (true, Some(_)) if is_exact => OrderedSubgroup::None,
                (true, Some(_)) => OrderedSubgroup::Subgroup,
                (true, None) => OrderedSubgroup::Launch,
            },
            fences: all.fences,
            traits,
            first: 0,
            passed: Vec::new(),
            seen: FxHashSet::default(),
        }
    }

    /// Other workgroups run, from one on.
    pub(super) fn begin_workgroups(&mut self, first: u32, subgroup_size: u32) {
        self.first = first.wrapping_mul(self.sync.topology.group_size);
        self.passed.clear();
        self.seen.clear();
        self.sync.topology.subgroup_size = subgroup_size.max(1);
        self.sync.end_invocations();
    }

    /// The invocations of a launch that ran before have ended.
    pub(super) fn end_invocations(&mut self) {
        self.seen.clear();
        self.sync.end_invocations();
    }

    /// What an instruction orders beyond its invocation; nothing where none does.
    pub(super) fn semantics(
        &self,
        module: &Module,
        instruction: InstructionWords<'_>,
        is_equal: bool,
    ) -> Option<Semantics> {
        let semantics = Semantics::of_instruction(module, instruction, self.sync.topology, is_equal);
        semantics.filter(|_| self.synchronizes)
    }

    /// What a control barrier of a workgroup orders.
    pub(super) fn barrier_semantics(&self, module: &Module, instruction: InstructionWords<'_>) -> Semantics {
        let semantics = Semantics::of_instruction(module, instruction, self.sync.topology, true);
        // Barriers that are no such instruction order all.
        semantics.unwrap_or(Semantics::of(None, Level::Wide))
    }

    /// Invocations wait at a control barrier of their workgroup.
    pub(super) fn barrier(&mut self, invocations: impl Iterator<Item = u32>, semantics: Semantics) {
        let mut semantics = semantics;
        if !self.sync.is_exact {
            // GLSL's `memoryBarrierBuffer(); barrier();`: what the fences of the module name, and
            // their scope, count as named by its control barriers, wherever the fences stand.
            let fences = self.fences.releases.with(self.fences.acquires);
            semantics.classes = semantics.classes.with(fences.across(false));
            if fences.across(true) != Classes::NONE {
                semantics.level = Level::Wide;
            }
        }
        let orders_all = !self.sync.is_exact || semantics.joins_all();
        let classes = if orders_all { semantics.classes } else { Classes::NONE };
        for invocation in invocations {
            let at = invocation.wrapping_sub(self.first) as usize;
            if at >= self.passed.len() {
                self.passed.resize(at + 1, PassedBarriers::default());
            }
            self.sync.arrive(invocation, self.passed[at].all, semantics);
            let passed = &mut self.passed[at];
            passed.all += 1;
            classes.each().for_each(|class| passed.epochs[class] += 1);
            if !self.synchronizes {
                continue;
            }
            // It is a memory barrier, too. What it releases is known once all have come to it.
            let is_shared_alone = !self.sync.is_exact && semantics.classes.is_alone(Class::Workgroup);
            passed.last = Some(semantics).filter(|_| !is_shared_alone);
            if semantics.acquires {
                let acquires = Semantics { releases: false, visible: false, ..semantics };
                self.sync.fence(invocation, passed.all, acquires);
            }
        }
        self.sync.clock += 1;
    }

    /// An invocation goes on behind the control barriers that it has passed.
    fn go_on(&mut self, invocation: u32) -> PassedBarriers {
        let at = invocation.wrapping_sub(self.first) as usize;
        let Some(passed) = self.passed.get_mut(at) else { return PassedBarriers::default() };
        let last = passed.last.take();
        let passed = *passed;
        if self.sync.is_exact && passed.all > 0 {
            self.sync.settle(invocation, passed.all);
        }
        if let Some(semantics) = last {
            self.sync.make_visible_to_all(invocation, passed.all, &semantics);
            if semantics.releases {
                self.sync.fence(invocation, passed.all, Semantics { acquires: false, ..semantics });
            }
        }
        passed
    }

    /// Invocations have executed a memory barrier, or with their subgroup a control barrier.
    pub(super) fn fence(
        &mut self,
        invocations: impl Iterator<Item = u32>,
        semantics: Semantics,
        of_subgroup: bool,
    ) {
        let invocations: Vec<(u32, usize)> =
            invocations.map(|invocation| (invocation, self.go_on(invocation).all)).collect();
        if of_subgroup {
            self.sync.join_subgroups(&invocations, semantics);
        }
        if !semantics.is_relaxed() {
            for (invocation, barriers) in invocations {
                self.sync.fence(invocation, barriers, semantics);
            }
        }
        self.sync.clock += 1;
    }

    /// An invocation executes an atomic instruction, before it counts as an access.
    pub(super) fn before_atomic(&mut self, invocation: u32, access: Option<&AtomicAccess>, kind: AccessKind) {
        if let Some(access) = access.filter(|_| kind.reads()) {
            let barriers = self.go_on(invocation).all;
            self.sync.read(invocation, barriers, access);
        }
    }

    /// An invocation has executed an atomic instruction, which counts as an access.
    pub(super) fn after_atomic(&mut self, invocation: u32, access: Option<&AtomicAccess>, kind: AccessKind) {
        if let Some(access) = access.filter(|_| kind.writes()) {
            let barriers = self.go_on(invocation).all;
            self.sync.write(invocation, barriers, access, kind.reads());
        }
    }

    /// An invocation has written to a location without an atomic instruction.
    #[inline]
    pub(super) fn overwrite(&mut self, location: Location) {
        self.sync.overwrite(location);
    }

    /// The event of an access that an invocation makes now.
    #[inline]
    pub(super) fn new_event(&self, now: &Accessor) -> Event {
        let &Accessor { place, form, call, epoch, .. } = now;
        Event { place, form, call, epoch, clock: self.sync.clock }
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
        self.sync.topology.group(invocation)
    }

    /// An invocation goes on: it, and the barriers that it has passed.
    pub(super) fn lane(&mut self, invocation: u32) -> LaneOrder {
        let passed = self.go_on(invocation);
        LaneOrder { invocation, group: self.group(invocation), passed }
    }

    /// Whether an invocation is in the instance of a scope that another one names.
    pub(super) fn is_in_scope(&self, scope: Option<Scope>, one: u32, other: u32) -> bool {
        let topology = self.sync.topology;
        topology.common(one, other) <= topology.level(scope)
    }

    /// The write of an earlier access.
    fn write(&self, access: Access, event: &Event, class: Class) -> Write {
        let traits = self.traits(event.place);
        let own = if traits.propagates { self.sync.topology.level(traits.scope) } else { Level::Own };
        Write { invocation: access.invocation, class: class as usize, clock: event.clock, own }
    }

    /// Whether what an earlier access of another invocation has written, which happens before, is
    /// available to one now and, where that reads, visible to it.
    pub(super) fn is_seen(&self, earlier: Access, now: &Accessor) -> bool {
        let event = self.event(earlier);
        // What reads, too, is ordered by happening before.
        if event.form.kind.reads() {
            return true;
        }
        let &Accessor { invocation, barriers, .. } = now;
        let write = self.write(earlier, event, now.class);
        if !self.sync.is_available(invocation, barriers, &write) {
            return false;
        }
        let traits = self.traits(now.place);
        let own = if traits.propagates { self.sync.topology.level(traits.scope) } else { Level::Own };
        now.form.kind.writes()
            || self.sync.is_visible(invocation, barriers, &write, own)
            || self.seen.contains(&(earlier, invocation))
    }

    /// Whether what an access reads from others stays visible for later ones that say nothing.
    pub(super) fn keeps_seen(&self, now: &Accessor) -> bool {
        self.sync.is_exact && now.form.kind.reads() && self.traits(now.place).propagates
    }

    /// An access has seen an earlier one of another invocation.
    pub(super) fn note_seen(&mut self, earlier: Access, now: &Accessor) {
        self.seen.insert((earlier, now.invocation));
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
            OrderedSubgroup::Subgroup => {
                self.sync.topology.common(access.invocation, now.invocation) <= Level::Subgroup
            }
            OrderedSubgroup::Launch => true,
        };
        if in_ordered_subgroup || (group == now.group && event.epoch < now.epoch) {
            return Ordered::BySynchronization;
        }
        if !self.synchronizes {
            return Ordered::Not;
        }
        let view = self.sync.view(now.invocation, now.barriers);
        let times = view.times(self.sync.topology, access.invocation, now.class as usize);
        if times.before > event.clock { Ordered::BySynchronization } else { Ordered::Not }
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
        let topology = Topology { is_compute: true, group_size, subgroup_size: 1 };
        let sync = Synchronization::new(topology, false);
        Self { sync, traits, synchronizes: true, ..Self::of([].into_iter(), &[]) }
    }
}
