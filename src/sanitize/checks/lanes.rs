//! Which lanes and registers an operation touches: what several checks ask.

use crate::machine::{Batch, Mask, Reg, Registers};
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::memory::{BufferRef, Chunk, is_workgroup};

/// The registers that the words of a kernel's operands have.
pub(in crate::sanitize) fn operand_words<'a>(
    kernel: &'a LaneKernel,
    from: &'a [Reg; 3],
) -> impl Iterator<Item = (Reg, u32)> + 'a {
    from.iter().zip(kernel.operands).flat_map(|(&operand, words)| (0..words).map(move |word| (operand, word)))
}

/// The lanes in which a float is a NaN.
#[inline]
pub(in crate::sanitize) fn nan_lanes<const W: usize>(
    registers: &Registers<W>,
    first: Reg,
    width: u32,
) -> Mask<W> {
    let (low, high) =
        (&registers[first], if width == 64 { &registers[first.plus(1)] } else { &registers[first] });
    let is_nan = |lane: usize| match width {
        16 => low.0[lane] & 0x7FFF > 0x7C00,
        32 => low.0[lane] & 0x7FFF_FFFF > 0x7F80_0000,
        _ => (u64::from(high.0[lane] & 0x7FFF_FFFF) << 32 | u64::from(low.0[lane])) > 0x7FF0_0000_0000_0000,
    };
    // Most often there is none, which a loop without branches finds out.
    let any = match width {
        32 => low.0.iter().fold(0, |any, word| any | u32::from(word & 0x7FFF_FFFF > 0x7F80_0000)) != 0,
        _ => true,
    };
    if any { Mask::from_fn(is_nan) } else { Mask::NONE }
}

/// The elements that a computed index selects, by lane and word.
pub(in crate::sanitize) fn each_element<const W: usize>(
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
pub(in crate::sanitize) fn workgroup_lanes<const W: usize>(batch: &Batch<W>, chunk: &Chunk) -> Mask<W> {
    match chunk.buffer {
        BufferRef::Workgroup => batch.mask,
        BufferRef::Computed(_) => {
            batch.mask & Mask::from_fn(|lane| is_workgroup(&batch.registers, lane, chunk.buffer))
        }
        _ => Mask::NONE,
    }
}
