//! What happens before an invocation: vector clocks, by class of memory, with how far what was
//! written is available (Vulkan, Memory Model, "Inter-Thread-Happens-Before", "Availability and
//! Visibility").
//!
//! A time stands for all accesses before it. Happens-before between invocations is by class of
//! memory, and so are these clocks.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::races::class::Classes;
use crate::races::level::{Level, Topology};

/// Number of classes of memory.
const CLASSES: usize = 3;

/// Whose accesses a clock is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Who {
    Invocation(u32),
    /// All invocations of a subgroup.
    Subgroup(u32),
    /// All invocations of a workgroup.
    Group(u32),
}

/// Until when accesses of an invocation happen before another one's, and are available to domains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Times {
    /// All accesses before it happen before.
    pub before: u32,
    /// By how far a write makes itself available ([`Level::Own`]: not at all, to
    /// [`Level::Workgroup`]), and by the domain that it is made available to: all such writes
    /// before the time are.
    available: [[u32; 3]; 3],
}

impl Times {
    /// Accesses before a time, of which what instructions made available is not looked at.
    pub(super) fn before(time: u32) -> Self {
        Self { before: time, available: [[0; 3]; 3] }
    }

    /// Limits it to accesses before another time.
    pub(super) fn until(self, before: u32) -> Self {
        Self { before, ..self }
    }

    /// Until when writes that make themselves available as far as `own` are so in a domain.
    pub(super) fn available(&self, own: Level, domain: Level) -> u32 {
        if own >= domain { self.before } else { self.available[own as usize][domain.domain()] }
    }

    /// Makes all that happens before available to the domains up to a level.
    pub(super) fn make_available(&mut self, level: Level) {
        for times in &mut self.available {
            for domain in Level::DOMAINS.into_iter().filter(|&domain| domain <= level) {
                times[domain.domain()] = times[domain.domain()].max(self.before);
            }
        }
    }

    /// An availability operation behind others, by an invocation that shares a level with the
    /// writer: what is available to a domain that holds both is made available up to a wider one.
    fn lift(&mut self, common: Level, level: Level) {
        for own in [Level::Own, Level::Subgroup, Level::Workgroup] {
            let mut latest = 0;
            for domain in Level::DOMAINS {
                if domain > level {
                    break;
                }
                if domain > own {
                    let time = &mut self.available[own as usize][domain.domain()];
                    *time = latest.max(*time);
                }
                if domain >= common {
                    latest = latest.max(self.available(own, domain));
                }
            }
        }
    }

    /// Whether others are nowhere earlier.
    pub(super) fn is_within(&self, other: &Self) -> bool {
        let mut joined = *other;
        joined.join(self);
        joined == *other
    }

    /// The later ones of both.
    pub(super) fn join(&mut self, other: &Self) {
        self.before = self.before.max(other.before);
        for (own, other) in self.available.iter_mut().flatten().zip(other.available.iter().flatten()) {
            *own = (*own).max(*other);
        }
    }
}

/// A visibility operation: of which invocation, of which class of memory, and from domains up to
/// which level.
type Seeing = (u32, usize, Level);

/// What an invocation knew once.
#[derive(Clone, Debug, Default)]
pub(super) struct View(pub Vec<Arc<Knowledge>>);

/// What happens before some place in a program.
#[derive(Clone, Debug, Default)]
pub(super) struct Knowledge {
    by: FxHashMap<Who, [Times; CLASSES]>,
    /// By class: until when all accesses count as if they happened before, and were available and
    /// visible, as more invocations than are told apart have taken part.
    everyone: [u32; CLASSES],
    /// The visibility operations that happen before, with what was known then.
    seen: FxHashMap<Seeing, View>,
}

impl Knowledge {
    /// More invocations, or visibility operations, are not told apart.
    const MOST: usize = 4096;

    /// What is known of an invocation.
    pub(super) fn of_invocation(invocation: u32, times: [Times; CLASSES]) -> Self {
        let mut knowledge = Self::default();
        knowledge.by.insert(Who::Invocation(invocation), times);
        knowledge
    }

    /// Notes what is known of all invocations of a workgroup.
    pub(super) fn add_group(&mut self, group: u32, class: usize, times: &Times) {
        self.by.entry(Who::Group(group)).or_default()[class].join(times);
    }

    /// Adds what other knowledge says of some classes.
    pub(super) fn join(&mut self, other: &Self, classes: Classes) {
        for (&who, times) in &other.by {
            let own = self.by.entry(who).or_default();
            classes.each().for_each(|class| own[class].join(&times[class]));
        }
        for class in classes.each() {
            self.everyone[class] = self.everyone[class].max(other.everyone[class]);
        }
        for (&seeing, what) in &other.seen {
            if classes.each().any(|class| class == seeing.1) {
                self.seen.insert(seeing, what.clone());
            }
        }
        self.limit();
    }

    fn limit(&mut self) {
        if self.by.len() <= Self::MOST && self.seen.len() <= Self::MOST {
            return;
        }
        for (class, everyone) in self.everyone.iter_mut().enumerate() {
            let latest = self.by.values().map(|times| times[class].before).max();
            *everyone = latest.unwrap_or(0).max(*everyone);
        }
        self.by.clear();
        self.seen.clear();
    }

    /// Whether nothing is known.
    pub(super) fn is_empty(&self) -> bool {
        self.by.is_empty() && self.everyone == [0; CLASSES]
    }

