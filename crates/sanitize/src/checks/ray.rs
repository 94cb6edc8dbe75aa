//! Rules about the operands of traces and ray queries that are no traps: those of undefined values,
//! and lints on bits that are cut in silence.

use crate::checks::births;
use crate::checks::lanes::nan_lanes;
use crate::report::Sink;
use crate::report::specials::SpecialSink;
use crate::rule::trace;
use crate::sanitizer::Sanitizer;
use anyhit_engine::accel::RayFlags;
use anyhit_engine::machine::{Batch, Lanes, Mask, OpIndex, Reg, ShadowRegisters};
use anyhit_engine::ops::ray_tracing::TRACE_OPERANDS;

/// The ray flags of SPIR-V, "Ray Flags", all together.
const RAY_FLAGS: u32 = 0x7FF;

/// The names of a trace's operands, by word.
const OPERANDS: [&str; TRACE_OPERANDS as usize] = [
    "acceleration structure",
    "acceleration structure",
    "flags",
    "cull mask",
    "SBT offset",
    "SBT stride",
    "miss index",
    "origin",
    "origin",
    "origin",
    "t min",
    "direction",
    "direction",
    "direction",
    "t max",
    "time",
];

/// Checks the operands of a trace, which lie in consecutive registers.
pub(crate) fn check_trace<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
    operands: Reg,
) {
    for (word, name) in (0..).zip(OPERANDS) {
        sanitizer.depend(batch, shadow, op, operands.plus(word), Sink::Ray(name));
    }
    check_address(sanitizer, batch, op, operands);
    check_specials(sanitizer, batch, shadow, op, operands.plus(7));
    check_flags_and_mask(sanitizer, batch, op, operands.plus(2));
    let word = |at: u32, lane: usize| batch.registers[operands.plus(at)].0[lane];
    let above = |at: u32, most: u32| batch.mask & Mask::from_fn(|lane| word(at, lane) > most);
    for (at, name) in [(4, "SBT offset"), (5, "SBT stride")] {
        sanitizer.tell(batch, &trace::RAY_SBT_BITS, op, above(at, 15), |lane| {
            let value = word(at, lane);
            format!("the {name} of a ray is {value}, of which only the 4 lowest bits count: {}", value & 15)
        });
    }
    sanitizer.tell(batch, &trace::RAY_MISS_BITS, op, above(6, 0xFFFF), |lane| {
        let value = word(6, lane);
        format!(
            "the miss index of a ray is {value}, of which only the 16 lowest bits count: {}",
            value & 0xFFFF
        )
    });
    check_direction(sanitizer, batch, op, operands.plus(11));
}

/// Reports NaNs and infinities that shaders have made and that end in a ray, whose operands lie in
/// consecutive registers from the origin on. That such a ray is traced is an error of its own.
pub(crate) fn check_specials<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    op: OpIndex,
    origin: Reg,
) {
    for (word, name) in (0..).zip(&OPERANDS[7..15]) {
        let register = origin.plus(word);
        // A ray may go on without end.
        let lanes = match *name {
            "t max" => batch.mask & nan_lanes(&batch.registers, register, 32),
            _ => batch.mask,
        };
        births::reach(sanitizer, batch, shadow, op, register, lanes, SpecialSink::Ray(name));
    }
}

/// Checks the operands of `OpRayQueryInitializeKHR`, which lie in consecutive registers.
pub(crate) fn check_query<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
    operands: Reg,
) {
    let names = OPERANDS[..4].iter().chain(&OPERANDS[7..15]);
    for (word, name) in (0..).zip(names) {
        sanitizer.depend(batch, shadow, op, operands.plus(word), Sink::Ray(name));
    }
    check_address(sanitizer, batch, op, operands);
    check_flags_and_mask(sanitizer, batch, op, operands.plus(2));
    check_direction(sanitizer, batch, op, operands.plus(8));
}

/// The flags that skip triangles or boxes.
const SKIPS: u32 = RayFlags::SKIP_TRIANGLES.0 | RayFlags::SKIP_AABBS.0;
/// `RayTraversalPrimitiveCullingKHR`
const RAY_TRAVERSAL_PRIMITIVE_CULLING: u32 = 4478;

/// Checks that the module of a ray that skips primitives declares the capability.
fn check_skips<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    flags: &Lanes<W>,
) {
    let Some((_, plan)) = sanitizer.plan() else { return };
    if plan.program.module.capabilities.contains(&RAY_TRAVERSAL_PRIMITIVE_CULLING) {
        return;
    }
    let skipping = batch.mask & Mask::from_fn(|lane| flags.0[lane] & SKIPS != 0);
    sanitizer.tell(batch, &trace::RAY_SKIP_CAPABILITY, op, skipping, |lane| {
        let skips = if flags.0[lane] & RayFlags::SKIP_TRIANGLES.0 != 0 { "triangles" } else { "boxes" };
        format!("a ray skips {skips}, and the module does not declare RayTraversalPrimitiveCullingKHR")
    });
}

/// Checks that the address of an acceleration structure, in two registers, is not 0.
fn check_address<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    structure: Reg,
) {
    let words = [0, 1].map(|word| &batch.registers[structure.plus(word)]);
    let zero = batch.mask & Mask::from_fn(|lane| words.iter().all(|word| word.0[lane] == 0));
    sanitizer.tell(batch, &trace::RAY_ADDRESS_HANDLE, op, zero, |_| {
        "the device address of a ray's acceleration structure is 0".to_owned()
    });
}

/// Checks ray flags and the cull mask, which follows them.
fn check_flags_and_mask<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    flags: Reg,
) {
    let [flags, mask] = [&batch.registers[flags], &batch.registers[flags.plus(1)]];
    check_skips(sanitizer, batch, op, flags);
    let unknown = batch.mask & Mask::from_fn(|lane| flags.0[lane] & !RAY_FLAGS != 0);
    sanitizer.tell(batch, &trace::RAY_UNKNOWN_FLAG, op, unknown, |lane| {
        format!(
            "the flags of a ray are {:#x}, whose bits {:#x} no flag has",
            flags.0[lane],
            flags.0[lane] & !RAY_FLAGS
        )
    });
    let cut = batch.mask & Mask::from_fn(|lane| mask.0[lane] > 0xFF || mask.0[lane] == 0);
    sanitizer.tell(batch, &trace::RAY_MASK_BITS, op, cut, |lane| match mask.0[lane] {
        0 => "the cull mask of a ray is 0: it meets no instance".to_owned(),
        value => {
            format!(
                "the cull mask of a ray is {value:#x}, of which only the 8 lowest bits count: {:#x}",
                value & 0xFF
            )
        }
    });
}

/// Checks the direction of a ray, in three registers.
fn check_direction<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    direction: Reg,
) {
    let component = |axis: u32, lane: usize| f32::from_bits(batch.registers[direction.plus(axis)].0[lane]);
    let square = |lane: usize| (0..3).map(|axis| component(axis, lane) * component(axis, lane)).sum::<f32>();
    let degenerate = batch.mask
        & Mask::from_fn(|lane| {
            let square = square(lane);
            square < f32::MIN_POSITIVE || square == f32::INFINITY
        });
    sanitizer.tell(batch, &trace::RAY_ZERO_DIRECTION, op, degenerate, |lane| {
        let [x, y, z] = [0, 1, 2].map(|axis| component(axis, lane));
        format!(
            "the direction of a ray is ({x:?}, {y:?}, {z:?}), the square of whose length is {:?}",
            square(lane)
        )
    });
}
