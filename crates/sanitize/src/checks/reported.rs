//! Where along its ray an intersection shader reports a hit.

use crate::rule::trace;
use crate::sanitizer::Sanitizer;
use anyhit_engine::accel::Primitive;
use anyhit_engine::geometry::ObjectRay;
use anyhit_engine::machine::{Batch, Mask, OpIndex, Reg};

/// How far beside the box a hit may lie, as part of the ray's length in the box and of t: shaders
/// compute with floats.
const TOLERANCE: f64 = 1.0 / 1024.0;

/// Tells of reports at a t at which the ray is not within the box of the candidate.
pub(super) fn check<const W: usize>(sanitizer: &mut Sanitizer<'_>, batch: &Batch<W>, op: OpIndex, t: Reg) {
    let reported = |lane: usize| f32::from_bits(batch.registers[t].0[lane]);
    // Others are refused, and have no effect.
    let counts = |lane: usize| {
        let (t, ray) = (reported(lane), batch.invocations.rays.get(lane).ray);
        t >= ray.t_min && t <= batch.invocations.t_max(lane)
    };
    let is_outside = |lane: usize| {
        counts(lane) && span(batch, lane).is_some_and(|span| lies_outside(reported(lane), span))
    };
    let outside = batch.mask.lanes().filter(|&lane| is_outside(lane));
    let outside = outside.fold(Mask::NONE, |mask, lane| mask | Mask::lane(lane));
    sanitizer.tell(batch, &trace::REPORT_OUTSIDE_BOX, op, outside, |lane| {
        let [enters, leaves] = span(batch, lane).unwrap_or_default();
        format!(
            "an intersection is reported at t = {:?}, and the ray is in its box from {:?} to {:?}",
            reported(lane),
            enters as f32,
            leaves as f32
        )
    });
}

/// Whether a t lies outside of a span, by more than rounding explains.
fn lies_outside(t: f32, [enters, leaves]: [f64; 2]) -> bool {
    let t = f64::from(t);
    let tolerance = TOLERANCE * (leaves - enters + t.abs());
    t < enters - tolerance || t > leaves + tolerance
}

/// Where the ray of a lane enters the box of its candidate, and where it leaves it; `None` where
/// the candidate is no box, as in a test that runs an intersection shader by itself.
fn span<const W: usize>(batch: &Batch<W>, lane: usize) -> Option<[f64; 2]> {
    let invocations = &batch.invocations;
    let hits = &invocations.hits;
    let [instance, geometry, primitive] =
        [&hits.instance, &hits.geometry, &hits.primitive].map(|word| word.0[lane]);
    let (tlas, trace) = (invocations.structures.get(lane)?, invocations.rays.get(lane));
    let blas = &tlas.instances().get(instance as usize)?.blas;
    let Primitive::Aabb(corners) = blas.primitive(geometry, primitive, trace.time)? else { return None };
    let ray = tlas.object_ray(instance, &trace.ray, trace.time)?;
    Some(slab_span(&ray, &corners))
}

/// Where a ray enters the box of six corners, and where it leaves it. Of a ray that just misses it,
/// where it leaves the slab of one axis, and then enters that of another.
fn slab_span(ray: &ObjectRay, corners: &[f32; 6]) -> [f64; 2] {
    let [origin, direction] = [ray.object_origin_f32(), ray.object_direction_f32()];
    let [mut enters, mut leaves] = [f64::NEG_INFINITY, f64::INFINITY];
    for axis in (0..3).filter(|&axis| direction[axis] != 0.0) {
        let plane = |corner: f32| (f64::from(corner) - f64::from(origin[axis])) / f64::from(direction[axis]);
        let [first, second] = [plane(corners[axis]), plane(corners[axis + 3])];
        enters = enters.max(first.min(second));
        leaves = leaves.min(first.max(second));
    }
    [enters.min(leaves), leaves.max(enters)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::geometry::Ray;

    #[test]
    fn a_hit_beside_its_box_is_outside_by_more_than_rounding_explains() {
        let outside = |t: f32| lies_outside(t, [4.0, 6.0]);
        assert_eq!(
            [3.5, 3.99, 4.0, 5.0, 6.0, 6.007, 6.01].map(outside),
            [true, true, false, false, false, false, true]
        );
        // A NaN is no place along the ray: `report-nan-t` tells of it.
        assert!(!outside(f32::NAN));
    }

    #[test]
    fn a_ray_is_in_a_box_between_its_slabs() {
        let span = |origin: [f32; 3], direction: [f32; 3]| {
            let ray = ObjectRay::in_world(&Ray::new(origin, direction)).expect("a ray");
            slab_span(&ray, &[-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])
        };
        assert_eq!(span([0.0, 5.0, 0.0], [0.0, -1.0, 0.0]), [4.0, 6.0]);
        assert_eq!(span([0.5, 5.0, 0.0], [0.0, -2.0, 0.0]), [2.0, 3.0]);
        assert_eq!(span([-3.0, 0.0, 0.0], [1.0, 0.25, 0.0]), [2.0, 4.0]);
        // Past an edge: it leaves the slab of x before it enters that of y.
        assert_eq!(span([-3.0, -3.0, 0.0], [1.0, 0.25, 0.0]), [4.0, 8.0]);
    }
}
