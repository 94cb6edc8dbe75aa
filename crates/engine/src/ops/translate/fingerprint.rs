//! Fingerprints of the scalars of types.

use crate::module::ty::{Type, TypeId};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// The prime 2^61 - 1.
const PRIME: u64 = (1 << 61) - 1;
/// The number at which the polynomial of a list of scalars is evaluated.
const BASE: u64 = 0x1D8A_F066_5F3C_9E37 % PRIME;

/// The fingerprint of a list of scalars: the polynomial that has them as coefficients, at one place
/// modulo a prime (Karp and Rabin, 1987). Lists are joined and repeated without being written out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fingerprint {
    value: u64,
    /// The place to the power of the list's length.
    power: u64,
}

impl Fingerprint {
    const EMPTY: Self = Self { value: 0, power: 1 };

    fn scalar(kind: u64) -> Self {
        // No scalar is 0, so that lists of different lengths differ.
        Self { value: kind + 1, power: BASE }
    }

    fn then(self, next: Self) -> Self {
        let value = (times(self.value, next.power) + next.value) % PRIME;
        Self { value, power: times(self.power, next.power) }
    }

    fn repeated(self, mut count: u32) -> Self {
        let (mut all, mut doubled) = (Self::EMPTY, self);
        while count > 0 {
            if count & 1 == 1 {
                all = all.then(doubled);
            }
            doubled = doubled.then(doubled);
            count >>= 1;
        }
        all
    }
}

fn times(a: u64, b: u64) -> u64 {
    (u128::from(a) * u128::from(b) % u128::from(PRIME)) as u64
}

impl Translator<'_> {
    /// A fingerprint of a type's scalars, in their order: the same for types whose values lie alike
    /// in registers, whatever the types and their members are called, and whether integers have a
    /// sign.
    pub fn scalar_fingerprint(&mut self, ty: TypeId) -> Result<u64> {
        let Fingerprint { value, power } = self.fingerprint(ty)?;
        Ok(value ^ power.rotate_left(32))
    }

    fn fingerprint(&mut self, ty: TypeId) -> Result<Fingerprint> {
        if let Some(&known) = self.fingerprints.get(&ty) {
            return Ok(known);
        }
        let found = match self.module.ty(ty).clone() {
            Type::Vector { component: part, count } | Type::Matrix { column: part, count } => {
                self.fingerprint(part)?.repeated(count)
            }
            Type::Array { element, length, .. } => {
                let length = self.array_length(length)?;
                self.fingerprint(element)?.repeated(length)
            }
            Type::Struct { members, .. } => {
                let mut all = Fingerprint::EMPTY;
                for member in members {
                    all = all.then(self.fingerprint(member.ty)?);
                }
                all
            }
            Type::Int { width, .. } => Fingerprint::scalar(1 << 8 | u64::from(width)),
            ref ty @ Type::Float { .. } => {
                let format = ty.float_format().map_or(255, |format| format as u64);
                Fingerprint::scalar(2 << 8 | format)
            }
            _ => Fingerprint::scalar(3 << 8 | u64::from(self.word_count(ty)?)),
        };
        self.fingerprints.insert(ty, found);
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_list_is_the_list_written_out() {
        let pair = Fingerprint::scalar(3).then(Fingerprint::scalar(4));
        let written = (0..13).fold(Fingerprint::EMPTY, |all, _| all.then(pair));
        assert_eq!(pair.repeated(13), written);
        assert_eq!(pair.repeated(0), Fingerprint::EMPTY);
        assert_ne!(pair, Fingerprint::scalar(4).then(Fingerprint::scalar(3)));
        assert_ne!(Fingerprint::scalar(0), Fingerprint::scalar(0).repeated(2));
    }
}
