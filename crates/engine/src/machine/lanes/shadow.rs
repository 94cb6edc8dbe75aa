//! Shadow registers: which lanes of which registers are undefined, and why.
//!
//! A sanitizer keeps them beside the registers of a batch, as MemorySanitizer keeps shadow memory
//! beside memory. Where the pipeline copies registers from one batch to another (payloads, callable
//! data), the shadows go with them; what it writes otherwise is defined.

use crate::machine::lanes::{Lanes, Mask, Reg};

/// What is known of the values in the registers of a batch, by register.
#[derive(Clone, Debug)]
pub struct ShadowRegisters<const W: usize> {
    registers: Vec<RegisterShadow<W>>,
    causes: Vec<Lanes<W>>,
    /// By kind of value that goes stale, and by register; empty where nobody tracks any.
    freshness: Vec<Vec<Freshness<W>>>,
}

/// What is known of the value in one register.
#[derive(Clone, Copy, Debug)]
struct RegisterShadow<const W: usize> {
    /// The lanes in which it is undefined.
    undefined: Mask<W>,
    /// The lanes in which it has a cause. Most registers have none in any lane, so that their
    /// causes need neither be copied nor be cleared.
    caused: Mask<W>,
}

impl<const W: usize> RegisterShadow<W> {
    /// Of a value of which nothing is to be said.
    const CLEAN: Self = Self { undefined: Mask::NONE, caused: Mask::NONE };
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
            registers: vec![RegisterShadow::CLEAN; registers],
            causes: vec![Lanes::splat(NO_CAUSE); registers],
            freshness: Vec::new(),
        }
    }

    /// Makes all registers defined.
    pub fn clear(&mut self) {
        self.registers.fill(RegisterShadow::CLEAN);
        self.freshness.clear();
    }

    /// Tracks a number of kinds of values that go stale, from here on.
    pub fn track_freshness(&mut self, kinds: usize) {
        self.freshness.resize(kinds, vec![Freshness::NONE; self.registers.len()]);
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

    /// Whether nothing is known of a register: it is defined, and has no cause in any lane.
    #[inline]
    pub fn is_clean(&self, register: Reg) -> bool {
        let RegisterShadow { undefined, caused } = self.registers[register.0 as usize];
        (undefined | caused).is_empty()
    }

    /// The lanes in which a register is undefined.
    #[inline]
    pub fn undefined(&self, register: Reg) -> Mask<W> {
        self.registers[register.0 as usize].undefined
    }

    /// The lanes in which a register has a cause why it is undefined, or holds a NaN or infinity;
    /// what is said of lanes where it is neither means nothing.
    #[inline]
    pub fn caused(&self, register: Reg) -> Mask<W> {
        self.registers[register.0 as usize].caused
    }

    /// The number of a lane's cause, or [`NO_CAUSE`].
    #[inline]
    pub fn cause(&self, register: Reg, lane: usize) -> u32 {
        if self.caused(register).contains(lane) { self.causes[register.0 as usize].0[lane] } else { NO_CAUSE }
    }

    /// Sets the cause of some lanes, without a word on whether they are defined.
    pub fn set_cause(&mut self, register: Reg, lanes: Mask<W>, cause: u32) {
        let caused = &mut self.registers[register.0 as usize].caused;
        if cause == NO_CAUSE {
            *caused = caused.without(lanes);
            return;
        }
        *caused = *caused | lanes;
        let causes = &mut self.causes[register.0 as usize];
        for lane in 0..W {
            causes.0[lane] = if lanes.selects(lane) { cause } else { causes.0[lane] };
        }
    }

    /// Forgets what is known of a register.
    #[inline]
    pub fn define(&mut self, register: Reg) {
        self.registers[register.0 as usize] = RegisterShadow::CLEAN;
    }

    /// Makes a register defined in some lanes.
    #[inline]
    pub fn define_lanes(&mut self, register: Reg, lanes: Mask<W>) {
        let known = &mut self.registers[register.0 as usize];
        known.undefined = known.undefined.without(lanes);
        known.caused = known.caused.without(lanes);
    }

    /// Makes consecutive registers defined in some lanes.
    pub fn define_span(&mut self, first: Reg, count: u32, lanes: Mask<W>) {
        (0..count).for_each(|word| self.define_lanes(first.plus(word), lanes));
    }

    /// Makes a register undefined in some lanes, by a cause.
    pub fn undefine(&mut self, register: Reg, lanes: Mask<W>, cause: u32) {
        let known = &mut self.registers[register.0 as usize];
        known.undefined = known.undefined | lanes;
        self.set_cause(register, lanes, cause);
    }

    /// Makes consecutive registers undefined in some lanes, by a cause.
    pub fn undefine_span(&mut self, first: Reg, count: u32, lanes: Mask<W>, cause: u32) {
        (0..count).for_each(|word| self.undefine(first.plus(word), lanes, cause));
    }

    /// Sets which lanes of a register are undefined; their causes are set apart from it.
    #[inline]
    pub fn set_undefined(&mut self, register: Reg, undefined: Mask<W>) {
        self.registers[register.0 as usize].undefined = undefined;
    }

    /// Takes the causes of some lanes over from another register.
    #[inline]
    pub fn copy_causes(&mut self, to: Reg, from: Reg, lanes: Mask<W>) {
        let copied = self.caused(from) & lanes;
        let caused = &mut self.registers[to.0 as usize].caused;
        *caused = caused.without(lanes) | copied;
        if copied.is_all() {
            self.causes[to.0 as usize] = self.causes[from.0 as usize];
            return;
        }
        for lane in copied.lanes() {
            self.causes[to.0 as usize].0[lane] = self.causes[from.0 as usize].0[lane];
        }
    }

    /// Copies the shadow of a register into another, in all lanes.
    #[inline]
    pub fn copy(&mut self, to: Reg, from: Reg) {
        let known = self.registers[from.0 as usize];
        self.registers[to.0 as usize] = known;
        if !known.caused.is_empty() {
            self.causes[to.0 as usize] = self.causes[from.0 as usize];
        }
    }

    /// Copies the shadow of a register into another, for the lanes of a mask.
    #[inline]
    pub fn copy_lanes(&mut self, to: Reg, from: Reg, lanes: Mask<W>) {
        let copied = self.undefined(from) & lanes;
        let undefined = &mut self.registers[to.0 as usize].undefined;
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
            self.define_lanes(to, lanes);
            let Some(from) = from else { continue };
            let from_register = first.plus(word);
            let known = &mut self.registers[to.0 as usize];
            known.undefined = known.undefined | (from.undefined(from_register) & lanes);
            let copied = from.caused(from_register) & lanes;
            known.caused = known.caused | copied;
            let causes = &mut self.causes[to.0 as usize];
            copied.lanes().for_each(|lane| causes.0[lane] = from.causes[from_register.0 as usize].0[lane]);
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
        assert_eq!((shadow.undefined(Reg(1)), shadow.cause(Reg(1), 1)), (Mask::first(2), 7));
        shadow.define_lanes(Reg(1), Mask::lane(0));
        assert_eq!(shadow.undefined(Reg(1)), Mask::lane(1));
        shadow.undefine(Reg(2), Mask::lane(3), 9);
        shadow.copy_lanes(Reg(2), Reg(0), Mask::lane(0));
        assert_eq!(shadow.undefined(Reg(2)), Mask::lane(0) | Mask::lane(3));
        assert_eq!([0, 1, 2, 3].map(|lane| shadow.cause(Reg(2), lane)), [7, 0, 0, 9]);
        // A cause that is overwritten by none does not come back.
        shadow.copy_lanes(Reg(2), Reg(1), Mask::lane(3));
        assert_eq!(shadow.cause(Reg(2), 3), NO_CAUSE);
        assert!(!shadow.is_clean(Reg(2)));
        shadow.define(Reg(2));
        assert!(shadow.is_clean(Reg(2)) && shadow.cause(Reg(2), 0) == NO_CAUSE);
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
