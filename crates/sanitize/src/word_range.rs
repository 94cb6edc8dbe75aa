//! Ranges of words, in which all lanes of a register are looked for at once.

use anyhit_engine::machine::Lanes;

/// A range of words of 32 bits, or of their magnitudes as floats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WordRange {
    /// The bits that count.
    mask: u32,
    first: u32,
    /// How many words follow the first, around the end where they come there.
    more: u32,
}

/// All bits of a float but its sign.
const MAGNITUDE: u32 = 0x7FFF_FFFF;
/// The bits of infinity.
const INFINITY: u32 = 0x7F80_0000;

impl WordRange {
    /// The integer 0.
    pub const ZERO: Self = Self { mask: u32::MAX, first: 0, more: 0 };
    /// The least signed integer.
    pub const LEAST: Self = Self { mask: u32::MAX, first: 1 << 31, more: 0 };
    /// Negative integers, and floats with a sign.
    pub const NEGATIVE: Self = Self { mask: u32::MAX, first: 1 << 31, more: MAGNITUDE };
    /// 0, and what is negative.
    pub const NOT_POSITIVE: Self = Self { mask: u32::MAX, first: 1 << 31, more: 1 << 31 };
    /// The floats 0 and -0.
    pub const FLOAT_ZERO: Self = Self { mask: MAGNITUDE, first: 0, more: 0 };
    /// Subnormal floats.
    pub const SUBNORMAL: Self = Self { mask: MAGNITUDE, first: 1, more: 0x007F_FFFE };
    /// Zeros and subnormal floats.
    pub const FLUSHED: Self = Self { mask: MAGNITUDE, first: 0, more: 0x007F_FFFF };
    /// Floats that are NaN.
    pub const NAN: Self = Self { mask: MAGNITUDE, first: INFINITY + 1, more: MAGNITUDE - INFINITY - 1 };
    /// Floats that are NaN or infinite.
    pub const SPECIAL: Self = Self { mask: MAGNITUDE, first: INFINITY, more: MAGNITUDE - INFINITY };

    /// Unsigned integers from one on.
    pub const fn from(first: u32) -> Self {
        Self { mask: u32::MAX, first, more: u32::MAX - first }
    }

    /// Floats whose magnitude is at least that of a positive number, and NaN.
    pub const fn magnitude_from(least: f32) -> Self {
        let first = least.to_bits();
        Self { mask: MAGNITUDE, first, more: MAGNITUDE - first }
    }

    /// Floats whose magnitude is at least a power of two, and NaN.
    pub const fn power_from(exponent: u32) -> Self {
        let first = (exponent + 127) << 23;
        Self { mask: MAGNITUDE, first, more: MAGNITUDE - first }
    }

    /// Floats, but for those between two positive numbers.
    pub const fn outside(low: f32, high: f32) -> Self {
        let first = high.to_bits();
        Self { mask: u32::MAX, first, more: low.to_bits().wrapping_sub(first) }
    }

    /// Whether a word is in it.
    #[inline(always)]
    pub const fn contains(self, word: u32) -> bool {
        (word & self.mask).wrapping_sub(self.first) <= self.more
    }

    /// Whether the word of some lane is in it: a loop without branches.
    #[inline]
    pub fn meets<const W: usize>(self, words: &Lanes<W>) -> bool {
        words.0.iter().fold(0, |any, &word| any | u32::from(self.contains(word))) != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_what_their_names_say() {
        let of = |range: WordRange, floats: &[f32]| -> Vec<bool> {
            floats.iter().map(|float| range.contains(float.to_bits())).collect()
        };
        let floats = [0.0, -0.0, 1e-40, f32::MIN_POSITIVE, -2.0, f32::NEG_INFINITY, -f32::NAN];
        let (no, yes) = (false, true);
        assert_eq!(of(WordRange::FLOAT_ZERO, &floats), [yes, yes, no, no, no, no, no]);
        assert_eq!(of(WordRange::SUBNORMAL, &floats), [no, no, yes, no, no, no, no]);
        assert_eq!(of(WordRange::FLUSHED, &floats), [yes, yes, yes, no, no, no, no]);
        assert_eq!(of(WordRange::NOT_POSITIVE, &floats), [yes, yes, no, no, yes, yes, yes]);
        assert_eq!(of(WordRange::NAN, &floats), [no, no, no, no, no, no, yes]);
        assert_eq!(of(WordRange::SPECIAL, &floats), [no, no, no, no, no, yes, yes]);
        assert_eq!(of(WordRange::magnitude_from(2.0), &floats), [no, no, no, no, yes, yes, yes]);
        assert_eq!(of(WordRange::power_from(1), &floats), of(WordRange::magnitude_from(2.0), &floats));
        assert_eq!(of(WordRange::outside(0.5, 2.0), &[0.0, 0.5, 1.0, 2.0, -1.0]), [yes, yes, no, yes, yes]);
        assert_eq!([31, 32, u32::MAX].map(|word| WordRange::from(32).contains(word)), [no, yes, yes]);
        assert_eq!([0, 1, 1 << 31].map(|word| WordRange::ZERO.contains(word)), [yes, no, no]);
        assert_eq!([0, 1, 1 << 31].map(|word| WordRange::LEAST.contains(word)), [no, no, yes]);
        assert_eq!([0, u32::MAX].map(|word| WordRange::NEGATIVE.contains(word)), [no, yes]);
        assert!(WordRange::ZERO.meets(&Lanes([3, 2, 1, 0])) && !WordRange::ZERO.meets(&Lanes([3, 2, 1])));
    }
}
