//! Synchronization between invocations: which release synchronizes with which acquire (Vulkan,
//! Memory Model, "Synchronizes-With"), through atomic instructions on one location, around which
//! fences may stand, or through control barriers; and what follows of it for what is available and
//! visible.
//!
//! Of modules that declare the Vulkan memory model this is exact for the execution that is met. Of
//! others, which have no operations of availability, the invocations of a workgroup count as one:
//! what one of them releases or acquires, all do.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::memory_shadow::MemoryKey;
use crate::races::class::{Class, Classes};
use crate::races::knowledge::{Knowledge, Times, View, Write};
use crate::races::level::{Level, Topology};
use crate::races::ordering::Semantics;

/// A place in memory that atomic instructions access.
pub(super) type Location = (MemoryKey, u64);

/// An atomic instruction's access.
#[derive(Clone, Copy, Debug)]
pub(super) struct AtomicAccess {
    pub location: Location,
    pub class: Class,
    pub reference: u32,
    /// Bits that it accesses.
    pub width: u32,
    /// How far its scope reaches.
    pub level: Level,
    pub semantics: Semantics,
}

/// A release: an atomic instruction that releases, or a fence before one.
#[derive(Clone, Debug)]
struct Release {
    by: u32,
    level: Level,
    classes: Classes,
    /// What happens before it.
    message: View,
}

/// A release, and the atomic write through which others may synchronize with it.
#[derive(Clone, Debug)]
struct Head {
    release: Arc<Release>,
    /// The class of the atomic write; none where a control barrier is in its place.
    class: Option<Class>,
    reference: u32,
    width: u32,
    level: Level,
}

impl Head {
    /// A release before a control barrier.
    fn by_barrier(release: Arc<Release>) -> Self {
        Self { release, class: None, reference: 0, width: 0, level: Level::Wide }
    }
}

/// What an invocation has done, and what it could synchronize with.
#[derive(Debug, Default)]
struct Agent {
    /// Until when its own writes are available.
    own: [Times; 3],
    /// The last release fences, by scope and classes.
    fences: Vec<Arc<Release>>,
    /// The releases that a fence that acquires would synchronize with.
    read: Vec<Head>,
    /// What it knew at its last visibility operations, by class and domain.
    views: Views,
    /// Control barriers whose releases it has joined.
    settled: usize,
}

/// What was known at the last visibility operations, by class and domain.
type Views = [[Option<View>; 3]; 3];

/// A control barrier of a workgroup.
#[derive(Debug)]
struct Phase {
    semantics: Semantics,
    /// When the last invocation has come to it.
    time: u32,
    /// What the invocations that have come to it know.
    knowledge: Knowledge,
    /// Releases before it of which not all invocations know behind it.
    releases: Vec<Arc<Release>>,
    /// What all invocations know behind it, once one goes on.
    after: Option<(Arc<Knowledge>, Views)>,
}

/// What synchronizes the invocations of a launch or dispatch.
#[derive(Debug)]
pub(super) struct Synchronization {
    pub topology: Topology,
    /// Whether each module declares the Vulkan memory model.
    pub is_exact: bool,
    /// Atomic instructions, fences and barriers so far.
    pub clock: u32,
    agents: FxHashMap<u32, Agent>,
    /// What happens before by synchronization: by invocation, or by workgroup where that counts as
    /// one.
    known: FxHashMap<u32, Arc<Knowledge>>,
    /// By workgroup: its control barriers so far.
    phases: FxHashMap<u32, Vec<Phase>>,
    /// The releases that a read of a location synchronizes with.
    heads: FxHashMap<Location, Vec<Head>>,
}

impl Synchronization {
    pub(super) fn new(topology: Topology, is_exact: bool) -> Self {
        Self {
            topology,
            is_exact,
            clock: 0,
            agents: FxHashMap::default(),
            known: FxHashMap::default(),
            phases: FxHashMap::default(),
            heads: FxHashMap::default(),
        }
    }

