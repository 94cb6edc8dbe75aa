//! Lanes and masks: the only loops over the invocations of a batch that compute values.

use std::ops::{BitAnd, BitOr, Index, IndexMut, Not};

use aligned_vec::{AVec, ConstAlign};
use half::f16;

use crate::math::vectors::Processor;

/// A row of the register file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Reg(pub u32);

impl Reg {
    /// The row `words` further on.
    #[inline]
    #[must_use]
    pub fn plus(self, words: u32) -> Self {
        Self(self.0 + words)
    }
}

/// One 32-bit word for each of W lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Lanes<const W: usize>(pub [u32; W]);

impl<const W: usize> Lanes<W> {
    /// The same word in every lane.
    pub fn splat(word: u32) -> Self {
        Self([word; W])
    }
}

/// A set of lanes; W is at most 128. The upper half is looked at for W above 64 only, so that it
/// costs nothing where it is not needed.
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
    /// Whether the upper half counts.
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
            let bytes: [u8; 8] = std::array::from_fn(|lane| u8::from(eight[lane] != 0));
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

    /// The same, in a form that loops over all lanes are vectorised with: a comparison of 32 bits with
    /// a constant of each lane.
    #[inline(always)]
    fn selects(self, lane: usize) -> bool {
        let half = if Self::WIDE && lane >= 64 { self.high } else { self.low };
        let word = (half >> (lane % 64 / 32 * 32)) as u32;
        word & 1 << (lane % 32) != 0
    }

    /// All ones for each lane that is in it.
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

/// The register file of a batch. It begins with a line of the processor's caches, so that no vector of a row of 64 lanes
/// lies on two of them: those take twice as long to read.
#[derive(Clone, Debug)]
pub struct Registers<const W: usize> {
    rows: AVec<Lanes<W>, ConstAlign<CACHE_LINE>>,
    processor: Processor,
}

/// Bytes of a line of the processor's caches, and of its widest vectors.
const CACHE_LINE: usize = 64;

impl<const W: usize> Registers<W> {
    /// A file of rows that are all zero.
    pub fn new(rows: usize) -> Self {
        let mut zeros = AVec::with_capacity(CACHE_LINE, rows);
        zeros.resize(rows, Lanes::splat(0));
        Self { rows: zeros, processor: Processor::new() }
    }

    /// What the processor has.
    #[inline]
    pub fn processor(&self) -> Processor {
        self.processor
    }

    /// The same for a processor that has less.
    #[cfg(test)]
    pub fn on(self, processor: Processor) -> Self {
        Self { processor, ..self }
    }

    /// The lanes for which a row of booleans holds.
    #[inline]
    pub fn mask(&self, condition: Reg) -> Mask<W> {
        let row = &self[condition];
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.processor.avx2().filter(|_| W.is_multiple_of(8)) {
            return simd.vectorize(SignsOf { simd, row });
        }
        Mask::of(row)
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// All rows.
    pub fn all_mut(&mut self) -> &mut [Lanes<W>] {
        &mut self.rows
    }

    /// A stretch of rows.
    pub fn rows_mut(&mut self, first: Reg, count: u32) -> &mut [Lanes<W>] {
        &mut self.rows[first.0 as usize..(first.0 + count) as usize]
    }

    /// The words of one lane in a stretch of rows.
    #[inline]
    pub fn lane_words(&self, first: Reg, count: u32, lane: usize) -> LaneWords<'_, W> {
        LaneWords { rows: self.rows[first.0 as usize..(first.0 + count) as usize].iter(), lane }
    }

    /// Sets the words of one lane in consecutive rows.
    #[inline]
    pub fn set_lane_words(&mut self, first: Reg, lane: usize, words: impl IntoIterator<Item = u32>) {
        for (row, word) in self.rows[first.0 as usize..].iter_mut().zip(words) {
            row.0[lane] = word;
        }
    }

