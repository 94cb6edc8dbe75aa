//! Boxes scaled into the unit cube.
//!
//! The power of two is exact for nearly all boxes; others are rounded outwards.

use crate::accel::build_threads::{BuildThreads, CHUNK};
use crate::accel::prim_ref::{INFINITY_PROXY, PrimRef};
use crate::accel::trav_ray::{round_down, round_up};
use crate::geometry::Bounds;
use crate::math::array;
use crate::math::f32x4::F32x4;

/// Scales boxes into the unit cube; returns the box around all as it was, and the scale.
pub(super) fn scale_boxes(prim_refs: &mut [PrimRef], threads: BuildThreads) -> (Bounds, f64) {
    let bounds = bounds_around(prim_refs, threads);
    let scale = scale_of(prim_refs, &bounds);
    threads.map(prim_refs.chunks_mut(CHUNK).collect(), |chunk: &mut [PrimRef]| {
        chunk.iter_mut().for_each(|prim_ref| *prim_ref = scaled(prim_ref, scale));
    });
    (bounds, scale)
}

/// The box around all boxes.
pub(super) fn bounds_around(prim_refs: &[PrimRef], threads: BuildThreads) -> Bounds {
    let around = |chunk: &[PrimRef]| chunk.iter().fold(PrimRef::EMPTY, |all, one| all.union(one));
    let of_chunks = threads.map(prim_refs.chunks(CHUNK).collect(), around);
    of_chunks.iter().fold(PrimRef::EMPTY, |all, one| all.union(one)).bounds()
}

/// The power of two that brings every finite coordinate of boxes into the unit cube.
fn scale_of(boxes: &[PrimRef], around: &Bounds) -> f64 {
    let sides = |one: &Bounds| {
        let sides = one.min.iter().chain(&one.max).map(|x| x.abs());
        sides.filter(|x| x.is_finite()).fold(0.0f32, f32::max)
    };
    let finite = around.min.iter().chain(&around.max).all(|x| x.is_finite());
    let largest =
        if finite { sides(around) } else { boxes.iter().map(|one| sides(&one.bounds())).fold(0.0, f32::max) };
    if largest == 0.0 {
        return 1.0;
    }
    // Between 2^-149 and 2^128, so that its reciprocal is a normal f64.
    let mut power = 1.0f64;
    while power < f64::from(largest) {
        power *= 2.0;
    }
    while power * 0.5 >= f64::from(largest) {
        power *= 0.5;
    }
    1.0 / power
}

/// A box in scaled units, rounded outwards; infinite sides lie at ±[`INFINITY_PROXY`].
#[inline]
pub(super) fn scaled(prim_ref: &PrimRef, scale: f64) -> PrimRef {
    let factor = scale as f32;
    let corners = [prim_ref.low(), prim_ref.negated_high()];
    let scaled = array::map(corners, |corner| corner * F32x4::splat(factor));
    // Exact where no number is infinite or subnormal.
    let exact = |corner: F32x4, scaled: F32x4| {
        let normal = scaled.abs().cmp_ge(F32x4::splat(f32::MIN_POSITIVE));
        let zero = F32x4::ZERO.cmp_ge(corner.abs());
        F32x4::splat(1.0).cmp_ge(scaled.abs()) & (normal | zero)
    };
    if factor.is_normal() && exact(corners[0], scaled[0]) & exact(corners[1], scaled[1]) & 0b111 == 0b111 {
        return PrimRef::from_corners(scaled, prim_ref.number());
    }
    let inside = |x: f32| if x.is_finite() { x } else { INFINITY_PROXY.copysign(x) };
    let Bounds { min, max } = prim_ref.bounds();
    let min = array::map(min, |x| inside(round_down(f64::from(x) * scale)));
    let max = array::map(max, |x| inside(round_up(f64::from(x) * scale)));
    PrimRef::new(&Bounds { min, max }, prim_ref.number())
}
