//! Lanes and masks: the only loops over the invocations of a batch that compute values.

mod mask;
mod shadow;

use std::ops::{Index, IndexMut};

use aligned_vec::{AVec, ConstAlign};
use half::f16;

use crate::math::array;
use crate::math::lane_ops::CpuTier;
#[cfg(target_arch = "x86_64")]
use mask::BooleanMask;
pub use mask::Mask;
pub use shadow::{Freshness, NO_CAUSE, ShadowRegisters};

/// A register of the register file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Reg(pub u32);

impl Reg {
    /// The register `words` further on.
    #[inline]
    #[must_use]
    pub fn plus(self, words: u32) -> Self {
        Self(self.0 + words)
    }

    /// The register a computed number of registers further on, which may be behind the last one.
    /// The number is an index, or for a register that carries [`REGISTER_POINTER`] a pointer that
    /// does.
    #[inline]
    #[must_use]
    pub fn computed(self, words: u32) -> Self {
        Self(self.0.wrapping_add(words))
    }
}

/// What a pointer to a register carries beside the register's number, so that no register has the
/// value of the null pointer, 0. A register that pointers count from carries it too: together they
/// cancel.
pub const REGISTER_POINTER: u32 = 1 << 31;

/// One 32-bit word for each of W lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Lanes<const W: usize>(pub [u32; W]);

impl<const W: usize> Lanes<W> {
    /// Returns lanes that all hold one word.
    pub fn splat(word: u32) -> Self {
        Self([word; W])
    }
}

/// The register file of a batch. It is aligned to a cache line, so that no vector of a register of
/// 64 lanes crosses two lines: reading those takes twice as long.
#[derive(Clone, Debug)]
pub struct Registers<const W: usize> {
    registers: AVec<Lanes<W>, ConstAlign<CACHE_LINE>>,
    cpu_tier: CpuTier,
    /// What a sanitizer knows of the values; `None` without one.
    pub shadow: Option<Box<ShadowRegisters<W>>>,
}

/// Bytes of a cache line, and of the processor's widest vectors.
const CACHE_LINE: usize = 64;

impl<const W: usize> Registers<W> {
    /// A file of registers that are all zero.
    pub fn new(registers: usize) -> Self {
        let mut zeros = AVec::with_capacity(CACHE_LINE, registers);
        zeros.resize(registers, Lanes::splat(0));
        Self { registers: zeros, cpu_tier: CpuTier::new(), shadow: None }
    }

    /// The tier of vector extensions that the processor has.
    #[inline]
    pub fn cpu_tier(&self) -> CpuTier {
        self.cpu_tier
    }

    /// Returns the registers with another tier of the processor.
    #[cfg(test)]
    pub fn with_cpu_tier(self, cpu_tier: CpuTier) -> Self {
        Self { cpu_tier, ..self }
    }

    /// The lanes in which a register of booleans is true.
    #[inline]
    pub fn mask(&self, condition: Reg) -> Mask<W> {
        let register = &self[condition];
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.cpu_tier.avx2().filter(|_| W.is_multiple_of(8)) {
            return simd.vectorize(BooleanMask { simd, register });
        }
        Mask::of(register)
    }

    /// How many registers there are.
    pub fn len(&self) -> usize {
        self.registers.len()
    }

    /// Whether there are no registers.
    pub fn is_empty(&self) -> bool {
        self.registers.is_empty()
    }

    /// All registers.
    pub fn all_mut(&mut self) -> &mut [Lanes<W>] {
        &mut self.registers
    }

    /// Consecutive registers.
    #[inline]
    pub fn span_mut(&mut self, first: Reg, count: u32) -> &mut [Lanes<W>] {
        &mut self.registers[first.0 as usize..(first.0 + count) as usize]
    }

    /// The words of one lane in consecutive registers.
    #[inline]
    pub fn lane_words(&self, first: Reg, count: u32, lane: usize) -> LaneWords<'_, W> {
        LaneWords { registers: self.registers[first.0 as usize..(first.0 + count) as usize].iter(), lane }
    }

    /// The words of one lane in N consecutive registers.
    #[inline]
    pub fn lane_array<const N: usize>(&self, first: Reg, lane: usize) -> [u32; N] {
        let registers = &self.registers[first.0 as usize..][..N];
        array::from_fn(|at| registers[at].0[lane])
    }

    /// Sets the words of one lane in consecutive registers.
    #[inline]
    pub fn set_lane_words(&mut self, first: Reg, lane: usize, words: impl IntoIterator<Item = u32>) {
        let mut words = words.into_iter();
        for register in &mut self.registers[first.0 as usize..] {
            let Some(word) = words.next() else { return };
            register.0[lane] = word;
        }
    }

    /// Sets a word of all lanes.
    #[inline]
    pub fn set(&mut self, to: Reg, word: u32) {
        self[to].0 = [word; W];
    }

    /// Copies consecutive registers of other registers, for the lanes of a mask.
    pub fn copy_span(&mut self, to: Reg, from: &Self, first: Reg, count: u32, mask: Mask<W>) {
        if let Some(shadow) = &mut self.shadow {
            shadow.copy_span(to, from.shadow.as_deref(), first, count, mask);
        }
        let sources = &from.registers[first.0 as usize..(first.0 + count) as usize];
        let registers = self.span_mut(to, count);
        if mask.is_all() {
            registers.copy_from_slice(sources);
            return;
        }
        let words = mask.words();
        for (register, source) in registers.iter_mut().zip(sources) {
            for lane in 0..W {
                let selected = words.0[lane];
                register.0[lane] = source.0[lane] & selected | register.0[lane] & !selected;
            }
        }
    }

    /// Says that somebody has written consecutive registers, in the lanes of a mask, where a
    /// sanitizer keeps shadows of them.
    pub fn define(&mut self, first: Reg, count: u32, lanes: Mask<W>) {
        if let Some(shadow) = &mut self.shadow {
            shadow.define_span(first, count, lanes);
        }
    }

    /// Copies a register into another, for the lanes of a mask.
    #[inline(always)]
    pub fn copy(&mut self, to: Reg, from: Reg, mask: Mask<W>) {
        let place = from.0 as usize;
        if mask.is_all() {
            // A plain copy, which the compiler keeps in vector registers.
            self.registers.copy_within(place..place + 1, to.0 as usize);
            return;
        }
        let (source, cpu_tier) = (self[from], self.cpu_tier);
        let register = &mut self[to];
        cpu_tier.run_loop(
            #[inline(always)]
            || {
                for lane in 0..W {
                    register.0[lane] = if mask.selects(lane) { source.0[lane] } else { register.0[lane] };
                }
            },
        );
    }
}

