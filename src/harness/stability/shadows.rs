//! The f64 shadow values of a shader's registers.

use std::collections::HashMap;

use crate::harness::stability::rays::{Beside, Numbers, Queried};
use crate::machine::stop::RegSpan;
use crate::machine::{Batch, Reg};

/// The shadow of a word, or of the two words of a wide number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Entry {
    /// The bits of the register: if it holds others by now, it was written by something that is not
    /// shadowed, and the entry is invalid.
    pub bits: u64,
    /// The value without the rounding; of a truth value 0 or 1, of an integer the integer.
    pub value: f64,
}

/// A shader that runs or waits.
#[derive(Debug, Default)]
pub(super) struct Frame {
    pub shader: usize,
    /// By register; an entry is valid only with the frame's own number.
    entries: Vec<(u64, Entry)>,
    number: u64,
    /// What it waits for.
    pub waits: Waits,
    /// The word offset of the instruction that it waits at.
    pub waits_at: u32,
    /// Its ray queries, by handle.
    pub queries: HashMap<u32, Queried>,
}

/// What a shader waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Waits {
    /// The frame waits for nothing.
    #[default]
    No,
    /// The ray that it traces, whose payload lies there.
    Trace(RegSpan),
    /// The callable shader that it calls, whose data lie there.
    Call(RegSpan),
    /// The answer to a report.
    Report,
}

impl Frame {
    /// Resets the frame for a shader with that many registers.
    pub fn begin(&mut self, shader: usize, registers: usize, number: u64) {
        self.entries.resize(registers.max(self.entries.len()), (0, Entry::default()));
        (self.shader, self.number) = (shader, number);
        (self.waits, self.waits_at) = (Waits::No, 0);
        self.queries.clear();
    }

    /// The entry of a register, whatever the register holds by now.
    pub fn entry(&self, reg: Reg) -> Option<Entry> {
        let &(number, entry) = self.entries.get(reg.0 as usize)?;
        (number == self.number).then_some(entry)
    }

    /// The shadow value of a register of one or two words, if it holds `bits`.
    pub fn value(&self, reg: Reg, bits: u64) -> Option<f64> {
        self.entry(reg).filter(|entry| entry.bits == bits).map(|entry| entry.value)
    }

    /// Sets the entry of a register, or removes it.
    pub fn set(&mut self, reg: Reg, entry: Option<Entry>) {
        if let Some(place) = self.entries.get_mut(reg.0 as usize) {
            *place = entry.map_or((0, Entry::default()), |entry| (self.number, entry));
        }
    }

    /// Removes the entries of some registers.
    pub fn forget(&mut self, first: Reg, count: u32) {
        (0..count).for_each(|word| self.set(first.plus(word), None));
    }

    /// The entries of the numbers of a ray, given the first of an instruction's operands.
    pub fn beside(&self, numbers: Numbers, operands: Reg) -> Beside {
        Beside(numbers.rows(operands).map(|register| self.entry(register)).collect())
    }

    /// The entries of some registers.
    pub fn entries(&self, span: RegSpan) -> Vec<Option<Entry>> {
        (0..span.count).map(|word| self.entry(span.first.plus(word))).collect()
    }

    /// Sets the entries of registers.
    pub fn set_all(&mut self, span: RegSpan, entries: &[Option<Entry>]) {
        for word in 0..span.count {
            self.set(span.first.plus(word), entries.get(word as usize).copied().flatten());
        }
    }
}

/// The bits of a register of one or two words.
pub(super) fn bits(batch: &Batch<1>, reg: Reg, words: u32) -> u64 {
    let high = if words == 2 { u64::from(batch.registers[reg.plus(1)].0[0]) << 32 } else { 0 };
    u64::from(batch.registers[reg].0[0]) | high
}

/// A float of a width as f64.
pub(super) fn float(bits: u64, width: u32) -> f64 {
    match width {
        16 => half::f16::from_bits(bits as u16).to_f64(),
        32 => f64::from(f32::from_bits(bits as u32)),
        _ => f64::from_bits(bits),
    }
}
