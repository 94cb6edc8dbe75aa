//! The sets of made-up values that an entry point runs on, in order.

use crate::smoke::fill::{Floats, Integers, ValueSource};

/// What a shader is tried on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Set {
    /// Whether it is a launch of one invocation, or a dispatch of one workgroup.
    pub is_single: bool,
    /// What memory holds.
    pub numbers: ValueSource,
    /// Whether geometry is hit from behind.
    pub behind: bool,
    /// Whether what is hit, called or missed is not the first of everything: `numbers` say which.
    pub varies_hits: bool,
    /// Which of the specialized programs runs; 0 has the defaults.
    pub specialization: usize,
}

/// Those that are tried first: whether of one invocation, what is added to the seed, what numbers
/// are, whether geometry is hit from behind.
const FIXED: [(bool, u64, Integers, Floats, bool); 11] = [
    (false, 0, Integers::Small, Floats::Unit, false),
    (false, 1, Integers::Small, Floats::Unit, true),
    (false, 2, Integers::Mixed, Floats::Signed, false),
    (false, 0, Integers::All(0), Floats::Unit, false),
    (false, 0, Integers::Small, Floats::Zero, false),
    (false, 0, Integers::Small, Floats::One, true),
    (false, 0, Integers::All(1000), Floats::Unit, false),
    (true, 0, Integers::Small, Floats::Unit, false),
    (true, 0, Integers::All(0), Floats::Unit, false),
    (true, 0, Integers::All(1), Floats::Unit, false),
    (true, 0, Integers::All(0), Floats::Zero, false),
];

impl Set {
    /// How many are tried before only new seeds follow, given how many specialized programs there
    /// are beside the first.
    pub(super) fn fixed(specialized: usize) -> usize {
        FIXED.len() + specialized
    }

    /// The one at a place of the order: always the same for a seed.
    pub(super) fn nth(at: usize, seed: u64, specialized: usize) -> Self {
        let (numbers, specialization, varies_hits) = match at.checked_sub(FIXED.len()) {
            None => (FIXED[at], 0, at > 0),
            Some(other) if other < specialized => (FIXED[0], other + 1, false),
            Some(other) => {
                let fresh = other - specialized;
                let integers = if fresh.is_multiple_of(2) { Integers::Small } else { Integers::Mixed };
                let floats = if (fresh / 2).is_multiple_of(2) { Floats::Unit } else { Floats::Signed };
                let numbers = (fresh % 3 == 2, 3 + fresh as u64, integers, floats, fresh.is_multiple_of(2));
                (numbers, fresh % (specialized + 1), true)
            }
        };
        let (is_single, next, integers, floats, behind) = numbers;
        Self {
            is_single,
            numbers: ValueSource { seed: seed.wrapping_add(next), integers, floats },
            behind,
            varies_hits,
            specialization,
        }
    }

    /// Whether nothing of it is an exception: not numbers that are all the same or far apart, and
    /// specialization constants have their defaults.
    pub(super) fn is_plain(&self) -> bool {
        let ValueSource { integers, floats, .. } = self.numbers;
        integers == Integers::Small && floats == Floats::Unit && self.specialization == 0
    }

    /// Whether floats differ, as those of a ray do.
    pub(super) fn has_different_floats(&self) -> bool {
        matches!(self.numbers.floats, Floats::Unit | Floats::Signed)
    }

    /// In words, without its specialization.
    pub(super) fn words(&self) -> String {
        let ValueSource { seed, integers, floats } = self.numbers;
        let integers = match integers {
            Integers::Small => String::new(),
            Integers::Mixed => ", some integers 0 or 1000".to_owned(),
            Integers::All(value) => format!(", all integers {value}"),
        };
        let floats = match floats {
            Floats::Unit => "",
            Floats::Signed => ", floats from -4 to 4",
            Floats::Zero => ", all floats 0",
            Floats::One => ", all floats 1",
        };
        let launch = if self.is_single { ", a launch of one invocation" } else { "" };
        format!("seed {seed}{integers}{floats}{launch}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_specialization_is_tried_before_new_seeds_and_with_them() {
        assert!(Set::nth(0, 7, 2).is_plain());
        let order: Vec<_> = (Set::fixed(0)..Set::fixed(2) + 3).map(|at| Set::nth(at, 7, 2)).collect();
        assert_eq!(order.iter().map(|set| set.specialization).collect::<Vec<_>>(), [1, 2, 0, 1, 2]);
        assert_eq!(order.iter().map(|set| set.numbers.seed).collect::<Vec<_>>(), [7, 7, 10, 11, 12]);
    }
}