    /// Other invocations run: those before have ended, and are still known by what they released.
    pub(super) fn end_invocations(&mut self) {
        self.agents.clear();
        self.known.clear();
        self.phases.clear();
        self.heads.retain(|(key, _), _| !matches!(key, MemoryKey::Workgroup(_)));
    }

    /// Whose knowledge an invocation has.
    fn knower(&self, invocation: u32) -> u32 {
        if self.is_exact { invocation } else { self.topology.group(invocation) }
    }

    /// What an invocation knows that has passed some control barriers.
    pub(super) fn view(&self, invocation: u32, barriers: usize) -> View {
        let phases = self.phases.get(&self.topology.group(invocation));
        let last = barriers.checked_sub(1).and_then(|last| phases?.get(last)?.after.as_ref());
        let by_barriers = last.map(|(knowledge, _)| knowledge.clone());
        let own = self.known.get(&self.knower(invocation)).cloned();
        View(by_barriers.into_iter().chain(own).collect())
    }

    /// Whether a write that happens before is available to an invocation.
    pub(super) fn is_available(&self, invocation: u32, barriers: usize, write: &Write) -> bool {
        self.view(invocation, barriers).is_available(self.topology, write, invocation, Level::Wide)
    }

    /// Whether a write is visible to an invocation: by the access itself, where that makes visible
    /// as far as a level, or by an earlier visibility operation.
    pub(super) fn is_visible(&self, invocation: u32, barriers: usize, write: &Write, own: Level) -> bool {
        let makes_visible = |view: &View, level| view.makes_visible(self.topology, write, invocation, level);
        if own > Level::Own && makes_visible(&self.view(invocation, barriers), own) {
            return true;
        }
        let phases = self.phases.get(&self.topology.group(invocation));
        let last = barriers.checked_sub(1).and_then(|last| phases?.get(last)?.after.as_ref());
        let views = [self.agents.get(&invocation).map(|agent| &agent.views), last.map(|(_, views)| views)];
        views.into_iter().flatten().any(|views| {
            let of_class = Level::DOMAINS.into_iter().zip(&views[write.class]);
            of_class
                .filter_map(|(level, view)| Some((level, view.as_ref()?)))
                .any(|(level, view)| makes_visible(view, level))
        })
    }

    /// An invocation goes on that has passed some control barriers.
    pub(super) fn settle(&mut self, invocation: u32, barriers: usize) {
        let group = self.topology.group(invocation);
        let Some(phases) = self.phases.get_mut(&group) else { return };
        for at in 0..barriers.min(phases.len()) {
            if phases[at].after.is_none() {
                let before = at.checked_sub(1).and_then(|before| phases[before].after.clone());
                let (knowledge, views) = before.unwrap_or_default();
                phases[at].settle(group, Knowledge::clone(&knowledge), views);
            }
        }
        let settled = self.agents.get(&invocation).map_or(0, |agent| agent.settled);
        let new = phases.iter().enumerate().take(barriers).skip(settled);
        let new = new.filter(|(_, phase)| !phase.releases.is_empty());
        let new: Vec<(usize, Semantics, Vec<Arc<Release>>)> =
            new.map(|(at, phase)| (at, phase.semantics, phase.releases.clone())).collect();
        if new.is_empty() {
            return;
        }
        for (at, semantics, releases) in new {
            for release in releases.into_iter().filter(|release| release.by != invocation) {
                if semantics.acquires {
                    self.acquire(invocation, &semantics, &release);
                }
                self.add_read(invocation, Head::by_barrier(release));
            }
            if semantics.acquires {
                self.make_visible(invocation, at + 1, &semantics);
            }
        }
        self.agents.entry(invocation).or_default().settled = barriers;
    }

