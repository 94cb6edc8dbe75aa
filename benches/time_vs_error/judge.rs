//! The exact results, by the rational reference of `anyhit stress`.

use anyhit_engine::geometry::{Bounds, Ray};
use anyhit_engine::math::ulp_error;
use anyhit_stress::reference::ObjectLine;

use crate::scene::Scene;
use crate::shape::Shape;

/// The exact first hit of a ray.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceHit {
    pub ray: usize,
    /// t to f64, instance, primitive.
    pub hit: Option<(f64, usize, u32)>,
}

/// The exact first hits of some rays of a scene.
pub fn reference_hits(scene: &Scene, count: usize) -> Vec<ReferenceHit> {
    let step = (scene.rays.len() / count).max(1);
    let size = scene.bounds.min.iter().chain(&scene.bounds.max).fold(0f32, |a, x| a.max(x.abs()));
    (0..scene.rays.len())
        .step_by(step)
        .map(|number| {
            let ray = &scene.rays[number];
            let mut best: Option<(f64, usize, u32)> = None;
            for (instance, matrix) in scene.matrices.iter().enumerate() {
                let identity = *matrix == crate::scene::IDENTITY;
                let line = ObjectLine::new(ray, (!identity).then_some(matrix)).expect("a regular matrix");
                let approximate = line.to_f64();
                // Only primitives whose padded box passes an f64 slab test are tested exactly.
                let mut near: Vec<(f64, u32)> = (0..scene.shapes.len() as u32)
                    .filter_map(|shape| {
                        let [min, max] = scene.shapes[shape as usize].corners();
                        enters(&approximate, &Bounds { min, max }, f64::from(size) * 1e-6).map(|t| (t, shape))
                    })
                    .collect();
                near.sort_by(|a, b| a.0.total_cmp(&b.0));
                for (entry, shape) in near {
                    if best.is_some_and(|(t, ..)| entry > t) {
                        break;
                    }
                    let Some(t) = exact(&line, &scene.shapes[shape as usize], ray) else { continue };
                    if best.is_none_or(|(least, ..)| t < least) {
                        best = Some((t, instance, shape));
                    }
                }
            }
            ReferenceHit { ray: number, hit: best }
        })
        .collect()
}

fn exact(line: &ObjectLine, shape: &Shape, ray: &Ray) -> Option<f64> {
    let (t, is_open) = match *shape {
        Shape::Sphere(center, radius) => (line.sphere(center, radius)?.t, false),
        Shape::Swept(positions, radii) => (line.linear_swept_sphere(positions, radii, [true; 2])?.t, false),
        Shape::Triangle(vertices) => (line.triangle(vertices)?.t, true),
        Shape::Aabb([min, max]) => return Some(line.aabb(min, max, ray.t_min, ray.t_max)?.to_f64()),
    };
    t.is_within(ray.t_min, ray.t_max, is_open).then(|| t.to_f64())
}

fn enters((origin, direction): &([f64; 3], [f64; 3]), bounds: &Bounds, pad: f64) -> Option<f64> {
    let (mut enter, mut leave) = (0f64, f64::INFINITY);
    for i in 0..3 {
        let inverse = 1.0 / direction[i];
        let a = (f64::from(bounds.min[i]) - pad - origin[i]) * inverse;
        let b = (f64::from(bounds.max[i]) + pad - origin[i]) * inverse;
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter <= leave).then_some(enter)
}

/// The errors of a contender.
#[derive(Clone, Debug, Default)]
pub struct Errors {
    /// The errors of t in units in the last place, sorted.
    pub ulps: Vec<f64>,
    pub missed: usize,
    pub extra: usize,
    pub other: usize,
}

impl Errors {
    pub fn of(truth: &[ReferenceHit], hits: &[Option<(f32, u32, u32)>]) -> Self {
        let mut out = Self::default();
        for ReferenceHit { ray, hit } in truth {
            match (hit, hits[*ray]) {
                (None, None) => {}
                (Some(_), None) => out.missed += 1,
                (None, Some(_)) => out.extra += 1,
                (Some((t, instance, shape)), Some((found, on, which))) => {
                    if (on as usize, which) == (*instance, *shape) {
                        out.ulps.push(ulp_error(found, *t));
                    } else if f64::from(found) != f64::from(*t as f32) {
                        // (Where two are hit at one t, the order of the traversal decides here.)
                        out.other += 1;
                    }
                }
            }
        }
        out.ulps.sort_by(f64::total_cmp);
        out
    }

    pub fn wrong(&self) -> usize {
        self.missed + self.extra + self.other
    }

    pub fn at(&self, part: f64) -> f64 {
        let place = ((self.ulps.len() as f64 * part).ceil() as usize).clamp(1, self.ulps.len().max(1)) - 1;
        self.ulps.get(place).copied().unwrap_or(0.0)
    }
}