    /// Sets a word of the lanes of a mask.
    #[inline]
    pub fn set(&mut self, to: Reg, word: u32, mask: Mask<W>) {
        let row = &mut self[to];
        if mask.is_all() {
            row.0 = [word; W];
            return;
        }
        for lane in 0..W {
            row.0[lane] = if mask.selects(lane) { word } else { row.0[lane] };
        }
    }

    /// Copies consecutive rows of other registers, for the lanes of a mask.
    pub fn copy_rows(&mut self, to: Reg, from: &Self, first: Reg, count: u32, mask: Mask<W>) {
        let sources = &from.rows[first.0 as usize..(first.0 + count) as usize];
        let rows = self.rows_mut(to, count);
        if mask.is_all() {
            rows.copy_from_slice(sources);
            return;
        }
        let words = mask.words();
        for (row, source) in rows.iter_mut().zip(sources) {
            for lane in 0..W {
                let taken = words.0[lane];
                row.0[lane] = source.0[lane] & taken | row.0[lane] & !taken;
            }
        }
    }

    /// Copies a row into another, for the lanes of a mask.
    #[inline(always)]
    pub fn copy(&mut self, to: Reg, from: Reg, mask: Mask<W>) {
        let place = from.0 as usize;
        if mask.is_all() {
            // Straight through registers.
            self.rows.copy_within(place..place + 1, to.0 as usize);
            return;
        }
        let source = self[from];
        let row = &mut self[to];
        for lane in 0..W {
            row.0[lane] = if mask.selects(lane) { source.0[lane] } else { row.0[lane] };
        }
    }
}

/// The words of one lane in a stretch of rows.
#[derive(Clone, Debug)]
pub struct LaneWords<'a, const W: usize> {
    rows: std::slice::Iter<'a, Lanes<W>>,
    lane: usize,
}

impl<const W: usize> Iterator for LaneWords<'_, W> {
    type Item = u32;

    #[inline]
    fn next(&mut self) -> Option<u32> {
        self.rows.next().map(|row| row.0[self.lane])
    }

    #[inline]
    fn size_hint(&self) -> (usize, Option<usize>) {
        self.rows.size_hint()
    }
}

impl<const W: usize> ExactSizeIterator for LaneWords<'_, W> {}

/// A row of booleans whose mask is made of eight lanes at a time.
#[cfg(target_arch = "x86_64")]
struct SignsOf<'a, const W: usize> {
    simd: pulp::x86::V3,
    row: &'a Lanes<W>,
}

#[cfg(target_arch = "x86_64")]
impl<const W: usize> pulp::NullaryFnOnce for SignsOf<'_, W> {
    type Output = Mask<W>;

    #[inline(always)]
    fn call(self) -> Mask<W> {
        let mut mask = Mask::NONE;
        for (at, eight) in self.row.0.as_chunks::<8>().0.iter().enumerate() {
            // A boolean is 0 or 1: that bit becomes the sign.
            let signs = self.simd.avx2._mm256_slli_epi32::<31>(pulp::cast(*eight));
            let bits = self.simd.avx._mm256_movemask_ps(pulp::cast(signs)) as u32;
            let half = if at < 8 { &mut mask.low } else { &mut mask.high };
            *half |= u64::from(bits) << (at % 8 * 8);
        }
        mask
    }
}

impl<const W: usize> Index<Reg> for Registers<W> {
    type Output = Lanes<W>;
    #[inline]
    fn index(&self, reg: Reg) -> &Lanes<W> {
        &self.rows[reg.0 as usize]
    }
}

impl<const W: usize> IndexMut<Reg> for Registers<W> {
    #[inline]
    fn index_mut(&mut self, reg: Reg) -> &mut Lanes<W> {
        &mut self.rows[reg.0 as usize]
    }
}

