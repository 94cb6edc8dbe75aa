//! Reads `ray.*`, and traces each ray as the shaders of the recording do.

use crate::recording::Recording;
use crate::recording::tensors::Tensors;
use anyhit_base::error::Result;
use anyhit_engine::accel::{
    Candidate, Committed, Cursor, HitKind, HitPrimitive, PrimitiveVerdict, RayFlags, TraceRay,
    TraversalObserver,
};
use anyhit_engine::geometry::{Intersection, Ray};

/// The default of `ray.tmax`.
const T_MAX: f32 = 1e30;

pub(super) fn read(tensors: &Tensors<'_>) -> Result<Vec<TraceRay>> {
    let rows = |name: &str| tensors.rows::<3>(name)?.ok_or_else(|| tensors.missing(name));
    let origins = rows("ray.origin")?;
    let count = origins.len();
    let directions = tensors.rows_of::<3>("ray.direction", count)?;
    let t_min = tensors.ray_singles("ray.tmin", count)?;
    let t_max = tensors.ray_singles("ray.tmax", count)?;
    let flags = tensors.unsigned("ray.flags", count, 32)?;
    let cull_masks = tensors.unsigned("ray.cull_mask", count, 32)?;
    let ray = |at: usize| TraceRay {
        ray: Ray::new(origins[at], directions[at]).with_interval(
            t_min.as_ref().map_or(0.0, |all| all[at]),
            t_max.as_ref().map_or(T_MAX, |all| all[at]),
        ),
        flags: RayFlags(flags.as_ref().map_or(0, |all| all[at])),
        cull_mask: cull_masks.as_ref().map_or(0xFF, |all| all[at]),
        time: 0.0,
    };
    Ok((0..count).map(ray).collect())
}

/// The result of a ray whose any-hit shader counts and accepts all hits.
#[derive(Clone, Debug)]
pub struct TracedRay {
    /// The closest hit.
    pub committed: Option<Committed>,
    /// The attributes of the closest hit.
    pub attributes: [f32; 2],
    /// How often the any-hit shader ran.
    pub any_hits: i64,
    /// Every primitive that was hit and not culled, including those behind the closest hit.
    pub intersections: Vec<(HitPrimitive, Intersection)>,
    /// Whether the recorded intersection shader's rounding decides which sphere is hit.
    pub nearly_tangent: bool,
}

impl Recording {
    /// Traces a ray with an any-hit shader that counts and accepts.
    #[doc(hidden)]
    pub fn trace(&self, ray: TraceRay) -> TracedRay {
        let mut recorder = IntersectionRecorder::default();
        let mut cursor = Cursor::new(&self.tlas, ray);
        let (mut any_hits, mut nearly_tangent, mut reported) = (0, false, [0.0; 2]);
        while let Some(candidate) = cursor.proceed_observed(&self.tlas, &mut recorder) {
            if candidate.is_box() {
                let sphere = self.spheres[self.first_sphere[candidate.geometry as usize]..]
                    [candidate.primitive as usize];
                nearly_tangent |=
                    self.intersection_shader(&mut cursor, &candidate, sphere, &mut any_hits, &mut reported);
            } else {
                any_hits += 1;
                cursor.confirm();
            }
        }
        let committed = cursor.committed().copied();
        let attributes = committed.map_or([0.0; 2], |hit| match hit.candidate.is_box() {
            true => reported,
            false => hit.candidate.intersection.attributes,
        });
        TracedRay { committed, attributes, any_hits, intersections: recorder.0, nearly_tangent }
    }

    /// The candidates of a ray whose any-hit shader ignores all.
    #[doc(hidden)]
    pub fn candidates(&self, ray: TraceRay) -> Vec<Candidate> {
        let mut cursor = Cursor::new(&self.tlas, ray);
        std::iter::from_fn(|| cursor.proceed(&self.tlas)).collect()
    }

    /// Reports the far root of the box's sphere with kind 2 and the attributes (1, t), then the
    /// near one with kind 1 and (2, t) where the first was accepted, otherwise (3, t). Returns
    /// whether single precision, as in the recorded shader, could find another number of roots.
    fn intersection_shader(
        &self,
        cursor: &mut Cursor,
        candidate: &Candidate,
        sphere: [f32; 4],
        any_hits: &mut i64,
        reported: &mut [f32; 2],
    ) -> bool {
        let Some(ray) = self.tlas.object_ray(candidate.instance, &cursor.trace().ray, 0.0) else {
            return false;
        };
        let [x, y, z, radius] = sphere.map(f64::from);
        let o = ray.object_origin_f32().map(f64::from);
        let d = ray.object_direction_f32().map(f64::from);
        let m = [o[0] - x, o[1] - y, o[2] - z];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (a, b, c) = (dot(d, d), dot(m, d), dot(m, m) - radius * radius);
        let discriminant = b * b - a * c;
        // Each product is rounded a few times by at most 2^-24 of itself.
        let nearly_tangent = discriminant.abs() < 2e-6 * b * b;
        if discriminant >= 0.0 {
            let root = |sign: f64| ((-b + sign * discriminant.sqrt()) / a) as f32;
            let mut report = |t: f32, kind: u32, first: f32| {
                let accepted = cursor.accepts(t);
                if accepted {
                    *any_hits += i64::from(!candidate.opaque);
                    cursor.generate(t, HitKind(kind));
                    *reported = [first, t];
                }
                accepted
            };
            let far = report(root(1.0), 2, 1.0);
            report(root(-1.0), 1, if far { 2.0 } else { 3.0 });
        }
        nearly_tangent
    }
}

/// Records every primitive that is hit and not culled.
#[derive(Default)]
struct IntersectionRecorder(Vec<(HitPrimitive, Intersection)>);

impl TraversalObserver for IntersectionRecorder {
    fn primitive(&mut self, hit_primitive: HitPrimitive, verdict: PrimitiveVerdict) {
        use PrimitiveVerdict as V;
        if let V::Behind(found) | V::Opaque(found) | V::Candidate(found) = verdict {
            self.0.push((hit_primitive, found));
        }
    }
}
