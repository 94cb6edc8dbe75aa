//! Kinds of memory that barriers tell apart, by the storage classes of their semantics.

use rspirv::spirv::MemorySemantics;

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
    pub(super) const NONE: Self = Self(0);
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

    /// Those of both sets.
    pub(super) fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Whether a class is one of them.
    pub(super) fn contains(self, class: Class) -> bool {
        self.0 >> class as u8 & 1 == 1
    }

    /// Whether a class is the only one.
    pub(super) fn is_alone(self, class: Class) -> bool {
        self.0 == 1 << class as u8
    }

    /// The numbers of its classes.
    pub(super) fn each(self) -> impl Iterator<Item = usize> {
        (0..3).filter(move |class| self.0 >> class & 1 == 1)
    }
}

/// What instructions order: among invocations of one workgroup, and beyond.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Reach {
    /// By those of any scope.
    near: Classes,
    /// By those of a scope that is wider than a workgroup.
    wide: Classes,
}

impl Reach {
    /// What one instruction orders.
    pub(super) fn of(classes: Classes, is_wide: bool) -> Self {
        Self { near: classes, wide: if is_wide { classes } else { Classes::NONE } }
    }

    pub(super) fn with(self, other: Self) -> Self {
        Self { near: self.near.with(other.near), wide: self.wide.with(other.wide) }
    }

    /// What is ordered between invocations of one workgroup, or of different ones.
    pub(super) fn across(self, is_wide: bool) -> Classes {
        if is_wide { self.wide } else { self.near }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
