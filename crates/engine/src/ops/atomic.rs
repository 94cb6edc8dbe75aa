//! Atomic instructions (SPIR-V 3.3.20).
//!
//! Lanes apply them in ascending order, which is launch order. A program whose results depend on
//! how invocations interleave (one that uses what an atomic returns, or adds floats) says so
//! ([`Op::order_dependent`](crate::ops::op::Op::order_dependent)), and a launch then runs it
//! invocation by invocation. Integer additions, bit operations, minima and maxima whose result is
//! unused commute each with its own kind: those run on all threads, unless others may reach the
//! same memory ([`Update::commutes_with`], [`crate::program::race_analysis`]).
//!
//! Of a vector of f16 each component is an operation of its own: "atomic operations on vectors only
//! guarantee atomicity of each component" (`SPV_NV_shader_atomic_fp16_vector`, 3.49.18).

use std::sync::atomic::Ordering::Relaxed;

use crate::module::Opcode;
use half::f16;

use crate::machine::{Batch, Bindings, Mask, Reg, Scalar, TrapCode};
use crate::ops::access::Access;
use crate::ops::image::reader::LaneReader;
use crate::ops::image::texel_ref::TexelRef;
use crate::ops::memory::{Chunk, computed_register, fault_value, for_each_access, trap};

pub use translate::translate;

mod translate;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::AtomicLoad,
    Opcode::AtomicStore,
    Opcode::AtomicExchange,
    Opcode::AtomicCompareExchange,
    Opcode::AtomicIIncrement,
    Opcode::AtomicIDecrement,
    Opcode::AtomicIAdd,
    Opcode::AtomicISub,
    Opcode::AtomicSMin,
    Opcode::AtomicUMin,
    Opcode::AtomicSMax,
    Opcode::AtomicUMax,
    Opcode::AtomicAnd,
    Opcode::AtomicOr,
    Opcode::AtomicXor,
    Opcode::AtomicFAddEXT,
    Opcode::AtomicFMinEXT,
    Opcode::AtomicFMaxEXT,
];

/// The update of the value in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtomicKind {
    /// The value stays unchanged.
    Load,
    /// The operand replaces it.
    Exchange,
    /// The operand replaces it, where it equals the comparator.
    CompareExchange,
    /// The sum of the value and the operand.
    Add,
    /// The value minus the operand.
    Sub,
    /// The signed minimum.
    SMin,
    /// The unsigned minimum.
    UMin,
    /// The signed maximum.
    SMax,
    /// The unsigned maximum.
    UMax,
    /// The bitwise and.
    And,
    /// The bitwise or.
    Or,
    /// The bitwise exclusive or.
    Xor,
    /// The sum of floats.
    FAdd,
    /// The minimum of floats.
    FMin,
    /// The maximum of floats.
    FMax,
}

/// The effect on memory of an atomic operation whose result is unused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Update {
    /// The update of the value.
    pub kind: AtomicKind,
    /// Bits of the scalar.
    pub width: u32,
}

impl Update {
    /// Whether two updates leave the same memory in either order, even if their locations overlap
    /// only in part. Differences are sums; bitwise operations commute whatever the width.
    pub fn commutes_with(self, other: Self) -> bool {
        use AtomicKind::{Add, And, Load, Or, SMax, SMin, Sub, UMax, UMin, Xor};
        let same_width = self.width == other.width;
        match (self.kind, other.kind) {
            (Load, _) | (_, Load) => true,
            (And, And) | (Or, Or) | (Xor, Xor) => true,
            (Add | Sub, Add | Sub) => same_width,
            (SMin, SMin) | (UMin, UMin) | (SMax, SMax) | (UMax, UMax) => same_width,
            _ => false,
        }
    }
}

/// The location of the value.
#[derive(Clone, Debug, PartialEq)]
pub enum AtomicTarget {
    /// In a buffer.
    Buffer(Chunk),
    /// In registers of the lane itself, from `first` (plus a computed number) on.
    Registers {
        /// The first register.
        first: Reg,
        /// A register that holds a further number of registers, lane by lane.
        index: Option<Reg>,
    },
    /// A texel, with as many components as the vector, each as wide as the scalar.
    Texel(Box<TexelRef>),
}

/// An atomic operation on one scalar.
#[derive(Clone, Debug, PartialEq)]
pub struct AtomicOp {
    /// The kind.
    pub kind: AtomicKind,
    /// Bits of the scalar: 16, 32 or 64.
    pub width: u32,
    /// The index of the component in its vector and the number of components; (0, 1) for a scalar.
    pub component: (u32, u32),
    /// In a buffer: the bytes that the scalar's offset is a multiple of.
    pub alignment: u32,
    /// The location of the value.
    pub target: AtomicTarget,
    /// The first register that takes the old value.
    pub to: Reg,
    /// The first register of the operand.
    pub value: Reg,
    /// The first register of the comparator.
    pub comparator: Reg,
}

