//! Shadow registers: which lanes of which registers are undefined, and why.
//!
//! A sanitizer keeps them beside the registers of a batch, as MemorySanitizer keeps shadow memory
//! beside memory. Where the pipeline copies registers from one batch to another (payloads, callable
//! data), the shadows go with them; what it writes otherwise is defined.

use crate::machine::lanes::{Lanes, Mask, Reg};

/// What is known of the values in the registers of a batch, by register.
#[derive(Clone, Debug)]
pub struct ShadowRegisters<const W: usize> {
    undefined: Vec<Mask<W>>,
    causes: Vec<Lanes<W>>,
    /// By kind of value that goes stale, and by register; empty where nobody tracks any.
    freshness: Vec<Vec<Freshness<W>>>,
}

/// The lanes in which a register holds a value of a kind that goes stale: the index of a lane,
/// which repacking changes, say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Freshness<const W: usize> {
    /// Where it holds one that is still true.
    pub current: Mask<W>,
    /// Where it holds one that may no longer be.
    pub stale: Mask<W>,
}

impl<const W: usize> Freshness<W> {
    /// Of a register that holds something else.
    pub const NONE: Self = Self { current: Mask::NONE, stale: Mask::NONE };

    /// Of what is computed from this and another value: it is stale where one of them is.
    pub fn joined(self, other: Self) -> Self {
        let stale = self.stale | other.stale;
        Self { current: (self.current | other.current).without(stale), stale }
    }
}

/// The cause of a value of which nothing is known.
pub const NO_CAUSE: u32 = 0;

impl<const W: usize> ShadowRegisters<W> {
    /// Shadows of a number of registers, which are all defined.
    pub fn new(registers: usize) -> Self {
        Self {
            undefined: vec![Mask::NONE; registers],
            causes: vec![Lanes::splat(NO_CAUSE); registers],
            freshness: Vec::new(),
        }
    }

    /// Makes all registers defined.
    pub fn clear(&mut self) {
        self.undefined.fill(Mask::NONE);
        self.freshness.clear();
    }

    /// Tracks a number of kinds of values that go stale, from here on.
    pub fn track_freshness(&mut self, kinds: usize) {
        self.freshness.resize(kinds, vec![Freshness::NONE; self.undefined.len()]);
    }

    /// Where a register holds a value of a kind, if that is tracked.
    pub fn freshness(&self, kind: usize, register: Reg) -> Freshness<W> {
        let of_kind = self.freshness.get(kind).and_then(|all| all.get(register.0 as usize));
        of_kind.copied().unwrap_or(Freshness::NONE)
    }

    /// Sets where a register holds a value of a kind, for the lanes of a mask.
    pub fn set_freshness(&mut self, kind: usize, register: Reg, lanes: Mask<W>, freshness: Freshness<W>) {
        if let Some(own) = self.freshness.get_mut(kind).and_then(|all| all.get_mut(register.0 as usize)) {
            own.current = own.current.without(lanes) | (freshness.current & lanes);
            own.stale = own.stale.without(lanes) | (freshness.stale & lanes);
        }
    }

    /// What is held of a kind goes stale in the lanes of a mask.
    pub fn expire(&mut self, kind: usize, lanes: Mask<W>) {
        for freshness in self.freshness.get_mut(kind).into_iter().flatten() {
            freshness.stale = freshness.stale | (freshness.current & lanes);
            freshness.current = freshness.current.without(lanes);
        }
    }

    /// The lanes in which a register is undefined.
    #[inline]
    pub fn undefined(&self, register: Reg) -> Mask<W> {
        self.undefined[register.0 as usize]
    }

    /// By lane, the number of the cause why a register is undefined, or holds a NaN; meaningless in
    /// other lanes.
    #[inline]
    pub fn causes(&self, register: Reg) -> &Lanes<W> {
        &self.causes[register.0 as usize]
    }

    /// Sets the cause of some lanes, without a word on whether they are defined.
    pub fn set_cause(&mut self, register: Reg, lanes: Mask<W>, cause: u32) {
        let causes = &mut self.causes[register.0 as usize];
        lanes.lanes().for_each(|lane| causes.0[lane] = cause);
    }

    /// Forgets the causes of a register, which is defined now.
    #[inline]
    pub fn define(&mut self, register: Reg) {
        self.undefined[register.0 as usize] = Mask::NONE;
        self.causes[register.0 as usize] = Lanes::splat(NO_CAUSE);
    }

    /// Makes a register defined in some lanes.
    pub fn define_lanes(&mut self, register: Reg, lanes: Mask<W>) {
        let undefined = &mut self.undefined[register.0 as usize];
        *undefined = undefined.without(lanes);
        self.set_cause(register, lanes, NO_CAUSE);
    }

    /// Makes consecutive registers defined in some lanes.
    pub fn define_span(&mut self, first: Reg, count: u32, lanes: Mask<W>) {
        (0..count).for_each(|word| self.define_lanes(first.plus(word), lanes));
    }

    /// Makes a register undefined in some lanes, by a cause.
    pub fn undefine(&mut self, register: Reg, lanes: Mask<W>, cause: u32) {
        let undefined = &mut self.undefined[register.0 as usize];
        *undefined = *undefined | lanes;
        self.set_cause(register, lanes, cause);
    }