    /// An invocation comes to a control barrier of its workgroup, having passed some.
    pub(super) fn arrive(&mut self, invocation: u32, barriers: usize, semantics: Semantics) {
        if !self.is_exact {
            return;
        }
        self.settle(invocation, barriers);
        if semantics.releases && semantics.available {
            self.make_available(invocation, barriers, &semantics);
        }
        let joins_all = semantics.joins_all();
        let own = (semantics.releases && !joins_all)
            .then(|| Arc::new(self.release(invocation, barriers, &semantics)));
        let agent = self.agents.get(&invocation);
        let fences = agent.map_or(&[][..], |agent| &agent.fences).iter().cloned();
        let is_left =
            |release: &Arc<Release>| !joins_all || release.classes != release.classes.and(semantics.classes);
        let releases: Vec<_> = fences.filter(is_left).chain(own).collect();
        let before = self.clock + 1;
        // What the barrier makes available of all invocations is noted once.
        let mut of_all = Times::before(before);
        if semantics.available {
            of_all.make_available(semantics.level);
        }
        let own = agent.map(|agent| agent.own.map(|times| times.until(before)));
        let own = own.filter(|own| !own.iter().all(|times| times.is_within(&of_all)));
        let own = own.map(|own| Knowledge::of_invocation(invocation, own));
        let known = self.known.get(&invocation).cloned();
        let phases = self.phases.entry(self.topology.group(invocation)).or_default();
        while phases.len() <= barriers {
            phases.push(Phase {
                semantics,
                time: 0,
                knowledge: Knowledge::default(),
                releases: Vec::new(),
                after: None,
            });
        }
        let phase = &mut phases[barriers];
        phase.time = phase.time.max(before);
        phase.releases.extend(releases);
        if joins_all {
            let parts = own.iter().chain(known.as_deref());
            parts.for_each(|part| phase.knowledge.join(part, semantics.classes));
        }
    }

    /// Invocations of subgroups execute a control barrier of their subgroup together.
    pub(super) fn join_subgroups(&mut self, invocations: &[(u32, usize)], semantics: Semantics) {
        if !self.is_exact {
            return;
        }
        let mut by_subgroup: FxHashMap<u32, Vec<(u32, usize)>> = FxHashMap::default();
        for &(invocation, barriers) in invocations {
            by_subgroup.entry(self.topology.subgroup(invocation)).or_default().push((invocation, barriers));
        }
        for members in by_subgroup.into_values() {
            let mut releases = Vec::new();
            for &(invocation, barriers) in &members {
                if semantics.releases && semantics.available {
                    self.make_available(invocation, barriers, &semantics);
                }
                if semantics.releases {
                    releases.push(Arc::new(self.release(invocation, barriers, &semantics)));
                }
                let agent = self.agents.get(&invocation);
                releases.extend(agent.into_iter().flat_map(|agent| agent.fences.iter().cloned()));
            }
            for &(invocation, barriers) in &members {
                for release in releases.iter().filter(|release| release.by != invocation) {
                    if semantics.acquires {
                        self.acquire(invocation, &semantics, release);
                    }
                    self.add_read(invocation, Head::by_barrier(release.clone()));
                }
                if semantics.acquires {
                    self.make_visible(invocation, barriers, &semantics);
                }
            }
        }
    }

    /// An invocation executes a memory barrier.
    pub(super) fn fence(&mut self, invocation: u32, barriers: usize, semantics: Semantics) {
        if semantics.acquires {
            let read = self.agents.get(&invocation).map_or_else(Vec::new, |agent| agent.read.clone());
            for Head { release, class, .. } in read {
                if class.is_none_or(|class| !self.is_exact || semantics.classes.contains(class)) {
                    self.acquire(invocation, &semantics, &release);
                }
            }
            self.make_visible(invocation, barriers, &semantics);
        }
        if semantics.releases {
            if semantics.available {
                self.make_available(invocation, barriers, &semantics);
            }
            let release = Arc::new(self.release(invocation, barriers, &semantics));
            let fences = &mut self.agents.entry(invocation).or_default().fences;
            fences.retain(|fence| (fence.level, fence.classes) != (release.level, release.classes));
            fences.push(release);
        }
    }