impl AtomicOp {
    /// How many words the scalar has.
    pub fn words(&self) -> u32 {
        self.width.div_ceil(32)
    }

    /// The effect on memory.
    pub fn update(&self) -> Update {
        Update { kind: self.kind, width: self.width }
    }

    /// The part of a buffer that is updated.
    pub(super) fn chunk(&self) -> Option<&Chunk> {
        match &self.target {
            AtomicTarget::Buffer(chunk) => Some(chunk),
            AtomicTarget::Texel(_) | AtomicTarget::Registers { .. } => None,
        }
    }

    /// The texel that is updated.
    pub(super) fn texel(&self) -> Option<&TexelRef> {
        match &self.target {
            AtomicTarget::Texel(texel) => Some(texel),
            AtomicTarget::Buffer(_) | AtomicTarget::Registers { .. } => None,
        }
    }

    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        match &self.target {
            AtomicTarget::Buffer(chunk) => chunk.accesses(visit),
            AtomicTarget::Texel(texel) => texel.registers().for_each(|reg| visit(Access::Read(reg, 1))),
            &AtomicTarget::Registers { first, index } => {
                // The translator lists the whole variable of a computed register as addressed.
                if let Some(index) = index {
                    visit(Access::Read(index, 1));
                } else {
                    visit(Access::Read(first, self.words()));
                    visit(Access::Write(first, self.words()));
                }
            }
        }
        visit(Access::Read(self.value, self.words()));
        visit(Access::Read(self.comparator, self.words()));
        visit(Access::Write(self.to, self.words()));
        visit(Access::Effect);
    }

    /// Whether the results of a launch depend on the order in which invocations execute the
    /// operation; `used` says whether the returned value is read.
    pub(super) fn order_dependent(&self, is_used: &dyn Fn(Reg) -> bool) -> bool {
        if let AtomicTarget::Registers { .. } = self.target {
            return false;
        }
        match self.kind {
            AtomicKind::Exchange
            | AtomicKind::CompareExchange
            | AtomicKind::FAdd
            | AtomicKind::FMin
            | AtomicKind::FMax => true,
            _ => (0..self.words()).any(|word| is_used(self.to.plus(word))),
        }
    }

    /// Runs the operation for the running lanes.
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        match &self.target {
            AtomicTarget::Buffer(chunk) => self.eval_buffer(batch, bindings, chunk),
            AtomicTarget::Texel(texel) => {
                for lane in batch.mask.lanes() {
                    let (component, count) = self.component;
                    match texel.resolve_atomic(LaneReader::new(&batch.registers, lane, bindings), count) {
                        Ok((image, index)) => {
                            let (value, comparator) = self.operands(batch, lane);
                            let (shift, mask) = (component * self.width, u64::MAX >> (64 - self.width));
                            let old = image.update(index, |texel| {
                                let old = texel >> shift & mask;
                                let new = apply(self.kind, self.width, old, value, comparator)?;
                                Some(texel & !(mask << shift) | (new & mask) << shift)
                            });
                            self.write(batch, self.to, lane, old >> shift & mask);
                        }
                        Err(TrapCode::ImageOutOfBounds)
                            if !texel.traps_outside(LaneReader::new(&batch.registers, lane, bindings)) =>
                        {
                            self.write(batch, self.to, lane, 0);
                        }
                        Err(code) => {
                            texel.record_fault(batch, lane, bindings);
                            trap(batch, Mask::lane(lane), code);
                        }
                    }
                }
            }
            &AtomicTarget::Registers { first, index } => {
                for lane in batch.mask.lanes() {
                    let index = index.map_or(0, |index| batch.registers[index].0[lane]);
                    let at = match computed_register(&batch.registers, first, index, self.words()) {
                        Ok(at) => at,
                        Err(code) => {
                            trap(batch, Mask::lane(lane), code);
                            continue;
                        }
                    };
                    let old = self.read(batch, at, lane);
                    let (value, comparator) = self.operands(batch, lane);
                    self.write(batch, self.to, lane, old);
                    if let Some(new) = apply(self.kind, self.width, old, value, comparator) {
                        self.write(batch, at, lane, new);
                    }
                }
            }
        }
    }

    fn eval_buffer<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings, chunk: &Chunk) {
        let mut misaligned = Mask::NONE;
        let (to, value, comparator) = (self.to, self.value, self.comparator);
        let (width, wide) = (self.width, self.width == 64);
        let alignment = u64::from(self.alignment);
        for_each_access(
            batch,
            bindings,
            chunk,
            |registers, lane, buffer, offset| {
                // A view of a buffer may begin between two values of 64 bits.
                if !(buffer.offset() + offset).is_multiple_of(alignment) {
                    misaligned = misaligned | Mask::lane(lane);
                    return Some(());
                }
                let scalar = |reg: Reg| {
                    let high = if wide { registers[reg.plus(1)].0[lane] } else { 0 };
                    u64::from(registers[reg].0[lane]) | u64::from(high) << 32
                };
                let (value, comparator) = (scalar(value), scalar(comparator));
                let change = |old| apply(self.kind, self.width, old, value, comparator);
                let old = match self.width {
                    64 => buffer.update_wide(offset, change)?,
                    width => {
                        let shift = (offset % 4) as u32 * 8;
                        let mask = u32::MAX >> (32 - width);
                        let word = buffer.word(offset - offset % 4)?;
                        let part = |word: u32| u64::from(word >> shift & mask);
                        let merge = |word: u32| {
                            change(part(word))
                                .map(|new| word & !(mask << shift) | (new as u32 & mask) << shift)
                        };
                        part(word.fetch_update(Relaxed, Relaxed, merge).unwrap_or_else(|word| word))
                    }
                };
                registers[to].0[lane] = old as u32;
                if wide {
                    registers[to.plus(1)].0[lane] = (old >> 32) as u32;
                }
                Some(())
            },
            |registers, lane, _| {
                for word in 0..width.div_ceil(32) {
                    registers[to.plus(word)].0[lane] = 0;
                }
            },
        );
        for lane in misaligned.lanes() {
            batch.fault_value[lane] = fault_value(&batch.registers, lane, chunk);
        }
        trap(batch, misaligned, TrapCode::AtomicMisaligned);
    }

    fn operands<const W: usize>(&self, batch: &Batch<W>, lane: usize) -> (u64, u64) {
        (self.read(batch, self.value, lane), self.read(batch, self.comparator, lane))
    }

    fn read<const W: usize>(&self, batch: &Batch<W>, reg: Reg, lane: usize) -> u64 {
        let mut words = batch.registers.lane_words(reg, self.words(), lane);
        let low = u64::from(words.next().unwrap_or(0));
        low | u64::from(words.next().unwrap_or(0)) << 32
    }

    fn write<const W: usize>(&self, batch: &mut Batch<W>, reg: Reg, lane: usize, bits: u64) {
        let words = [bits as u32, (bits >> 32) as u32];
        batch.registers.set_lane_words(reg, lane, words.into_iter().take(self.words() as usize));
    }
}

