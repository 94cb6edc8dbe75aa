//! Scalars of one lane in the registers of a batch, as bits.

use anyhit_engine::machine::{Batch, Reg};

/// The bits of a scalar of one or two words.
pub(super) fn words<const W: usize>(batch: &Batch<W>, first: Reg, count: u32, lane: usize) -> u64 {
    let word = |register: Reg| u64::from(batch.registers[register].0[lane]);
    if count > 1 { word(first) | word(first.plus(1)) << 32 } else { word(first) }
}

/// Writes the bits of a scalar of one or two words.
pub(super) fn set_words<const W: usize>(
    batch: &mut Batch<W>,
    first: Reg,
    count: u32,
    lane: usize,
    bits: u64,
) {
    batch.registers[first].0[lane] = bits as u32;
    if count > 1 {
        batch.registers[first.plus(1)].0[lane] = (bits >> 32) as u32;
    }
}
