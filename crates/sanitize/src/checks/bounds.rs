//! Values that go beyond an array, and accesses that only robustness keeps inside.

use crate::cause::{Cause, CauseDetails, OpPlace};
use crate::checks::lanes::workgroup_lanes;
use crate::plan::Watched;
use crate::rule::{image, memory};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Bindings, Mask, NO_CAUSE, OpIndex, Reg, ShadowRegisters};
use anyhit_engine::ops::image::ImageOp;
use anyhit_engine::ops::image::reader::LaneReader;
use anyhit_engine::ops::image::texel_ref::TexelRef;
use anyhit_engine::ops::memory::{BufferRef, Chunk, Length, MemoryOp, OUT_OF_BOUNDS, access_location};
use anyhit_engine::ops::op::Op;
use anyhit_engine::program::Program;

/// A kernel has run whose operands are watched.
pub(crate) fn check_kernel<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    op: OpIndex,
    watched: Watched,
    to: Reg,
    from: &[Reg; 3],
) {
    let registers = &batch.registers;
    match watched {
        Watched::LengthMinus => {
            let is_empty = |lane: usize| registers[from[0]].0[lane] == 0 && registers[from[1]].0[lane] != 0;
            let lanes = batch.mask & Mask::from_fn(is_empty);
            sanitizer.tell(batch, &memory::RUNTIME_ARRAY_LENGTH, op, lanes, |lane| {
                format!("the length 0 of an array minus {} wraps around", registers[from[1]].0[lane])
            });
        }
        Watched::Allocation { counter } => {
            let limit = from[1 - counter];
            let is_beyond = |lane: usize| registers[from[counter]].0[lane] >= registers[limit].0[lane];
            let lanes = batch.mask & Mask::from_fn(is_beyond);
            sanitizer.tell(batch, &memory::ATOMIC_COUNTER_OVERFLOW, op, lanes, |lane| {
                let (given, limit) = (registers[from[counter]].0[lane], registers[limit].0[lane]);
                format!("the counter has given out element {given} of {limit}, and goes on")
            });
        }
        Watched::Address { is_chain } => {
            let bases = if is_chain { &from[..1] } else { &from[..2] };
            for &base in bases {
                check_address(sanitizer, batch, bindings, op, is_chain, to, base);
            }
        }
    }
}

/// An address is computed from another one.
fn check_address<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    op: OpIndex,
    is_chain: bool,
    to: Reg,
    from: Reg,
) {
    let address = |first: Reg, lane: usize| {
        u64::from(batch.registers[first].0[lane]) | u64::from(batch.registers[first.plus(1)].0[lane]) << 32
    };
    // The buffer, and the offset there, which may be one past its end.
    let buffer_at = |address: u64| {
        let (base, buffer, name) = bindings.memory.nearest_buffer(address)?;
        let offset = address.checked_sub(base).filter(|&offset| offset <= buffer.size())?;
        Some((base, offset, buffer.size(), name.map_or("a buffer", |name| name)))
    };
    for lane in batch.mask.lanes() {
        let (start, end) = (address(from, lane), address(to, lane));
        let Some((base, _, size, name)) = buffer_at(start) else { continue };
        if end.checked_sub(base).is_some_and(|offset| offset <= size) {
            continue;
        }
        let (rule, message) = match (is_chain, buffer_at(end)) {
            (true, _) => {
                let distance = end.wrapping_sub(base) as i64;
                let message = format!("an element at offset {distance} of `{name}`, which has {size} bytes");
                (&memory::PTR_CHAIN_RANGE, message)
            }
            (false, Some((_, offset, size, other))) if offset < size => {
                let message = format!(
                    "an address in `{name}` becomes one in `{other}`, at offset {offset} of its {size} bytes"
                );
                (&memory::ADDRESS_WRONG_BUFFER, message)
            }
            _ => continue,
        };
        sanitizer.tell(batch, rule, op, Mask::lane(lane), |_| message);
    }
}

