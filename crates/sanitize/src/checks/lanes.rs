//! Which lanes and registers an operation touches: what several checks ask.

use crate::word_range::WordRange;
use anyhit_engine::machine::{Batch, Mask, Reg, Registers};
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_engine::ops::memory::{BufferRef, Chunk, is_workgroup};

/// The registers that the words of a kernel's operands have.
pub(crate) fn operand_words<'a>(
    kernel: &'a LaneKernel,
    from: &'a [Reg; 3],
) -> impl Iterator<Item = (Reg, u32)> + 'a {
    from.iter().zip(kernel.operands).flat_map(|(&operand, words)| (0..words).map(move |word| (operand, word)))
}

/// The lanes in which a float is a NaN.
#[inline]
pub(crate) fn nan_lanes<const W: usize>(registers: &Registers<W>, first: Reg, width: u32) -> Mask<W> {
    let (low, high) =
        (&registers[first], if width == 64 { &registers[first.plus(1)] } else { &registers[first] });
    let is_nan = |lane: usize| match width {
        16 => low.0[lane] & 0x7FFF > 0x7C00,
        32 => low.0[lane] & 0x7FFF_FFFF > 0x7F80_0000,
        _ => (u64::from(high.0[lane] & 0x7FFF_FFFF) << 32 | u64::from(low.0[lane])) > 0x7FF0_0000_0000_0000,
    };
    // Most often there is none, which a loop without branches finds out.
    if width != 32 || WordRange::NAN.meets(low) { Mask::from_fn(is_nan) } else { Mask::NONE }
}

/// The lanes in which a float is infinite.
pub(crate) fn infinite_lanes<const W: usize>(registers: &Registers<W>, first: Reg, width: u32) -> Mask<W> {
    let low = &registers[first];
    match width {
        16 => Mask::from_fn(|lane| low.0[lane] & 0x7FFF == 0x7C00),
        32 => Mask::from_fn(|lane| low.0[lane] & 0x7FFF_FFFF == 0x7F80_0000),
        _ => {
            let high = &registers[first.plus(1)];
            Mask::from_fn(|lane| high.0[lane] & 0x7FFF_FFFF == 0x7FF0_0000 && low.0[lane] == 0)
        }
    }
}

/// The lanes in which a float is a NaN or infinite.
#[inline]
pub(crate) fn special_lanes<const W: usize>(registers: &Registers<W>, first: Reg, width: u32) -> Mask<W> {
    let high = &registers[if width == 64 { first.plus(1) } else { first }];
    let exponent = match width {
        16 => 0x7C00,
        32 => 0x7F80_0000,
        _ => 0x7FF0_0000,
    };
    // Most often there is none, which a loop without branches finds out.
    let any = high.0.iter().fold(0, |any, word| any | u32::from(word & exponent == exponent)) != 0;
    if any { Mask::from_fn(|lane| high.0[lane] & exponent == exponent) } else { Mask::NONE }
}

/// The elements that a computed index selects, by lane and word.
pub(crate) fn each_element<const W: usize>(
    batch: &Batch<W>,
    first: Reg,
    index: Reg,
    count: u32,
    mut visit: impl FnMut(usize, u32, Reg),
) {
    for lane in batch.mask.lanes() {
        let element = first.computed(batch.registers[index].0[lane]);
        if u64::from(element.0) + u64::from(count) > batch.registers.len() as u64 {
            continue;
        }
        (0..count).for_each(|word| visit(lane, word, element.plus(word)));
    }
}

/// The lanes whose access is to the memory of their workgroup.
#[inline]
pub(crate) fn workgroup_lanes<const W: usize>(batch: &Batch<W>, chunk: &Chunk) -> Mask<W> {
    match chunk.buffer {
        BufferRef::Workgroup => batch.mask,
        BufferRef::Computed(_) => {
            batch.mask & Mask::from_fn(|lane| is_workgroup(&batch.registers, lane, chunk.buffer))
        }
        _ => Mask::NONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinities_of_each_width() {
        let mut registers = Registers::<4>::new(2);
        let lanes = |registers: &Registers<4>, width| infinite_lanes(registers, Reg(0), width);
        for (lane, value) in [1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN].into_iter().enumerate() {
            registers.set_lane_words(Reg(0), lane, [value.to_bits()]);
        }
        assert_eq!(lanes(&registers, 32), Mask::lane(1) | Mask::lane(2));
        assert_eq!(special_lanes(&registers, Reg(0), 32), Mask::lane(1) | Mask::lane(2) | Mask::lane(3));
        for (lane, value) in [1.0, f64::INFINITY, f64::NAN, f64::MAX].into_iter().enumerate() {
            let bits = value.to_bits();
            registers.set_lane_words(Reg(0), lane, [bits as u32, (bits >> 32) as u32]);
        }
        assert_eq!(lanes(&registers, 64), Mask::lane(1));
        assert_eq!(special_lanes(&registers, Reg(0), 64), Mask::lane(1) | Mask::lane(2));
        for (lane, bits) in [0x3C00, 0x7C00, 0xFC00, 0x7C01].into_iter().enumerate() {
            registers.set_lane_words(Reg(0), lane, [bits]);
        }
        assert_eq!(lanes(&registers, 16), Mask::lane(1) | Mask::lane(2));
        assert_eq!(special_lanes(&registers, Reg(0), 16), Mask::lane(1) | Mask::lane(2) | Mask::lane(3));
    }
}