    /// Makes consecutive registers undefined in some lanes, by a cause.
    pub fn undefine_span(&mut self, first: Reg, count: u32, lanes: Mask<W>, cause: u32) {
        (0..count).for_each(|word| self.undefine(first.plus(word), lanes, cause));
    }

    /// Sets which lanes of a register are undefined; their causes are set apart from it.
    #[inline]
    pub fn set_undefined(&mut self, register: Reg, undefined: Mask<W>) {
        self.undefined[register.0 as usize] = undefined;
    }

    /// Takes the causes of some lanes over from another register.
    pub fn copy_causes(&mut self, to: Reg, from: Reg, lanes: Mask<W>) {
        for lane in lanes.lanes() {
            self.causes[to.0 as usize].0[lane] = self.causes[from.0 as usize].0[lane];
        }
    }

    /// Copies the shadow of a register into another, in all lanes.
    #[inline]
    pub fn copy(&mut self, to: Reg, from: Reg) {
        self.undefined[to.0 as usize] = self.undefined[from.0 as usize];
        self.causes[to.0 as usize] = self.causes[from.0 as usize];
    }

    /// Copies the shadow of a register into another, for the lanes of a mask.
    pub fn copy_lanes(&mut self, to: Reg, from: Reg, lanes: Mask<W>) {
        let copied = self.undefined[from.0 as usize] & lanes;
        let undefined = &mut self.undefined[to.0 as usize];
        *undefined = undefined.without(lanes) | copied;
        self.copy_causes(to, from, lanes);
    }

    /// Copies one lane of the shadow of a register into another register.
    pub fn copy_lane(&mut self, to: Reg, from: Reg, lane: usize) {
        self.copy_lanes(to, from, Mask::lane(lane));
    }

    /// Copies the shadows of consecutive registers of another batch, for the lanes of a mask; where
    /// that batch has none, all it holds is defined.
    pub(super) fn copy_span(&mut self, to: Reg, from: Option<&Self>, first: Reg, count: u32, lanes: Mask<W>) {
        for word in 0..count {
            let to = to.plus(word);
            (0..self.freshness.len()).for_each(|kind| self.set_freshness(kind, to, lanes, Freshness::NONE));
            let Some(from) = from else {
                self.define_lanes(to, lanes);
                continue;
            };
            let from_register = first.plus(word);
            let undefined = &mut self.undefined[to.0 as usize];
            *undefined = undefined.without(lanes) | (from.undefined(from_register) & lanes);
            let causes = &mut self.causes[to.0 as usize];
            lanes.lanes().for_each(|lane| causes.0[lane] = from.causes(from_register).0[lane]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shadows_follow_copies_in_the_lanes_that_are_copied() {
        let mut shadow = ShadowRegisters::<4>::new(3);
        shadow.undefine(Reg(0), Mask::first(2), 7);
        shadow.copy(Reg(1), Reg(0));
        assert_eq!((shadow.undefined(Reg(1)), shadow.causes(Reg(1)).0[1]), (Mask::first(2), 7));
        shadow.define_lanes(Reg(1), Mask::lane(0));
        assert_eq!(shadow.undefined(Reg(1)), Mask::lane(1));
        shadow.undefine(Reg(2), Mask::lane(3), 9);
        shadow.copy_lanes(Reg(2), Reg(0), Mask::lane(0));
        assert_eq!(shadow.undefined(Reg(2)), Mask::lane(0) | Mask::lane(3));
        assert_eq!(shadow.causes(Reg(2)).0, [7, 0, 0, 9]);
    }

    #[test]
    fn values_go_stale_where_they_expire_by_kind() {
        let mut shadow = ShadowRegisters::<4>::new(2);
        let current = Freshness { current: Mask::ALL, stale: Mask::NONE };
        shadow.set_freshness(1, Reg(0), Mask::ALL, current);
        assert_eq!(shadow.freshness(1, Reg(0)), Freshness::NONE);
        shadow.track_freshness(2);
        shadow.set_freshness(1, Reg(0), Mask::first(3), current);
        shadow.expire(0, Mask::ALL);
        shadow.expire(1, Mask::first(2));
        let expected = Freshness { current: Mask::lane(2), stale: Mask::first(2) };
        assert_eq!(shadow.freshness(1, Reg(0)), expected);
        let joined = expected.joined(current);
        assert_eq!((joined.current, joined.stale), (Mask::lane(2) | Mask::lane(3), Mask::first(2)));
        shadow.copy_span(Reg(0), None, Reg(5), 1, Mask::lane(0));
        assert_eq!(shadow.freshness(1, Reg(0)).stale, Mask::lane(1));
    }

    #[test]
    fn registers_of_a_batch_without_shadows_are_defined() {
        let mut shadow = ShadowRegisters::<4>::new(2);
        shadow.undefine(Reg(0), Mask::ALL, 1);
        shadow.copy_span(Reg(0), None, Reg(5), 1, Mask::lane(2));
        assert_eq!(shadow.undefined(Reg(0)), Mask::ALL.without(Mask::lane(2)));
    }
}