/// A load, store or atomic instruction has run, which robustness may have kept inside its buffer.
pub(crate) fn check_buffer<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    op: OpIndex,
    chunk: &Chunk,
) {
    if !bindings.is_robust() || matches!(chunk.buffer, BufferRef::Address(_)) {
        return;
    }
    for lane in batch.mask.without(workgroup_lanes(batch, chunk)).lanes() {
        let handle = match chunk.buffer {
            BufferRef::Handle(handle) => handle,
            BufferRef::Computed(handle) => batch.registers[handle].0[lane],
            _ => continue,
        };
        let Some(buffer) = bindings.buffer(handle).filter(|buffer| !buffer.is_null()) else { continue };
        if access_location(batch, lane, bindings, chunk).is_some() {
            continue;
        }
        let index = chunk.index.map_or(0, |index| batch.registers[index].0[lane]);
        let Some((_, plan)) = sanitizer.plan() else { return };
        let name = plan.program.describe_descriptor(handle).unwrap_or_else(|| "a buffer".to_owned());
        if index == OUT_OF_BOUNDS
            && let Some((index, length)) = declared_index(batch, lane, &plan.program, chunk)
        {
            let message = format!("index {index} of an array with {length} elements in {name}");
            sanitizer.tell(batch, &memory::DECLARED_ARRAY_BOUNDS, op, Mask::lane(lane), |_| message);
            continue;
        }
        let size = buffer.size();
        let message = match index {
            OUT_OF_BOUNDS => format!("robust access masks an index beyond {name}, which has {size} bytes"),
            index => {
                let (offset, bytes) =
                    (u64::from(chunk.offset) + u64::from(index), chunk.width / 8 * chunk.count);
                format!(
                    "robust access masks {bytes} bytes at offset {offset} of {name}, which has {size} bytes"
                )
            }
        };
        sanitizer.tell(batch, &memory::ROBUST_MASK, op, Mask::lane(lane), |_| message);
    }
}

/// The index outside an array of declared length that a lane accesses, and the length.
fn declared_index<const W: usize>(
    batch: &Batch<W>,
    lane: usize,
    program: &Program,
    chunk: &Chunk,
) -> Option<(u32, u32)> {
    let indices = program.ops.iter().enumerate().filter_map(|(at, op)| match op {
        Op::Memory(MemoryOp::Index { to, length: Length::Known(length), .. }) if Some(*to) == chunk.index => {
            let (time, index) = batch.out_of_bounds_indices.last(OpIndex(at as u32), lane)?;
            Some((time, index, *length))
        }
        _ => None,
    });
    let (_, index, length) = indices.max_by_key(|&(time, ..)| time)?;
    (index >= length).then_some((index, length))
}

/// An image operation has run, which may have been outside its image.
pub(crate) fn check_image<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    image: &ImageOp,
) {
    match image {
        ImageOp::Read(read) => {
            let access = TexelAccess {
                texel: &read.texel,
                to: Some((read.to.to, read.to.registers())),
                writes: false,
            };
            check_texel(sanitizer, batch, bindings, shadow, place, access);
        }
        ImageOp::Write(write) => {
            let access = TexelAccess { texel: &write.texel, to: None, writes: true };
            check_texel(sanitizer, batch, bindings, shadow, place, access);
        }
        _ => {}
    }
}

/// An access to a texel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TexelAccess<'a> {
    pub texel: &'a TexelRef,
    /// The first register of what is read, and how many there are.
    pub to: Option<(Reg, u32)>,
    pub writes: bool,
}

/// An access to a texel has run: outside its image what is read is undefined, and a write has no
/// effect.
pub(crate) fn check_texel<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    access: TexelAccess<'_>,
) {
    let TexelAccess { texel, to, writes } = access;
    let Some((_, plan)) = sanitizer.plan() else { return };
    for lane in batch.mask.lanes() {
        let reader = LaneReader::new(&batch.registers, lane, bindings);
        let is_null = || reader.image(texel.view, texel.image).is_ok_and(|image| image.is_null());
        if texel.resolve(reader).is_ok() || is_null() {
            continue;
        }
        let outside = || {
            let described = plan.program.describe_texel(&texel.fault(reader));
            described.unwrap_or_else(|| "a texel outside its image".to_owned())
        };
        if bindings.is_robust() {
            sanitizer.tell(batch, &memory::ROBUST_MASK, place.op, Mask::lane(lane), |_| {
                format!("robust access masks {}", outside())
            });
            continue;
        }
        if writes {
            sanitizer.tell(batch, &image::IMAGE_WRITE_BOUNDS, place.op, Mask::lane(lane), |_| {
                format!("a write to {}, has no effect", outside())
            });
        }
        if let Some((first, count)) = to {
            let rule = &image::IMAGE_READ_BOUNDS;
            let number = sanitizer.cause(Cause::Broken { place, rule: rule.id }, || {
                Some(CauseDetails { rule, message: format!("a read of {}", outside()), operand: NO_CAUSE })
            });
            shadow.undefine_span(first, count, Mask::lane(lane), number);
        }
    }
}