/// A scalar as it lies in one or two rows.
///
/// Narrow values lie in the low bits, the rest is zero; a bool is 0 or 1; 64-bit values lie in two
/// rows, the low word first. What is calculated and no number is always written as one quiet NaN, positive and
/// without a payload: IEEE 754 leaves its bits open, and processors, and compilers that exchange operands,
/// make different ones.
pub trait Scalar: Copy {
    /// Rows taken: 1 or 2.
    const WORDS: u32;
    /// Reads it; `high` counts for two rows only.
    fn from_words(low: u32, high: u32) -> Self;
    /// Writes it, low word first.
    fn to_words(self) -> (u32, u32);
    /// Its low word; a NaN of 32 bits as it is.
    #[inline(always)]
    fn to_word(self) -> u32 {
        self.to_words().0
    }
}

impl Scalar for f32 {
    const WORDS: u32 = 1;
    #[inline(always)]
    fn from_words(low: u32, _high: u32) -> Self {
        Self::from_bits(low)
    }
    #[inline(always)]
    fn to_words(self) -> (u32, u32) {
        (if self.is_nan() { 0x7FC0_0000 } else { self.to_bits() }, 0)
    }
    #[inline(always)]
    fn to_word(self) -> u32 {
        self.to_bits()
    }
}

macro_rules! scalars {
    ($($ty:ty, $words:literal, |$low:ident, $high:ident| $from:expr, |$value:ident| $to:expr;)*) => {$(
        impl Scalar for $ty {
            const WORDS: u32 = $words;
            #[inline(always)]
            fn from_words($low: u32, $high: u32) -> Self {
                $from
            }
            #[inline(always)]
            fn to_words(self) -> (u32, u32) {
                let $value = self;
                $to
            }
        }
    )*};
}

scalars! {
    bool, 1, |low, _high| low != 0, |value| (u32::from(value), 0);
    u8, 1, |low, _high| low as u8, |value| (u32::from(value), 0);
    i8, 1, |low, _high| low as i8, |value| (u32::from(value as u8), 0);
    u16, 1, |low, _high| low as u16, |value| (u32::from(value), 0);
    i16, 1, |low, _high| low as i16, |value| (u32::from(value as u16), 0);
    f16, 1, |low, _high| f16::from_bits(low as u16),
        |value| (if value.is_nan() { 0x7E00 } else { value.to_bits().into() }, 0);
    u32, 1, |low, _high| low, |value| (value, 0);
    i32, 1, |low, _high| low as i32, |value| (value as u32, 0);
    u64, 2, |low, high| u64::from(low) | u64::from(high) << 32, |value| (value as u32, (value >> 32) as u32);
    i64, 2, |low, high| u64::from_words(low, high) as i64, |value| (value as u64).to_words();
    f64, 2, |low, high| f64::from_bits(u64::from_words(low, high)),
        |value| if value.is_nan() { (0, 0x7FF8_0000) } else { value.to_bits().to_words() };
}

/// Reads one operand's rows: the low words and, for two-row scalars, the high words.
#[inline(always)]
fn operand<const W: usize, A: Scalar>(registers: &Registers<W>, reg: Reg) -> (&Lanes<W>, &Lanes<W>) {
    let low = &registers[reg];
    (low, if A::WORDS == 2 { &registers[reg.plus(1)] } else { low })
}

#[inline(always)]
fn store<const W: usize, R: Scalar>(registers: &mut Registers<W>, to: Reg, low: [u32; W], high: [u32; W]) {
    registers[to].0 = low;
    if R::WORDS == 2 {
        registers[to.plus(1)].0 = high;
    }
}

/// Applies a scalar function of one operand to every lane.
#[inline(always)]
pub fn map1<const W: usize, A: Scalar, R: Scalar>(
    registers: &mut Registers<W>,
    to: Reg,
    from: &[Reg; 3],
    function: impl Fn(A) -> R,
) {
    let (mut low, mut high) = ([0; W], [0; W]);
    let (a0, a1) = operand::<W, A>(registers, from[0]);
    for lane in 0..W {
        (low[lane], high[lane]) = function(A::from_words(a0.0[lane], a1.0[lane])).to_words();
    }
    store::<W, R>(registers, to, low, high);
}

