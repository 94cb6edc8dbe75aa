//! Points at which rays have hit surfaces, and whether another ray begins at one.

use std::sync::Arc;

use anyhit_engine::accel::rules::{is_skipped, is_visible};
use anyhit_engine::accel::{HitPrimitive, Tlas, TraceRay};

/// How far from a hit point an origin counts as on the surface, relative to the greatest coordinate
/// that enters it.
///
/// With unit roundoff u = 2^-24, origin + t * direction in f32 is off by 3u of that coordinate: t,
/// the product and the sum are rounded once each. A point that is interpolated from vertices and
/// transformed to world space has a few roundings more. Eight units hold both, and an offset that
/// is meant to leave the surface is larger.
const ROUNDING: f64 = 8.0 * (f32::EPSILON as f64 / 2.0);

/// A point at which a ray has hit a surface, in world space.
#[derive(Clone, Debug)]
pub(super) struct SurfacePoint {
    tlas: Arc<Tlas>,
    /// The primitive that was hit.
    pub hit: HitPrimitive,
    point: [f64; 3],
    /// The greatest coordinate of the ray's origin, of its way to the hit and of the point.
    magnitude: f64,
}

impl SurfacePoint {
    /// The point at `t` of a ray that has hit a primitive there.
    pub(super) fn new(tlas: &Arc<Tlas>, trace: &TraceRay, hit: HitPrimitive, t: f32) -> Self {
        let origin = trace.ray.origin.map(f64::from);
        let way = trace.ray.direction.map(|component| f64::from(component) * f64::from(t));
        let point = [0, 1, 2].map(|axis| origin[axis] + way[axis]);
        let magnitude = greatest(origin).max(greatest(way)).max(greatest(point));
        Self { tlas: tlas.clone(), hit, point, magnitude }
    }

    /// Returns whether a ray begins at this point, up to rounding, with a t_min of 0, and could hit
    /// the same primitive again: neither its mask nor its flags leave the primitive out.
    pub(super) fn is_origin_of(&self, tlas: &Arc<Tlas>, trace: &TraceRay) -> bool {
        if trace.ray.t_min != 0.0 || !Arc::ptr_eq(&self.tlas, tlas) {
            return false;
        }
        let Some(instance) = tlas.instances().get(self.hit.instance as usize) else { return false };
        let is_seen = is_visible(instance.mask, trace.cull_mask)
            && instance.blas.kind().is_none_or(|kind| !is_skipped(trace.flags, kind));
        let origin = trace.ray.origin.map(f64::from);
        let off = [0, 1, 2].map(|axis| origin[axis] - self.point[axis]);
        let distance = off.iter().map(|x| x * x).sum::<f64>().sqrt();
        is_seen && distance <= ROUNDING * self.magnitude.max(greatest(origin))
    }
}

/// The greatest magnitude of a vector's components.
fn greatest(vector: [f64; 3]) -> f64 {
    vector.into_iter().fold(0.0, |greatest, component| greatest.max(component.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::accel::{Blas, Geometry, GeometryData, GeometryFlags, RayFlags, TlasInstance};
    use anyhit_engine::geometry::Ray;

    fn structure(mask: u8) -> Arc<Tlas> {
        let vertices = vec![[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]];
        let data = GeometryData::Triangles { vertices, indices: None, transform: None };
        let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::default())]).expect("a triangle");
        let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        Tlas::new(vec![TlasInstance { mask, ..TlasInstance::of(blas, identity) }]).expect("an instance")
    }

    fn ray(origin: [f32; 3], t_min: f32) -> TraceRay {
        let ray = Ray { origin, t_min, direction: [0.0, 0.0, 1.0], t_max: 100.0 };
        TraceRay { ray, flags: RayFlags::default(), cull_mask: 0xFF, time: 0.0 }
    }

    #[test]
    fn an_origin_at_the_hit_point_counts_and_one_beside_it_does_not() {
        let tlas = structure(0xFF);
        let hit = HitPrimitive { instance: 0, geometry: 0, primitive: 0 };
        let mut down = ray([1.0, 0.0, 3.0], 0.0);
        down.ray.direction = [0.0, 0.0, -1.0];
        let point = SurfacePoint::new(&tlas, &down, hit, 3.0);
        let is_origin = |origin, t_min| point.is_origin_of(&tlas, &ray(origin, t_min));
        assert!(is_origin([1.0, 0.0, 0.0], 0.0));
        // Two units in the last place of 3, the coordinate that was rounded.
        assert!(is_origin([1.0, 0.0, 2.0 * 2f32.powi(-22)], 0.0));
        assert!(!is_origin([1.0, 0.0, 1e-5], 0.0));
        assert!(!is_origin([1.0, 0.0, 0.0], 1e-6));
        assert!(!is_origin([0.0, 0.0, 0.0], 0.0));
    }

    #[test]
    fn a_ray_that_cannot_hit_the_surface_again_is_no_danger() {
        let tlas = structure(1);
        let hit = HitPrimitive { instance: 0, geometry: 0, primitive: 0 };
        let point = SurfacePoint::new(&tlas, &ray([0.0, 0.0, -3.0], 0.0), hit, 3.0);
        let at = ray([0.0; 3], 0.0);
        assert!(point.is_origin_of(&tlas, &at));
        assert!(!point.is_origin_of(&tlas, &TraceRay { cull_mask: 2, ..at }));
        assert!(!point.is_origin_of(&tlas, &TraceRay { flags: RayFlags::SKIP_TRIANGLES, ..at }));
        assert!(!point.is_origin_of(&structure(1), &at));
    }
}