/// The new value; `None` where memory stays as it is.
fn apply(kind: AtomicKind, width: u32, old: u64, value: u64, comparator: u64) -> Option<u64> {
    let mask = u64::MAX >> (64 - width);
    let signed = |bits: u64| (bits << (64 - width)) as i64 >> (64 - width);
    let choose = |new: bool| Some(if new { value } else { old });
    Some(match kind {
        AtomicKind::Load => return None,
        AtomicKind::Exchange => value,
        AtomicKind::CompareExchange => return (old == comparator).then_some(value),
        AtomicKind::Add => old.wrapping_add(value) & mask,
        AtomicKind::Sub => old.wrapping_sub(value) & mask,
        AtomicKind::SMin => return choose(signed(value) < signed(old)),
        AtomicKind::SMax => return choose(signed(value) > signed(old)),
        AtomicKind::UMin => old.min(value),
        AtomicKind::UMax => old.max(value),
        AtomicKind::And => old & value,
        AtomicKind::Or => old | value,
        AtomicKind::Xor => old ^ value,
        AtomicKind::FAdd | AtomicKind::FMin | AtomicKind::FMax => float(kind, width, old, value),
    })
}

/// Float sums are rounded once; minima and maxima prefer a number to a NaN, as `NMin` and `NMax`.
fn float(kind: AtomicKind, width: u32, old: u64, value: u64) -> u64 {
    macro_rules! at {
        ($ty:ty, $bits:ty) => {{
            let (a, b) = (<$ty>::from_bits(old as $bits), <$ty>::from_bits(value as $bits));
            let result = match kind {
                AtomicKind::FAdd => a + b,
                AtomicKind::FMin => {
                    if a.is_nan() || b < a {
                        b
                    } else {
                        a
                    }
                }
                _ => {
                    if a.is_nan() || a < b {
                        b
                    } else {
                        a
                    }
                }
            };
            // Every NaN is of one pattern: which operand's a sum keeps is the compiler's choice.
            let (low, high) = result.to_words();
            u64::from(low) | u64::from(high) << 32
        }};
    }
    match width {
        16 => at!(f16, u16),
        32 => at!(f32, u32),
        _ => at!(f64, u64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn updates_that_commute_leave_the_same_in_either_order() {
        use AtomicKind::*;
        let kinds = [
            Load,
            Exchange,
            CompareExchange,
            Add,
            Sub,
            SMin,
            UMin,
            SMax,
            UMax,
            And,
            Or,
            Xor,
            FAdd,
            FMin,
            FMax,
        ];
        // Numbers between which every kind can tell; as floats some are NaNs and of both signs.
        let samples = [0, 1, 7, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF, 0x3F80_0000, 0xC040_0000, 0x4B80_0001];
        let after = |kind, old, value| apply(kind, 32, old, value, 7).unwrap_or(old);
        for a in kinds {
            for b in kinds {
                let mut differ = 0;
                for start in samples {
                    for x in samples {
                        for y in samples {
                            let first = after(b, after(a, start, x), y);
                            differ += usize::from(first != after(a, after(b, start, y), x));
                        }
                    }
                }
                let commutes =
                    |a, b| Update { kind: a, width: 32 }.commutes_with(Update { kind: b, width: 32 });
                assert_eq!(commutes(a, b), commutes(b, a), "{a:?} {b:?}");
                if commutes(a, b) {
                    assert_eq!(differ, 0, "{a:?} and {b:?} do not commute");
                } else if [a, b].iter().all(|kind| ![FAdd, FMin, FMax].contains(kind)) {
                    assert_ne!(differ, 0, "{a:?} and {b:?} commute");
                }
            }
        }
        let update = |kind, width| Update { kind, width };
        // A carry out of the lower half of a wide sum is none of two narrow ones.
        assert!(!update(Add, 32).commutes_with(update(Add, 64)));
        assert!(!update(UMax, 16).commutes_with(update(UMax, 32)));
        assert!(update(Xor, 32).commutes_with(update(Xor, 64)));
    }

    #[test]
    fn the_new_value_of_every_kind() {
        let new = |kind, width, old, value| apply(kind, width, old, value, 7);
        assert_eq!(new(AtomicKind::Load, 32, 5, 9), None);
        assert_eq!(new(AtomicKind::Exchange, 32, 5, 9), Some(9));
        assert_eq!(new(AtomicKind::CompareExchange, 32, 5, 9), None);
        assert_eq!(new(AtomicKind::CompareExchange, 32, 7, 9), Some(9));
        assert_eq!(new(AtomicKind::Add, 32, 0xFFFF_FFFF, 2), Some(1));
        assert_eq!(new(AtomicKind::Add, 64, 0xFFFF_FFFF, 2), Some(0x1_0000_0001));
        assert_eq!(new(AtomicKind::Sub, 32, 0, 1), Some(0xFFFF_FFFF));
        assert_eq!(new(AtomicKind::SMin, 32, 1, 0xFFFF_FFFF), Some(0xFFFF_FFFF));
        assert_eq!(new(AtomicKind::SMax, 32, 1, 0xFFFF_FFFF), Some(1));
        assert_eq!(new(AtomicKind::UMin, 32, 1, 0xFFFF_FFFF), Some(1));
        assert_eq!(new(AtomicKind::UMax, 32, 1, 0xFFFF_FFFF), Some(0xFFFF_FFFF));
        assert_eq!(new(AtomicKind::SMin, 64, 1, u64::MAX), Some(u64::MAX));
        assert_eq!(new(AtomicKind::And, 32, 0b1100, 0b1010), Some(0b1000));
        assert_eq!(new(AtomicKind::Or, 32, 0b1100, 0b1010), Some(0b1110));
        assert_eq!(new(AtomicKind::Xor, 32, 0b1100, 0b1010), Some(0b0110));
        let bits = |value: f32| u64::from(value.to_bits());
        assert_eq!(new(AtomicKind::FAdd, 32, bits(1.5), bits(0.25)), Some(bits(1.75)));
        assert_eq!(new(AtomicKind::FMin, 32, bits(f32::NAN), bits(2.0)), Some(bits(2.0)));
        assert_eq!(new(AtomicKind::FMax, 32, bits(2.0), bits(f32::NAN)), Some(bits(2.0)));
        assert_eq!(new(AtomicKind::FAdd, 16, 0x3C00, 0x3C00), Some(0x4000)); // 1 + 1
        assert_eq!(new(AtomicKind::FAdd, 64, 1f64.to_bits(), 1f64.to_bits()), Some(2f64.to_bits()));
        // NaNs with payloads become the pattern that every instruction writes.
        for kind in [AtomicKind::FAdd, AtomicKind::FMin, AtomicKind::FMax] {
            assert_eq!(new(kind, 16, 0xFFFF, 0x7E01), Some(0x7E00));
            assert_eq!(new(kind, 32, 0xFFFF_FFFF, 0x7FC0_0001), Some(0x7FC0_0000));
            assert_eq!(new(kind, 64, u64::MAX, 0x7FF8_0000_0000_0001), Some(0x7FF8_0000_0000_0000));
        }
    }
}
