//! The registers of a value.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::module::Id;
use crate::module::ty::TypeId;

/// The registers of a value's words, in the order of its scalars; the two words of a 64-bit scalar
/// always lie in consecutive registers.
pub type Words = SmallVec<[Reg; 4]>;

/// A list of consecutive registers from `first` on.
#[inline]
pub fn registers_from(first: Reg, count: u32) -> Words {
    match count as usize {
        // Avoids a loop: most values have at most four words.
        count @ 0..=4 => SmallVec::from_buf_and_len([0, 1, 2, 3].map(|word| first.plus(word)), count),
        _ => (0..count).map(|word| first.plus(word)).collect(),
    }
}

/// Returns a list of the registers in `words`.
#[inline]
pub(super) fn words_from(words: &[Reg]) -> Words {
    match words.len() {
        // Avoids a call of `memcpy`.
        count @ 0..=4 => {
            let word = |at: usize| words.get(at).copied().unwrap_or(Reg(0));
            SmallVec::from_buf_and_len([0, 1, 2, 3].map(word), count)
        }
        _ => Words::from_slice(words),
    }
}

/// The registers of the result of an `OpUndef` at module scope, which hold zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UndefinedConstant {
    /// The result.
    pub id: Id,
    /// Its type.
    pub ty: TypeId,
    /// The first register.
    pub first: Reg,
    /// The number of registers.
    pub count: u32,
}
