//! The f64 shadows of floats that are packed into a word (`packHalf2x16`, `packUnorm4x8`, …).

use crate::stability::shadow_context::Memory;
use crate::stability::shadow_value::ShadowValue;
use crate::stability::shadows::ShadowFrame;
use anyhit_engine::machine::Reg;

/// How many floats a word holds at most.
const PARTS: u32 = 4;

impl ShadowFrame {
    /// The shadow of a float that is packed into the word in a register, if it holds `bits`.
    pub(super) fn packed(&self, word: Reg, bits: u64, part: u32) -> Option<f64> {
        self.packed.get(&(word, part)).filter(|entry| entry.bits == bits).map(|entry| entry.value)
    }

    /// Sets the shadow of the float that is packed into a word, alone.
    pub(super) fn pack(&mut self, word: Reg, bits: u64, part: u32, value: f64) {
        self.forget_packed(word);
        self.packed.insert((word, part), ShadowValue { bits, value });
    }

    /// Sets the shadows of the floats of a word to those of the words that it was made of.
    pub(super) fn join_packed(&mut self, to: Reg, bits: u64, from: &[(Reg, u64)]) {
        if self.packed.is_empty() {
            return;
        }
        let found = |part: u32| from.iter().find_map(|&(word, bits)| self.packed(word, bits, part));
        let parts: Vec<(u32, f64)> = (0..PARTS).filter_map(|part| Some((part, found(part)?))).collect();
        self.forget_packed(to);
        let entries = parts.into_iter().map(|(part, value)| ((to, part), ShadowValue { bits, value }));
        self.packed.extend(entries);
    }

    /// Stores the shadows of the floats of a word under the key of its bytes.
    pub(super) fn store_packed(&self, word: Reg, key: (usize, u64), memory: &mut Memory) {
        // Of words that hold other bits than these nothing is read.
        if self.packed.is_empty() {
            return;
        }
        for part in 0..PARTS {
            match self.packed.get(&(word, part)) {
                Some(entry) => memory.insert(part_key(key, part), *entry),
                None => memory.remove(&part_key(key, part)),
            };
        }
    }

    /// Loads the shadows of the floats of a word by the key of its bytes.
    pub(super) fn load_packed(&mut self, word: Reg, key: (usize, u64), memory: &Memory) {
        self.forget_packed(word);
        for part in 0..PARTS {
            if let Some(entry) = memory.get(&part_key(key, part)) {
                self.packed.insert((word, part), *entry);
            }
        }
    }

    fn forget_packed(&mut self, word: Reg) {
        if !self.packed.is_empty() {
            self.packed.retain(|&(known, _), _| known != word);
        }
    }
}

/// The key of a part of a word; no memory has so many bytes.
fn part_key((memory, offset): (usize, u64), part: u32) -> (usize, u64) {
    (memory, offset | u64::from(part + 1) << 60)
}
