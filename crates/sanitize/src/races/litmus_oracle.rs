//! A judge of litmus tests that shares no code with the sanitizer: relations of Vulkan's "Memory
//! Model" as matrices over the events of an execution, in the terms of the Khronos Group's formal
//! model (the repository Vulkan-MemoryModel, `alloy/spirv.als`). The tests in the file beside
//! compare the two over families of tests.

use rspirv::spirv::{MemorySemantics as Semantics, Scope};

use crate::races::litmus::{Privacy, Step};

/// Domains from narrow to wide: subgroup, workgroup, all.
const DOMAINS: [u8; 3] = [1, 2, 3];

/// A relation over events: by event the set of those that it is related to.
#[derive(Clone, PartialEq)]
struct Relation(Vec<u64>);

impl Relation {
    fn of(count: usize, is_related: impl Fn(usize, usize) -> bool) -> Self {
        let row = |one| (0..count).filter(|&other| is_related(one, other)).fold(0, |row, at| row | 1 << at);
        Self((0..count).map(row).collect())
    }

    fn has(&self, one: usize, other: usize) -> bool {
        self.0[one] >> other & 1 == 1
    }

    /// First one, then the other.
    fn then(&self, next: &Self) -> Self {
        let step = |row: &u64| {
            let middle = (0..self.0.len()).filter(|at| row >> at & 1 == 1);
            middle.fold(0, |all, at| all | next.0[at])
        };
        Self(self.0.iter().map(step).collect())
    }

    fn or(&self, other: &Self) -> Self {
        Self(self.0.iter().zip(&other.0).map(|(one, other)| one | other).collect())
    }

    fn and(&self, is_related: impl Fn(usize, usize) -> bool) -> Self {
        Self::of(self.0.len(), |one, other| self.has(one, other) && is_related(one, other))
    }

    /// The transitive closure.
    fn closed(&self) -> Self {
        let mut all = self.clone();
        loop {
            let more = all.or(&all.then(&all));
            if more == all {
                return all;
            }
            all = more;
        }
    }
}

/// An instruction that an invocation executes.
#[derive(Clone, Copy, Default)]
struct Event {
    invocation: usize,
    group: usize,
    subgroup: usize,
    /// The place in the execution, which is the order of writes.
    time: usize,
    variable: Option<u32>,
    reads: bool,
    writes: bool,
    is_atomic: bool,
    is_private: bool,
    releases: bool,
    acquires: bool,
    /// Whether its semantics name buffers; of an access whether it is one to a buffer.
    names_buffers: bool,
    /// The narrowest domain that is the dual of its scope; 0 for none.
    scope: u8,
    /// By itself, of its own location.
    makes_available: bool,
    makes_visible: bool,
    /// By semantics, of all locations.
    barrier_available: bool,
    barrier_visible: bool,
    /// Of a control barrier: how many are before it, and whether it is one of a subgroup.
    barrier: Option<(usize, bool)>,
}

impl Event {
    fn is_access(&self) -> bool {
        self.reads || self.writes
    }

    fn is_fence(&self) -> bool {
        !self.is_access() && (self.releases || self.acquires)
    }
}

fn domain(scope: Scope) -> u8 {
    match scope {
        Scope::Subgroup => 1,
        Scope::Workgroup => 2,
        Scope::Device | Scope::QueueFamily => 3,
        _ => 0,
    }
}

/// The event of a step.
fn event(step: Step, barriers: usize) -> Event {
    let semantics = |scope: Scope, semantics: Semantics| Event {
        releases: semantics.intersects(Semantics::RELEASE | Semantics::ACQUIRE_RELEASE),
        acquires: semantics.intersects(Semantics::ACQUIRE | Semantics::ACQUIRE_RELEASE),
        names_buffers: semantics.contains(Semantics::UNIFORM_MEMORY),
        scope: domain(scope),
        barrier_available: semantics.contains(Semantics::MAKE_AVAILABLE),
        barrier_visible: semantics.contains(Semantics::MAKE_VISIBLE),
        ..Event::default()
    };
    let access = |variable, privacy| Event {
        variable: Some(variable),
        is_private: matches!(privacy, Privacy::Private | Privacy::Volatile),
        scope: if let Privacy::Within(scope) = privacy { domain(scope) } else { 0 },
        ..Event::default()
    };
    let is_within = |privacy| matches!(privacy, Privacy::Within(_));
    match step {
        Step::Load(variable, privacy) => {
            Event { reads: true, makes_visible: is_within(privacy), ..access(variable, privacy) }
        }
        Step::Store(variable, privacy) => {
            Event { writes: true, makes_available: is_within(privacy), ..access(variable, privacy) }
        }
        Step::AtomicLoad(variable, scope, bits) => {
            let variable = Some(variable);
            Event { variable, reads: true, is_atomic: true, makes_visible: true, ..semantics(scope, bits) }
        }
        Step::AtomicStore(variable, scope, bits) => {
            let variable = Some(variable);
            Event { variable, writes: true, is_atomic: true, makes_available: true, ..semantics(scope, bits) }
        }
        Step::Add(variable, scope, bits) => Event {
            variable: Some(variable),
            reads: true,
            writes: true,
            is_atomic: true,
            makes_available: true,
            makes_visible: true,
            ..semantics(scope, bits)
        },
        Step::Fence(scope, bits) => semantics(scope, bits),
        Step::Barrier(bits) => {
            Event { barrier: Some((barriers, false)), ..semantics(Scope::Workgroup, bits) }
        }
        Step::SubgroupBarrier(bits) => {
            Event { barrier: Some((barriers, true)), ..semantics(Scope::Subgroup, bits) }
        }
    }
}

