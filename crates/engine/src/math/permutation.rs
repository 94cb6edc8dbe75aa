//! Permutations of numbers that are drawn from a seed, without a table.

use std::sync::Arc;

use crate::math::array;
use crate::math::random::Random;

/// The rounds of the Feistel network: enough that neighbours go apart.
const ROUNDS: usize = 4;

/// A permutation of `0..count` that moves whole units of consecutive numbers; an incomplete unit at
/// the end stays.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Permutation {
    unit: u64,
    units: u64,
    /// The number of bits of each half of a unit's number.
    half: u32,
    keys: [u64; ROUNDS],
    /// The units by their positions, where only a part of the permutation is kept.
    listed: Option<Arc<[u64]>>,
}

/// How much of a permutation is kept. The first units stand where the permutation has them, and the
/// next one moves towards its position there; all others stand in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OrderLimit {
    /// How many units stand where the permutation has them.
    pub prefix: u64,
    /// Over how many units the next one moves; more than there are means all.
    pub jump: u64,
}

impl OrderLimit {
    /// The order in which nothing is moved.
    pub const NONE: Self = Self { prefix: 0, jump: 0 };
}

impl Permutation {
    /// Draws a permutation of `0..count` in units of so many numbers.
    pub fn draw(count: u64, unit: u64, random: &mut Random) -> Self {
        let units = count / unit;
        let bits = u64::BITS - units.saturating_sub(1).leading_zeros();
        let keys = array::from_fn(|_| random.bits());
        Self { unit, units, half: bits.div_ceil(2), keys, listed: None }
    }

    /// A part of the permutation, and the two units whose order distinguishes it from the part with
    /// a jump that is shorter by 1, the one that comes first in it before the other.
    pub fn limited(self, limit: OrderLimit) -> (Self, Option<[u64; 2]>) {
        let prefix = limit.prefix.min(self.units);
        let mut order: Vec<u64> = (0..prefix).map(|at| self.permuted(at)).collect();
        let mut is_placed = vec![false; self.units as usize];
        order.iter().for_each(|&unit| is_placed[unit as usize] = true);
        let rest = (0..self.units).filter(|&unit| !is_placed[unit as usize]);
        order.extend(rest);
        let mut pair = None;
        if prefix < self.units {
            let next = self.permuted(prefix);
            let from = order.iter().skip(prefix as usize).take_while(|&&unit| unit != next).count() as u64;
            let jump = limit.jump.min(from);
            let (from, to) = (prefix + from, prefix + from - jump);
            pair = (jump > 0).then(|| [next, order[to as usize]]);
            order[to as usize..=from as usize].rotate_right(1);
        }
        (Self { listed: Some(order.into()), ..self }, pair)
    }

    /// How many numbers a unit has.
    pub fn unit(&self) -> u64 {
        self.unit
    }

    /// The number at a position.
    pub fn at(&self, position: u64) -> u64 {
        let (unit, within) = (position / self.unit, position % self.unit);
        if unit >= self.units {
            return position;
        }
        let moved = match &self.listed {
            Some(listed) => listed[unit as usize],
            None => self.permuted(unit),
        };
        moved * self.unit + within
    }

    /// The unit at a position of the whole permutation.
    fn permuted(&self, unit: u64) -> u64 {
        // The network permutes a power of two of numbers. Those beyond the last unit are walked
        // over.
        let mut moved = self.mixed(unit);
        while moved >= self.units {
            moved = self.mixed(moved);
        }
        moved
    }

    /// A permutation of all numbers of twice `half` bits: a Feistel network.
    fn mixed(&self, number: u64) -> u64 {
        let mask = (1 << self.half) - 1;
        let (mut high, mut low) = (number >> self.half, number & mask);
        for key in self.keys {
            (high, low) = (low, high ^ (Random::new(low ^ key).bits() & mask));
        }
        high << self.half | low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_one_position() {
        for (count, unit) in [(0, 1), (1, 1), (2, 1), (7, 1), (64, 1), (1000, 1), (70, 32), (64, 4), (3, 8)] {
            let permutation = Permutation::draw(count, unit, &mut Random::new(5));
            let mut numbers: Vec<u64> = (0..count).map(|position| permutation.at(position)).collect();
            for chunk in numbers.chunks(unit as usize) {
                assert!(chunk.iter().zip(chunk[0]..).all(|(&one, next)| one == next), "{count} {unit}");
            }
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(0..count), "{count} {unit}");
        }
    }

    #[test]
    fn a_part_of_a_permutation_moves_few_units() {
        let whole = Permutation::draw(6, 1, &mut Random::new(3));
        let numbers = |one: &Permutation| (0..6).map(|position| one.at(position)).collect::<Vec<_>>();
        let limited = |prefix, jump| whole.clone().limited(OrderLimit { prefix, jump });
        assert_eq!(numbers(&limited(0, 0).0), [0, 1, 2, 3, 4, 5]);
        assert_eq!(numbers(&limited(6, 0).0), numbers(&whole));
        for prefix in 0..6 {
            assert_eq!(numbers(&limited(prefix, u64::MAX).0), numbers(&limited(prefix + 1, 0).0));
            for jump in 1..6 {
                let ((longer, pair), shorter) = (limited(prefix, jump), limited(prefix, jump - 1).0);
                let (longer, mut shorter) = (numbers(&longer), numbers(&shorter));
                // The two differ in a pair of neighbours, or the jump is at its end.
                let Some(first) = (0..6).find(|&at| longer[at] != shorter[at]) else { continue };
                assert_eq!(pair, Some([longer[first], shorter[first]]));
                shorter.swap(first, first + 1);
                assert_eq!(longer, shorter);
            }
        }
    }

    #[test]
    fn seeds_give_different_orders() {
        let order = |seed| {
            let permutation = Permutation::draw(5, 1, &mut Random::new(seed));
            (0..5).map(|position| permutation.at(position)).collect::<Vec<_>>()
        };
        let orders: std::collections::BTreeSet<Vec<u64>> = (0..2000).map(order).collect();
        assert!(orders.len() > 110, "{} of 120 orders", orders.len());
    }
}