/// Applies a scalar function of two operands to every lane.
#[inline(always)]
pub fn map2<const W: usize, A: Scalar, B: Scalar, R: Scalar>(
    registers: &mut Registers<W>,
    to: Reg,
    from: &[Reg; 3],
    function: impl Fn(A, B) -> R,
) {
    let (mut low, mut high) = ([0; W], [0; W]);
    let (a0, a1) = operand::<W, A>(registers, from[0]);
    let (b0, b1) = operand::<W, B>(registers, from[1]);
    for lane in 0..W {
        let a = A::from_words(a0.0[lane], a1.0[lane]);
        let b = B::from_words(b0.0[lane], b1.0[lane]);
        (low[lane], high[lane]) = function(a, b).to_words();
    }
    store::<W, R>(registers, to, low, high);
}

/// Applies a scalar function of three operands to every lane.
#[inline(always)]
pub fn map3<const W: usize, A: Scalar, B: Scalar, C: Scalar, R: Scalar>(
    registers: &mut Registers<W>,
    to: Reg,
    from: &[Reg; 3],
    function: impl Fn(A, B, C) -> R,
) {
    let (mut low, mut high) = ([0; W], [0; W]);
    let (a0, a1) = operand::<W, A>(registers, from[0]);
    let (b0, b1) = operand::<W, B>(registers, from[1]);
    let (c0, c1) = operand::<W, C>(registers, from[2]);
    for lane in 0..W {
        let a = A::from_words(a0.0[lane], a1.0[lane]);
        let b = B::from_words(b0.0[lane], b1.0[lane]);
        let c = C::from_words(c0.0[lane], c1.0[lane]);
        (low[lane], high[lane]) = function(a, b, c).to_words();
    }
    store::<W, R>(registers, to, low, high);
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

    #[test]
    fn the_mask_of_a_condition() {
        let mut registers = Registers::<128>::new(1);
        registers[Reg(0)].0 = std::array::from_fn(|lane| u32::from(lane % 3 == 1 || lane > 120));
        assert_eq!(registers.mask(Reg(0)), Mask::from_fn(|lane| lane % 3 == 1 || lane > 120));
        assert_eq!(registers.mask(Reg(0)), Mask::of(&registers[Reg(0)]));
    }

    #[test]
    fn narrow_and_wide_scalars_keep_their_bits() {
        assert_eq!((-1i8).to_words(), (0xFF, 0));
        assert_eq!(i16::from_words(0x8000, 0), i16::MIN);
        assert_eq!((-2i64).to_words(), (0xFFFF_FFFE, 0xFFFF_FFFF));
        assert_eq!(f64::from_words(0, 0x3FF0_0000), 1.0);
    }

    #[test]
    fn rows_of_64_lanes_begin_with_a_line() {
        // Of several sizes, as memory may happen to be so.
        for rows in [1, 3, 300, 2000] {
            let registers = Registers::<64>::new(rows);
            for file in [&registers, &registers.clone()] {
                assert!((0..rows).all(|row| file[Reg(row as u32)].0.as_ptr().addr().is_multiple_of(64)));
            }
        }
    }

    #[test]
    fn a_result_may_overwrite_its_operand() {
        let mut registers = Registers::<4>::new(3);
        registers[Reg(0)] = Lanes([1, 2, 3, 4]);
        registers[Reg(1)] = Lanes([10, 20, 30, 40]);
        map2::<4, u32, u32, u32>(&mut registers, Reg(0), &[Reg(0), Reg(1), Reg(0)], |a, b| a + b);
        assert_eq!(registers[Reg(0)].0, [11, 22, 33, 44]);
    }
}