    /// An invocation executes an atomic instruction that reads: what it may synchronize with.
    pub(super) fn read(&mut self, invocation: u32, barriers: usize, access: &AtomicAccess) {
        let topology = self.topology;
        let is_mutual = |head: &&Head| {
            head.release.by != invocation
                && topology.common(head.release.by, invocation) <= head.level.min(access.level)
                && (head.reference, head.width) == (access.reference, access.width)
        };
        let heads = self.heads.get(&access.location).map_or(&[][..], Vec::as_slice);
        let read: Vec<Head> = heads.iter().filter(is_mutual).cloned().collect();
        for head in read {
            if access.semantics.acquires {
                self.acquire(invocation, &access.semantics, &head.release);
            }
            self.add_read(invocation, head);
        }
        if access.semantics.acquires {
            self.make_visible(invocation, barriers, &access.semantics);
        }
    }

    /// Keeps a release for later fences of an invocation.
    fn add_read(&mut self, invocation: u32, head: Head) {
        let topology = self.topology;
        let read = &mut self.agents.entry(invocation).or_default().read;
        if read.iter().any(|other| Arc::ptr_eq(&other.release, &head.release)) {
            return;
        }
        read.push(head);
        if read.len() > MOST_HEADS {
            *read = merged(topology, read);
        }
    }

    /// An invocation executes an atomic instruction that writes: what others may synchronize with
    /// by reading what it has written.
    pub(super) fn write(&mut self, invocation: u32, barriers: usize, access: &AtomicAccess, reads: bool) {
        let semantics = &access.semantics;
        let mut releases = Vec::new();
        if semantics.releases {
            if semantics.available {
                self.make_available(invocation, barriers, semantics);
            }
            releases.push(Arc::new(self.release(invocation, barriers, semantics)));
        }
        let fences = self.agents.get(&invocation).map_or(&[][..], |agent| &agent.fences);
        let heads_one = |fence: &&Arc<Release>| !self.is_exact || fence.classes.contains(access.class);
        releases.extend(fences.iter().filter(heads_one).cloned());
        let topology = self.topology;
        let mut heads = self.heads.remove(&access.location).unwrap_or_default();
        // A read-modify-write goes on with a release sequence, another write begins anew.
        heads.retain(|head| {
            reads
                && topology.common(head.release.by, invocation) <= head.level.min(access.level)
                && (head.reference, head.width) == (access.reference, access.width)
        });
        let &AtomicAccess { class, reference, width, level, .. } = access;
        let class = Some(class);
        heads.extend(releases.into_iter().map(|release| Head { release, class, reference, width, level }));
        if heads.len() > MOST_HEADS {
            heads = merged(topology, &heads);
        }
        if !heads.is_empty() {
            self.heads.insert(access.location, heads);
        }
    }

    /// Another write than an atomic one ends the release sequences of a location.
    #[inline]
    pub(super) fn overwrite(&mut self, location: Location) {
        if !self.heads.is_empty() {
            self.heads.remove(&location);
        }
    }

    /// The release that an invocation executes now.
    fn release(&self, invocation: u32, barriers: usize, semantics: &Semantics) -> Release {
        let before = self.clock + 1;
        let mut own = Knowledge::default();
        if self.is_exact {
            let mut times = self.agents.get(&invocation).map_or_else(Default::default, |agent| agent.own);
            times.iter_mut().for_each(|times: &mut Times| times.before = before);
            own = Knowledge::of_invocation(invocation, times);
        } else {
            let group = self.topology.group(invocation);
            (0..3).for_each(|class| own.add_group(group, class, &Times::before(before)));
        }
        let message = self.view(invocation, barriers).with(own);
        Release { by: invocation, level: semantics.level, classes: semantics.classes, message }
    }

    /// An invocation synchronizes with a release, where each is in the other's scope.
    fn acquire(&mut self, invocation: u32, semantics: &Semantics, release: &Release) {
        if self.topology.common(release.by, invocation) > release.level.min(semantics.level) {
            return;
        }
        let classes = release.classes.and(semantics.classes);
        let knower = self.knower(invocation);
        let known = Arc::make_mut(self.known.entry(knower).or_default());
        release.message.0.iter().for_each(|part| known.join(part, classes));
    }