    /// An invocation makes available, up to a level, what happens before it: returns what is then
    /// known beside.
    pub(super) fn lifted(&self, topology: Topology, by: u32, classes: Classes, level: Level) -> Self {
        let mut lifted = Self::default();
        let (group, subgroup) = (topology.group(by), topology.subgroup(by));
        for (&who, times) in &self.by {
            let common = match who {
                Who::Invocation(other) => topology.common(other, by),
                Who::Subgroup(other) if other == subgroup => Level::Subgroup,
                Who::Group(other) if other == group => Level::Workgroup,
                Who::Subgroup(_) | Who::Group(_) => Level::Wide,
            };
            let mut add = |who: Who, common: Level| {
                let mut all = *times;
                classes.each().for_each(|class| all[class].lift(common, level));
                if all != *times {
                    lifted.by.insert(who, all);
                }
            };
            add(who, common);
            // Of a workgroup's invocations some share the subgroup.
            if who == Who::Group(group) {
                add(Who::Subgroup(subgroup), Level::Subgroup);
            }
        }
        lifted
    }
}

impl View {
    /// The view with another part.
    pub(super) fn with(mut self, part: Knowledge) -> Self {
        self.0.push(Arc::new(part));
        self
    }

    /// What is known of an invocation's accesses.
    pub(super) fn times(&self, topology: Topology, invocation: u32, class: usize) -> Times {
        let keys = [
            Who::Invocation(invocation),
            Who::Subgroup(topology.subgroup(invocation)),
            Who::Group(topology.group(invocation)),
        ];
        let mut times = Times::default();
        for part in &self.0 {
            let found = keys.iter().filter_map(|key| part.by.get(key));
            found.for_each(|found| times.join(&found[class]));
            let mut everyone = Times::before(part.everyone[class]);
            everyone.make_available(Level::Wide);
            times.join(&everyone);
        }
        times
    }

    /// Whether a write is available to a domain that holds its invocation and another one, and is
    /// no wider than a level.
    pub(super) fn is_available(&self, topology: Topology, write: &Write, other: u32, level: Level) -> bool {
        let times = self.times(topology, write.invocation, write.class);
        let common = topology.common(write.invocation, other);
        let domains = Level::DOMAINS.into_iter().filter(|&domain| common <= domain && domain <= level);
        domains.into_iter().any(|domain| times.available(write.own, domain) > write.clock)
    }

    /// Whether a visibility operation of an invocation, which reads from the domains up to a level
    /// when the invocation knows this, makes a write visible to it: by itself, or behind others
    /// that read from wider domains.
    pub(super) fn makes_visible(&self, topology: Topology, write: &Write, viewer: u32, level: Level) -> bool {
        if self.is_available(topology, write, viewer, level) {
            return true;
        }
        let chained = |(&(by, class, source), what): (&Seeing, &Self)| {
            class == write.class
                && source > level
                && topology.common(by, viewer) <= level
                && what.makes_visible(topology, write, by, source)
        };
        self.0.iter().any(|part| part.everyone[write.class] > write.clock || part.seen.iter().any(chained))
    }

    /// What a visibility operation of an invocation leaves behind for others that follow it.
    pub(super) fn seen_by(&self, by: u32, classes: Classes, level: Level) -> Knowledge {
        let stripped = |part: &Arc<Knowledge>| {
            // Operations that read from narrower domains are no beginning of this one's chain.
            match part.seen.keys().all(|&(.., source)| source > level) {
                true => part.clone(),
                false => {
                    let mut part = Knowledge::clone(part);
                    part.seen.retain(|&(.., source), _| source > level);
                    Arc::new(part)
                }
            }
        };
        let what = Self(self.0.iter().map(stripped).collect());
        let seen = classes.each().map(|class| ((by, class, level), what.clone()));
        Knowledge { seen: seen.collect(), ..Knowledge::default() }
    }
}

/// A write that another invocation's access may have to see.
#[derive(Clone, Copy, Debug)]
pub(super) struct Write {
    pub invocation: u32,
    pub class: usize,
    /// When it was.
    pub clock: u32,
    /// How far it makes itself available.
    pub own: Level,
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOPOLOGY: Topology = Topology { is_compute: true, group_size: 4, subgroup_size: 2 };
    const BUFFER: usize = 1;

    #[test]
    fn availability_chains_go_from_narrow_domains_to_wide_ones() {
        let mut times = Times::before(9);
        times.lift(Level::Workgroup, Level::Wide);
        assert_eq!(times.available(Level::Own, Level::Wide), 0, "nothing to lift");
        assert_eq!(times.available(Level::Workgroup, Level::Wide), 9, "available by itself");
        assert_eq!(times.available(Level::Subgroup, Level::Wide), 0, "the subgroup is another one");
        times.lift(Level::Subgroup, Level::Workgroup);
        assert_eq!(times.available(Level::Subgroup, Level::Workgroup), 9);
        assert_eq!(times.available(Level::Subgroup, Level::Wide), 0);
        times.lift(Level::Workgroup, Level::Wide);
        assert_eq!(times.available(Level::Subgroup, Level::Wide), 9);
        times.make_available(Level::Workgroup);
        assert_eq!(times.available(Level::Own, Level::Workgroup), 9);
        assert_eq!(times.available(Level::Own, Level::Wide), 0);
    }

    #[test]
    fn knowledge_of_too_many_invocations_is_of_everyone() {
        let mut knowledge = Knowledge::default();
        for invocation in 0..=Knowledge::MOST as u32 {
            let one = Knowledge::of_invocation(invocation, [Times::before(invocation); CLASSES]);
            knowledge.join(&one, Classes::ALL);
        }
        let view = View::default().with(knowledge);
        assert_eq!(view.times(TOPOLOGY, 7, BUFFER).before, Knowledge::MOST as u32);
        let write = Write { invocation: 7, class: BUFFER, clock: 3, own: Level::Own };
        assert!(view.makes_visible(TOPOLOGY, &write, 9, Level::Subgroup));
    }
}
