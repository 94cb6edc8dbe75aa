//! The f64 shadow values of a shader's registers.

use std::collections::HashMap;

use crate::stability::rays::{RayOperandOffset, RayShadow, ShadowedQuery};
use crate::stability::shadow_value::ShadowValue;
use anyhit_engine::machine::stop::RegSpan;
use anyhit_engine::machine::{Batch, Reg};
use anyhit_engine::math::ulp::ulp_error;
use anyhit_engine::ops::image::access::TexelWrite;

/// A shader that runs or waits.
#[derive(Debug, Default)]
pub(super) struct ShadowFrame {
    pub shader: usize,
    /// The shadow values by register; valid only with the frame's own generation.
    entries: Vec<(u64, ShadowValue)>,
    generation: u64,
    /// What the shader waits for.
    pub waits_for: WaitsFor,
    /// The word offset of the instruction that the shader waits at.
    pub wait_offset: u32,
    /// The shader's ray queries, by handle.
    pub queries: HashMap<u32, ShadowedQuery>,
    /// The shadows of floats that are packed into words, by register and part; the bits are those
    /// of the whole word.
    pub packed: HashMap<(Reg, u32), ShadowValue>,
}

/// What a shader waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum WaitsFor {
    /// Nothing: the shader runs.
    #[default]
    No,
    /// A traced ray, whose payload is in these registers.
    Trace(RegSpan),
    /// A callable shader, whose data are in these registers.
    Call(RegSpan),
    /// The result of a report.
    Report,
}

/// How far a texel that an invocation writes is from its shadow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TexelError {
    /// Index of the pass in the scene.
    pub pass: usize,
    /// The launch index, or the global invocation ID.
    pub id: [u32; 3],
    /// The greatest error of a component, in units in the last place of an f32.
    pub ulps: f64,
}

impl ShadowFrame {
    /// Resets the frame for a shader with this number of registers.
    pub(super) fn begin(&mut self, shader: usize, registers: usize, generation: u64) {
        self.entries.resize(registers.max(self.entries.len()), (0, ShadowValue::default()));
        (self.shader, self.generation) = (shader, generation);
        (self.waits_for, self.wait_offset) = (WaitsFor::No, 0);
        self.queries.clear();
        self.packed.clear();
    }

    /// The shadow value of a register, whatever bits the register holds by now.
    pub(super) fn entry(&self, reg: Reg) -> Option<ShadowValue> {
        let &(generation, entry) = self.entries.get(reg.0 as usize)?;
        (generation == self.generation).then_some(entry)
    }

    /// The shadow value of a register of one or two words, if it holds `bits`.
    pub(super) fn value(&self, reg: Reg, bits: u64) -> Option<f64> {
        self.entry(reg).filter(|entry| entry.bits == bits).map(|entry| entry.value)
    }

    /// Sets or removes the shadow value of a register.
    pub(super) fn set(&mut self, reg: Reg, entry: Option<ShadowValue>) {
        if let Some(slot) = self.entries.get_mut(reg.0 as usize) {
            *slot = entry.map_or((0, ShadowValue::default()), |entry| (self.generation, entry));
        }
    }

    /// Removes the shadow values of some registers.
    pub(super) fn invalidate(&mut self, first: Reg, count: u32) {
        (0..count).for_each(|word| self.set(first.plus(word), None));
    }

    /// The shadow values of a ray, given the first register of an instruction's operands.
    pub(super) fn ray_shadow(&self, numbers: RayOperandOffset, operands: Reg) -> RayShadow {
        RayShadow(numbers.registers(operands).map(|register| self.entry(register)).collect())
    }

    /// The greatest error of a component of a texel that is written, before it is converted to the
    /// image's format, in units in the last place of an f32.
    pub(super) fn texel_ulps(&self, batch: &Batch<1>, op: &TexelWrite) -> f64 {
        let errors = op.from.iter().map(|&register| {
            let bits = bits(batch, register, 1);
            let exact = self.value(register, bits);
            exact.map_or(0.0, |exact| ulp_error(f32::from_bits(bits as u32), exact))
        });
        errors.fold(0.0, f64::max)
    }

    /// The shadow values of some registers.
    pub(super) fn entries(&self, span: RegSpan) -> Vec<Option<ShadowValue>> {
        (0..span.count).map(|word| self.entry(span.first.plus(word))).collect()
    }

    /// Sets the shadow values of some registers.
    pub(super) fn set_all(&mut self, span: RegSpan, entries: &[Option<ShadowValue>]) {
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