/// The events of invocations by workgroup, each of which runs up to its next barrier before the
/// next one runs.
fn events(groups: &[&[&[Step]]], subgroup_size: usize) -> Vec<Event> {
    let mut all = Vec::new();
    let group_size = groups.iter().map(|group| group.len()).max().unwrap_or(1);
    for (group, invocations) in groups.iter().enumerate() {
        for (local, steps) in invocations.iter().enumerate() {
            let mut barriers = 0;
            for (at, &step) in steps.iter().enumerate() {
                let of_step = event(step, barriers);
                let invocation = group * group_size + local;
                let subgroup = group * group_size + local / subgroup_size;
                // By barriers passed, by invocation, by step.
                let time = (barriers * 64 + invocation) * 64 + at;
                barriers += usize::from(of_step.barrier.is_some());
                all.push(Event { invocation, group, subgroup, time, ..of_step });
            }
        }
    }
    all
}

/// Whether an execution of invocations by workgroup has a data race.
pub(super) fn races(groups: &[&[&[Step]]], subgroup_size: usize) -> bool {
    let all = events(groups, subgroup_size);
    let count = all.len();
    assert!(count <= 64, "too many events");
    let is_one = |one: usize, other: usize| all[one].invocation == all[other].invocation;
    // The narrowest domain of two events.
    let common = |one: usize, other: usize| match () {
        () if all[one].subgroup == all[other].subgroup => 1,
        () if all[one].group == all[other].group => 2,
        () => 3,
    };
    let in_scope = |one: usize, other: usize| common(one, other) <= all[one].scope.min(all[other].scope);
    let same_place =
        |one: usize, other: usize| all[one].variable.is_some() && all[one].variable == all[other].variable;
    let mutual = |one: usize, other: usize| {
        one != other
            && all[one].is_atomic
            && all[other].is_atomic
            && same_place(one, other)
            && in_scope(one, other)
    };
    let program_order =
        Relation::of(count, |one, other| is_one(one, other) && all[one].time < all[other].time);
    // What each read reads: the last write before it.
    let reads_from = |read: usize| {
        let before = |&write: &usize| {
            all[write].writes && same_place(write, read) && write != read && all[write].time < all[read].time
        };
        (0..count).filter(before).max_by_key(|&write| all[write].time)
    };
    // The writes of the release sequence of an atomic write: read-modify-writes that follow each
    // other in its scoped modification order.
    let in_release_sequence = |head: usize, write: usize| {
        let mut at = head;
        while at != write {
            let follows =
                |&next: &usize| all[next].writes && mutual(head, next) && all[next].time > all[at].time;
            match (0..count).filter(follows).min_by_key(|&next| all[next].time) {
                Some(next) if all[next].reads => at = next,
                _ => return false,
            }
        }
        true
    };
    // An atomic read takes its value from an atomic write, or its release sequence.
    let takes_from = Relation::of(count, |head, read| {
        let Some(write) = reads_from(read).filter(|_| all[read].reads && all[read].is_atomic) else {
            return false;
        };
        all[head].is_atomic
            && all[head].writes
            && all[write].is_atomic
            && mutual(write, read)
            && in_release_sequence(head, write)
    });
    let releases = |one: usize| all[one].releases;
    let acquires = |one: usize| all[one].acquires;
    // Accesses are all to buffers: a fence orders through an atomic access whose class it names.
    let to_write = Relation::of(count, |fence, write| {
        fence == write && all[fence].is_atomic
            || program_order.has(fence, write)
                && all[fence].is_fence()
                && all[fence].names_buffers
                && all[write].is_atomic
                && all[write].writes
    });
    let from_read = Relation::of(count, |read, fence| {
        read == fence && all[read].is_atomic
            || program_order.has(read, fence)
                && all[fence].is_fence()
                && all[fence].names_buffers
                && all[read].is_atomic
                && all[read].reads
    });
    let one_barrier = Relation::of(count, |one, other| {
        let is_same = all[one].barrier.is_some() && all[one].barrier == all[other].barrier;
        let of_subgroup = matches!(all[one].barrier, Some((_, true)));
        let domain = if of_subgroup { 1 } else { 2 };
        is_same && one != other && common(one, other) <= domain
    });
    let or_itself = Relation::of(count, |one, other| one == other || program_order.has(one, other));
    let fence_to_barrier =
        or_itself.and(|fence, barrier| all[fence].is_fence() && all[barrier].barrier.is_some());
    let barrier_to_fence =
        or_itself.and(|barrier, fence| all[fence].is_fence() && all[barrier].barrier.is_some());
    let synchronizes = to_write
        .then(&takes_from)
        .then(&from_read)
        .or(&fence_to_barrier.then(&one_barrier).then(&barrier_to_fence))
        .and(|one, other| releases(one) && acquires(other) && in_scope(one, other));
    // Inter-thread-happens-before of buffers, the class of all accesses.
    let named = |one: usize| all[one].is_access() || all[one].names_buffers;
    let orders = |one: usize| all[one].names_buffers && (releases(one) || acquires(one));
    let between = synchronizes
        .and(|one, other| orders(one) && orders(other))
        .or(&program_order.and(|one, other| named(one) && releases(other) && orders(other)))
        .or(&program_order.and(|one, other| acquires(one) && orders(one) && named(other)))
        .closed();
    let happens_before = between.or(&program_order);
    // Which availability and visibility operations include an access.
    let includes = |operation: usize, access: usize, by_semantics: bool, by_itself: bool| {
        by_semantics && all[operation].names_buffers || by_itself && same_place(operation, access)
    };
    let makes_available = |one: usize| all[one].makes_available || all[one].barrier_available;
    let makes_visible = |one: usize| all[one].makes_visible || all[one].barrier_visible;
    let available_for = |access: usize, operation: usize| {
        includes(operation, access, all[operation].barrier_available, all[operation].makes_available)
    };
    let visible_for = |access: usize, operation: usize| {
        includes(operation, access, all[operation].barrier_visible, all[operation].makes_visible)
    };
    // The last operations of availability chains that make a write available to a domain.
    let available = |write: usize, domain: u8| -> u64 {
        let mut last = [0u64; 4];
        for target in DOMAINS {
            for at in (0..count).filter(|&at| makes_available(at) && all[at].scope >= target) {
                let is_first = (at == write || program_order.has(write, at)) && available_for(write, at);
                let follows = |before: usize, through: u8| {
                    last[through as usize] >> before & 1 == 1
                        && happens_before.has(before, at)
                        && common(before, at) <= through
                        && available_for(write, at)
                };
                let is_chained = (1..target).any(|through| (0..count).any(|before| follows(before, through)));
                if is_first || is_chained {
                    last[target as usize] |= 1 << at;
                }
            }
        }
        last[domain as usize]
    };
    // The first operations of visibility chains that make visible to a read what a domain has.
    let visible = |read: usize, domain: u8| -> u64 {
        let mut first = [0u64; 4];
        for source in DOMAINS {
            for at in (0..count).filter(|&at| makes_visible(at) && all[at].scope >= source) {
                let is_last = (at == read || program_order.has(at, read)) && visible_for(read, at);
                let precedes = |next: usize, through: u8| {
                    first[through as usize] >> next & 1 == 1
                        && happens_before.has(at, next)
                        && common(at, next) <= through
                        && visible_for(read, at)
                };
                let is_chained = (1..source).any(|through| (0..count).any(|next| precedes(next, through)));
                if is_last || is_chained {
                    first[source as usize] |= 1 << at;
                }
            }
        }
        first[domain as usize]
    };
    let each = |set: u64| (0..count).filter(move |at| set >> at & 1 == 1);
    let location_ordered = |one: usize, other: usize| {
        let is_shared = !all[one].is_private && !all[other].is_private;
        if is_one(one, other) && happens_before.has(one, other) {
            return true;
        }
        if !is_shared {
            return false;
        }
        if all[one].reads && happens_before.has(one, other) {
            return true;
        }
        all[one].writes
            && DOMAINS.into_iter().filter(|&domain| domain >= common(one, other)).any(|domain| {
                each(available(one, domain)).any(|made| {
                    all[other].writes && happens_before.has(made, other)
                        || all[other].reads
                            && each(visible(other, domain)).any(|seen| happens_before.has(made, seen))
                })
            })
    };
    (0..count).any(|one| {
        (0..one).any(|other| {
            same_place(one, other)
                && (all[one].writes || all[other].writes)
                && !mutual(one, other)
                && !location_ordered(one, other)
                && !location_ordered(other, one)
        })
    })
}
