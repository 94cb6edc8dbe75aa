//! Scopes of one dispatch or launch, and which invocations they hold together.

use rspirv::spirv::Scope;

/// How far a scope reaches, and the memory domain that is its dual (Vulkan, Memory Model,
/// "Availability and Visibility"). All invocations of a dispatch or launch are of one queue family,
/// whose domain is thus as wide as that of the device's shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Level {
    /// The invocation alone.
    Own,
    Subgroup,
    Workgroup,
    /// All invocations of the dispatch or launch.
    Wide,
}

impl Level {
    /// The levels that have memory domains, from the narrowest on.
    pub(super) const DOMAINS: [Self; 3] = [Self::Subgroup, Self::Workgroup, Self::Wide];

    /// The place among [`Level::DOMAINS`].
    pub(super) fn domain(self) -> usize {
        (self as usize).saturating_sub(1)
    }
}

/// How invocations form subgroups and workgroups.
#[derive(Clone, Copy, Debug)]
pub(super) struct Topology {
    /// Whether there are workgroups.
    pub is_compute: bool,
    /// Invocations of a workgroup; 1 in ray tracing.
    pub group_size: u32,
    /// Invocations of a subgroup of a workgroup.
    pub subgroup_size: u32,
}

impl Topology {
    /// The workgroup of an invocation; in ray tracing itself.
    #[inline]
    pub(super) fn group(self, invocation: u32) -> u32 {
        if self.group_size == 1 { invocation } else { invocation / self.group_size }
    }

    /// The subgroup of an invocation, by a number that no other workgroup's has.
    pub(super) fn subgroup(self, invocation: u32) -> u32 {
        let Self { group_size, subgroup_size, .. } = self;
        let of_group = group_size.div_ceil(subgroup_size);
        self.group(invocation) * of_group + invocation % group_size / subgroup_size
    }

    /// The narrowest level that holds two invocations.
    pub(super) fn common(self, one: u32, other: u32) -> Level {
        match () {
            () if one == other => Level::Own,
            () if self.group(one) != self.group(other) => Level::Wide,
            () if self.subgroup(one) == self.subgroup(other) => Level::Subgroup,
            () => Level::Workgroup,
        }
    }

    /// How far a scope reaches; one that is not known, as far as there are invocations. In ray
    /// tracing, where subgroups change and workgroups are none, scopes are wide.
    pub(super) fn level(self, scope: Option<Scope>) -> Level {
        match scope {
            Some(Scope::Invocation | Scope::ShaderCallKHR) => Level::Own,
            Some(Scope::Subgroup) if self.is_compute => Level::Subgroup,
            Some(Scope::Workgroup) if self.is_compute => Level::Workgroup,
            _ => Level::Wide,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invocations_share_a_subgroup_a_workgroup_or_the_dispatch() {
        let topology = Topology { is_compute: true, group_size: 6, subgroup_size: 4 };
        let common = |one, other| topology.common(one, other);
        assert_eq!(common(7, 7), Level::Own);
        assert_eq!(
            [common(6, 9), common(6, 10), common(5, 6)],
            [Level::Subgroup, Level::Workgroup, Level::Wide]
        );
        assert_ne!(topology.subgroup(5), topology.subgroup(6));
        let launch = Topology { is_compute: false, group_size: 1, subgroup_size: 1 };
        assert_eq!([launch.common(3, 3), launch.common(3, 4)], [Level::Own, Level::Wide]);
        assert_eq!(launch.level(Some(Scope::Workgroup)), Level::Wide);
        assert_eq!(topology.level(Some(Scope::Workgroup)), Level::Workgroup);
        assert_eq!(topology.level(Some(Scope::QueueFamily)), Level::Wide);
    }
}
