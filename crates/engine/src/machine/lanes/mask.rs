//! Sets of lanes.

use std::ops::{BitAnd, BitOr, Not};

use crate::machine::lanes::Lanes;
use crate::math::array;

/// A set of lanes; W is at most 128. The upper half is used for W above 64 only, so that it costs
/// nothing otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mask<const W: usize> {
    low: u64,
    high: u64,
}

/// The lowest `count` bits of a word.
const fn ones(count: usize) -> u64 {
    if count >= 64 { u64::MAX } else { (1 << count) - 1 }
}

impl<const W: usize> Mask<W> {
    /// No lane.
    pub const NONE: Self = Self { low: 0, high: 0 };
    /// Every lane.
    pub const ALL: Self = Self { low: ones(W), high: ones(W.saturating_sub(64)) };
    /// Whether the upper half is used.
    const WIDE: bool = W > 64;

    /// The first `count` lanes.
    pub fn first(count: usize) -> Self {
        let count = if count > W { W } else { count };
        Self { low: ones(count), high: ones(count.saturating_sub(64)) }
    }

    /// One lane alone.
    #[inline]
    pub fn lane(lane: usize) -> Self {
        if Self::WIDE && lane >= 64 {
            return Self { low: 0, high: 1 << (lane - 64) };
        }
        Self { low: 1 << lane, high: 0 }
    }

    /// The lanes whose word is not zero.
    #[inline]
    pub fn of(words: &Lanes<W>) -> Self {
        if !W.is_multiple_of(8) {
            return Self::from_fn(|lane| words.0[lane] != 0);
        }
        let mut mask = Self::NONE;
        for (at, eight) in words.0.chunks_exact(8).enumerate() {
            // A byte each of 0 or 1; the product brings byte k to bit 56 + k.
            let bytes: [u8; 8] = array::from_fn(|lane| u8::from(eight[lane] != 0));
            let bits = u64::from_le_bytes(bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56;
            let half = if at < 8 { &mut mask.low } else { &mut mask.high };
            *half |= bits << (at % 8 * 8);
        }
        mask
    }

    /// The lanes whose word is a given one.
    #[inline]
    pub fn equal(words: &Lanes<W>, word: u32) -> Self {
        let mut equal = Lanes::splat(0);
        for lane in 0..W {
            equal.0[lane] = u32::from(words.0[lane] == word);
        }
        Self::of(&equal)
    }

    /// The lanes for which a condition holds.
    #[inline]
    pub fn from_fn(mut condition: impl FnMut(usize) -> bool) -> Self {
        let mut mask = Self::NONE;
        for lane in 0..W.min(64) {
            mask.low |= u64::from(condition(lane)) << lane;
        }
        for lane in 64..W {
            mask.high |= u64::from(condition(lane)) << (lane - 64);
        }
        mask
    }

    /// Whether no lane is in it.
    #[inline]
    pub fn is_empty(self) -> bool {
        self.low == 0 && (!Self::WIDE || self.high == 0)
    }

    /// Whether every lane is in it.
    #[inline]
    pub fn is_all(self) -> bool {
        self.low == Self::ALL.low && (!Self::WIDE || self.high == Self::ALL.high)
    }

    /// Whether a lane is in it.
    #[inline]
    pub fn contains(self, lane: usize) -> bool {
        if Self::WIDE && lane >= 64 {
            return self.high >> (lane - 64) & 1 != 0;
        }
        self.low >> lane & 1 != 0
    }

    /// Whether a lane is in the mask, in a form with which loops over all lanes are vectorised: a
    /// comparison of 32 bits with a constant of each lane.
    #[inline(always)]
    pub(super) fn selects(self, lane: usize) -> bool {
        let half = if Self::WIDE && lane >= 64 { self.high } else { self.low };
        let word = (half >> (lane % 64 / 32 * 32)) as u32;
        word & 1 << (lane % 32) != 0
    }

    /// All ones for each lane that is in it.
    #[inline(always)]
    pub fn words(self) -> Lanes<W> {
        let mut words = Lanes::splat(0);
        for lane in 0..W {
            words.0[lane] = if self.selects(lane) { u32::MAX } else { 0 };
        }
        words
    }

    /// How many lanes are in it.
    pub fn count(self) -> u32 {
        self.low.count_ones() + self.high.count_ones()
    }

    /// The lanes of this set that are not in another.
    #[inline]
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self { low: self.low & !other.low, high: if Self::WIDE { self.high & !other.high } else { 0 } }
    }