/// The words of one lane in consecutive registers.
#[derive(Clone, Debug)]
pub struct LaneWords<'a, const W: usize> {
    registers: std::slice::Iter<'a, Lanes<W>>,
    lane: usize,
}

impl<const W: usize> Iterator for LaneWords<'_, W> {
    type Item = u32;

    #[inline]
    fn next(&mut self) -> Option<u32> {
        self.registers.next().map(|register| register.0[self.lane])
    }

    #[inline]
    fn size_hint(&self) -> (usize, Option<usize>) {
        self.registers.size_hint()
    }
}

impl<const W: usize> ExactSizeIterator for LaneWords<'_, W> {}

impl<const W: usize> Index<Reg> for Registers<W> {
    type Output = Lanes<W>;
    #[inline]
    fn index(&self, reg: Reg) -> &Lanes<W> {
        &self.registers[reg.0 as usize]
    }
}

impl<const W: usize> IndexMut<Reg> for Registers<W> {
    #[inline]
    fn index_mut(&mut self, reg: Reg) -> &mut Lanes<W> {
        &mut self.registers[reg.0 as usize]
    }
}

/// A scalar as it lies in one or two registers.
///
/// Narrow values lie in the low bits, the rest is zero; a bool is 0 or 1; 64-bit values lie in two
/// registers, the low word first. A NaN result is always written as the canonical NaN: quiet,
/// positive and without a payload. IEEE 754 leaves these bits open, and processors, and compilers
/// that swap operands, produce different ones.
pub trait Scalar: Copy {
    /// Registers taken: 1 or 2.
    const WORDS: u32;
    /// Reads it; `high` is used for two registers only.
    fn from_words(low: u32, high: u32) -> Self;
    /// Writes it, low word first.
    fn to_words(self) -> (u32, u32);
    /// Its low word; the payload of a 32-bit NaN is kept.
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

/// Reads one operand's registers: the low words and, for two-register scalars, the high words.
#[inline(always)]
fn operand<const W: usize, A: Scalar>(registers: &[Lanes<W>], reg: Reg) -> (&Lanes<W>, &Lanes<W>) {
    let low = &registers[reg.0 as usize];
    (low, if A::WORDS == 2 { &registers[reg.plus(1).0 as usize] } else { low })
}

#[inline(always)]
fn store<const W: usize, R: Scalar>(registers: &mut [Lanes<W>], to: Reg, low: [u32; W], high: [u32; W]) {
    registers[to.0 as usize].0 = low;
    if R::WORDS == 2 {
        registers[to.plus(1).0 as usize].0 = high;
    }
}

/// Applies a scalar function of one operand to every lane.
#[inline(always)]
pub fn map1<const W: usize, A: Scalar, R: Scalar>(
    registers: &mut [Lanes<W>],
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
    registers: &mut [Lanes<W>],
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
    registers: &mut [Lanes<W>],
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
    fn the_mask_of_a_condition() {
        let mut registers = Registers::<128>::new(1);
        registers[Reg(0)].0 = array::from_fn(|lane| u32::from(lane % 3 == 1 || lane > 120));
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
    fn registers_of_64_lanes_are_aligned_to_cache_lines() {
        // Several sizes are tried, as an allocation may happen to be aligned.
        for count in [1, 3, 300, 2000] {
            let registers = Registers::<64>::new(count);
            for file in [&registers, &registers.clone()] {
                let addresses = (0..count).map(|at| file[Reg(at as u32)].0.as_ptr().addr());
                assert!(addresses.into_iter().all(|address| address.is_multiple_of(64)));
            }
        }
    }

    #[test]
    fn a_result_may_overwrite_its_operand() {
        let mut registers = Registers::<4>::new(3);
        registers[Reg(0)] = Lanes([1, 2, 3, 4]);
        registers[Reg(1)] = Lanes([10, 20, 30, 40]);
        map2::<4, u32, u32, u32>(registers.all_mut(), Reg(0), &[Reg(0), Reg(1), Reg(0)], |a, b| a + b);
        assert_eq!(registers[Reg(0)].0, [11, 22, 33, 44]);
    }
}