    /// An invocation makes available what it has written, and what is available to a domain that it
    /// shares with who has written it.
    fn make_available(&mut self, invocation: u32, barriers: usize, semantics: &Semantics) {
        if !self.is_exact {
            return;
        }
        let Semantics { classes, level, .. } = *semantics;
        let before = self.clock + 1;
        let own = &mut self.agents.entry(invocation).or_default().own;
        for class in classes.each() {
            own[class].before = before;
            own[class].make_available(level);
        }
        let view = self.view(invocation, barriers);
        let lifted: Vec<Knowledge> =
            view.0.iter().map(|part| part.lifted(self.topology, invocation, classes, level)).collect();
        if lifted.iter().any(|part| !part.is_empty()) {
            let known = Arc::make_mut(self.known.entry(invocation).or_default());
            lifted.iter().for_each(|part| known.join(part, classes));
        }
    }

    /// An invocation goes on behind a control barrier of its workgroup, which makes visible what is
    /// available, as it does to all others: nobody begins a chain with it.
    pub(super) fn make_visible_to_all(&mut self, invocation: u32, barriers: usize, semantics: &Semantics) {
        let Semantics { classes, level, acquires, visible, .. } = *semantics;
        if !(self.is_exact && acquires && visible)
            || level == Level::Own
            || !self.known.contains_key(&invocation)
        {
            return;
        }
        let view = self.view(invocation, barriers);
        let views = &mut self.agents.entry(invocation).or_default().views;
        classes.each().for_each(|class| views[class][level.domain()] = Some(view.clone()));
    }

    /// An invocation makes visible what it knows to be available.
    fn make_visible(&mut self, invocation: u32, barriers: usize, semantics: &Semantics) {
        let Semantics { classes, level, visible, .. } = *semantics;
        if !self.is_exact || !visible || level == Level::Own {
            return;
        }
        let view = self.view(invocation, barriers);
        let seen = view.seen_by(invocation, classes, level);
        Arc::make_mut(self.known.entry(invocation).or_default()).join(&seen, classes);
        let views = &mut self.agents.entry(invocation).or_default().views;
        classes.each().for_each(|class| views[class][level.domain()] = Some(view.clone()));
    }
}

impl Phase {
    /// All invocations have come to it: what they know behind it, given what all knew before.
    fn settle(&mut self, group: u32, mut knowledge: Knowledge, mut views: Views) {
        let Semantics { classes, level, available, visible, acquires, .. } = self.semantics;
        if self.semantics.joins_all() {
            knowledge.join(&self.knowledge, classes);
            let mut times = Times::before(self.time);
            if available {
                times.make_available(level);
            }
            classes.each().for_each(|class| knowledge.add_group(group, class, &times));
        }
        let knowledge = Arc::new(knowledge);
        if acquires && visible && level > Level::Own {
            let view = View(vec![knowledge.clone()]);
            classes.each().for_each(|class| views[class][level.domain()] = Some(view.clone()));
        }
        self.after = Some((knowledge, views));
    }
}

/// More releases of one location are joined.
const MOST_HEADS: usize = 16;

/// Joins releases that the same invocations can synchronize with.
fn merged(topology: Topology, heads: &[Head]) -> Vec<Head> {
    let instance = |head: &Head| match head.release.level.min(head.level) {
        Level::Own => head.release.by,
        Level::Subgroup => topology.subgroup(head.release.by),
        Level::Workgroup => topology.group(head.release.by),
        Level::Wide => 0,
    };
    let mut merged: Vec<Head> = Vec::new();
    for head in heads {
        let key = |head: &Head| {
            let Head { release, class, level, reference, width } = head;
            let class = class.map(|class| class as usize);
            ((release.level, release.classes, instance(head)), (class, *level, *reference, *width))
        };
        let Some(known) = merged.iter_mut().find(|known| key(known) == key(head)) else {
            merged.push(head.clone());
            continue;
        };
        let mut knowledge = Knowledge::default();
        let parts = known.release.message.0.iter().chain(&head.release.message.0);
        parts.for_each(|part| knowledge.join(part, Classes::ALL));
        let Release { by, level, classes, .. } = *head.release;
        let message = View(vec![Arc::new(knowledge)]);
        known.release = Arc::new(Release { by, level, classes, message });
    }
    merged
}