    /// Whether all lanes of another set are in it.
    #[inline]
    pub fn covers(self, other: Self) -> bool {
        other.without(self).is_empty()
    }

    /// The lowest lane, where there is one.
    pub fn lowest(self) -> Option<usize> {
        self.lanes().next()
    }

    /// One more than the highest lane; 0 where there is none.
    #[inline]
    pub fn end(self) -> usize {
        match self.high {
            high if Self::WIDE && high != 0 => 128 - high.leading_zeros() as usize,
            _ => 64 - self.low.leading_zeros() as usize,
        }
    }

    /// The lanes in ascending order.
    #[inline]
    pub fn lanes(self) -> impl Iterator<Item = usize> {
        let (mut low, mut high) = (self.low, self.high);
        std::iter::from_fn(move || {
            if low != 0 {
                let lane = low.trailing_zeros() as usize;
                low &= low - 1;
                return Some(lane);
            }
            if !Self::WIDE || high == 0 {
                return None;
            }
            let lane = 64 + high.trailing_zeros() as usize;
            high &= high - 1;
            Some(lane)
        })
    }
}

impl<const W: usize> BitAnd for Mask<W> {
    type Output = Self;
    #[inline]
    fn bitand(self, other: Self) -> Self {
        Self { low: self.low & other.low, high: if Self::WIDE { self.high & other.high } else { 0 } }
    }
}

impl<const W: usize> BitOr for Mask<W> {
    type Output = Self;
    #[inline]
    fn bitor(self, other: Self) -> Self {
        Self { low: self.low | other.low, high: if Self::WIDE { self.high | other.high } else { 0 } }
    }
}

impl<const W: usize> Not for Mask<W> {
    type Output = Self;
    #[inline]
    fn not(self) -> Self {
        Self::ALL.without(self)
    }
}

/// Computes the mask of a register of booleans, eight lanes at a time.
#[cfg(target_arch = "x86_64")]
pub(super) struct BooleanMask<'a, const W: usize> {
    /// The processor's instructions.
    pub simd: pulp::x86::V3,
    /// The register, each lane 0 or 1.
    pub register: &'a Lanes<W>,
}

#[cfg(target_arch = "x86_64")]
impl<const W: usize> pulp::NullaryFnOnce for BooleanMask<'_, W> {
    type Output = Mask<W>;

    #[inline(always)]
    fn call(self) -> Mask<W> {
        let mut mask = Mask::NONE;
        for (at, eight) in self.register.0.as_chunks::<8>().0.iter().enumerate() {
            // A boolean is 0 or 1: that bit becomes the sign.
            let signs = self.simd.avx2._mm256_slli_epi32::<31>(pulp::cast(*eight));
            let bits = self.simd.avx._mm256_movemask_ps(pulp::cast(signs)) as u32;
            let half = if at < 8 { &mut mask.low } else { &mut mask.high };
            *half |= u64::from(bits) << (at % 8 * 8);
        }
        mask
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_of_every_width() {
        assert_eq!(Mask::<1>::ALL.count(), 1);
        assert_eq!(Mask::<32>::ALL.count(), 32);
        assert_eq!(Mask::<64>::ALL.count(), 64);
        assert_eq!(Mask::<32>::first(5).lanes().collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        assert_eq!((!Mask::<8>::first(6)).lanes().collect::<Vec<_>>(), [6, 7]);
        assert_eq!(Mask::<8>::NONE.lowest(), None);
        let wide = Mask::<128>::from_fn(|lane| lane % 63 == 0);
        assert_eq!(wide.lanes().collect::<Vec<_>>(), [0, 63, 126]);
        assert_eq!(
            (wide.count(), wide.lowest(), wide.contains(126), wide.contains(62)),
            (3, Some(0), true, false)
        );
        assert_eq!((!wide).count(), 125);
        assert_eq!((wide.end(), Mask::<128>::first(64).end(), Mask::<8>::NONE.end()), (127, 64, 0));
        assert_eq!((wide & Mask::lane(126)) | Mask::lane(64), wide.without(Mask::first(64)) | Mask::lane(64));
        assert!(Mask::<128>::first(128).is_all() && Mask::<128>::ALL.without(Mask::first(128)).is_empty());
        assert!(!Mask::<128>::first(127).is_all() && !Mask::<128>::lane(127).is_empty());
    }
}
