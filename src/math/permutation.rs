//! Permutations of numbers that are drawn from a seed, without a table.

use crate::math::random::Random;

/// The rounds of the Feistel network: enough that neighbours go apart.
const ROUNDS: usize = 4;

/// A permutation of `0..count` that moves whole units of consecutive numbers; an incomplete unit at
/// the end stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Permutation {
    unit: u64,
    units: u64,
    /// The number of bits of each half of a unit's number.
    half: u32,
    keys: [u64; ROUNDS],
}

impl Permutation {
    /// Draws a permutation of `0..count` in units of so many numbers.
    pub fn draw(count: u64, unit: u64, random: &mut Random) -> Self {
        let units = count / unit;
        let bits = u64::BITS - units.saturating_sub(1).leading_zeros();
        Self { unit, units, half: bits.div_ceil(2), keys: std::array::from_fn(|_| random.bits()) }
    }

    /// The number at a position.
    pub fn at(&self, position: u64) -> u64 {
        let (unit, within) = (position / self.unit, position % self.unit);
        if unit >= self.units {
            return position;
        }
        // The network permutes a power of two of numbers. Those beyond the last unit are walked
        // over.
        let mut moved = self.mixed(unit);
        while moved >= self.units {
            moved = self.mixed(moved);
        }
        moved * self.unit + within
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
    fn seeds_give_different_orders() {
        let order = |seed| {
            let permutation = Permutation::draw(5, 1, &mut Random::new(seed));
            (0..5).map(|position| permutation.at(position)).collect::<Vec<_>>()
        };
        let orders: std::collections::BTreeSet<Vec<u64>> = (0..2000).map(order).collect();
        assert!(orders.len() > 110, "{} of 120 orders", orders.len());
    }
}
