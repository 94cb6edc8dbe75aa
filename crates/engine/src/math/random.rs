//! Seeded random numbers that are the same on every machine.

/// SplitMix64 (Steele, Lea, Flood: "Fast Splittable Pseudorandom Number Generators", 2014).
///
/// Any seed is good, and 64 bits of state suffice for generated geometry.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// The generator for a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// The generator for a seed and further numbers, each of which makes it another one.
    pub fn of(seed: u64, numbers: impl IntoIterator<Item = u64>) -> Self {
        Self(numbers.into_iter().fold(seed, |sum, number| Self(sum).bits() ^ number))
    }

    /// Uniform in `0..count`, but for less than `count` in 2^64; 0 where that is 0.
    pub fn below(&mut self, count: u64) -> u64 {
        ((u128::from(self.bits()) * u128::from(count)) >> 64) as u64
    }

    /// Puts elements in an order that is drawn, all orders being as likely.
    pub fn shuffle<T>(&mut self, elements: &mut [T]) {
        for last in (1..elements.len()).rev() {
            elements.swap(last, self.below(last as u64 + 1) as usize);
        }
    }

    /// Uniform over the multiples of 2^-24 in [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in [low, high]; `low` itself where they are equal.
    pub fn within(&mut self, [low, high]: [f32; 2]) -> f32 {
        (low + (high - low) * self.unit()).clamp(low, high)
    }

    /// A point on the unit circle, uniform in its angle.
    pub fn direction(&mut self) -> [f32; 2] {
        let half_turns = 2.0 * self.unit();
        [pxfm::f_cospif(half_turns), pxfm::f_sinpif(half_turns)]
    }

    /// A point on the unit sphere, uniform in its area (Archimedes' hat box).
    pub fn sphere(&mut self) -> [f32; 3] {
        let y = 2.0 * self.unit() - 1.0;
        let ring = (1.0 - y * y).max(0.0).sqrt();
        let [x, z] = self.direction();
        [ring * x, y, ring * z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first outputs for seed 1234567 as published with the reference implementation
    /// (Vigna's `splitmix64.c`, listed at Rosetta Code, "Pseudo-random numbers/Splitmix64").
    #[test]
    fn the_sequence_is_splitmix64() {
        let mut random = Random::new(1_234_567);
        let wanted = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        assert_eq!(wanted.map(|_| random.bits()), wanted);
    }

    #[test]
    fn numbers_stay_in_range_and_average_to_the_middle() {
        let mut random = Random::new(1);
        let mut sum = 0.0;
        for _ in 0..10_000 {
            let x = random.within([2.0, 4.0]);
            assert!((2.0..=4.0).contains(&x));
            sum += f64::from(x);
        }
        // The mean of 10,000 has a standard deviation of 2 / sqrt(12) / 100 = 0.0058.
        assert!((sum / 10_000.0 - 3.0).abs() < 0.03);
        assert_eq!(random.within([5.0, 5.0]), 5.0);
    }

    #[test]
    fn a_shuffle_reaches_every_order() {
        let mut seen = std::collections::BTreeSet::new();
        for seed in 0..200 {
            let mut numbers = [0, 1, 2, 3];
            Random::of(seed, [7, 0]).shuffle(&mut numbers);
            seen.insert(numbers);
        }
        assert_eq!(seen.len(), 24);
        assert_eq!(Random::new(3).below(0), 0);
        assert!((0..100).all(|seed| Random::new(seed).below(3) < 3));
    }

    #[test]
    fn directions_have_length_one() {
        let mut random = Random::new(7);
        for _ in 0..1000 {
            let [x, y, z] = random.sphere();
            assert!((x * x + y * y + z * z - 1.0).abs() < 1e-6);
        }
    }
}
