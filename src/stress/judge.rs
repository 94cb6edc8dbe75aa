//! Compares every answer about a case with the reference's.
//!
//! For each primitive: the block test keeps what the line meets; hit or miss, the surface, t and the
//! attributes are right, for the case's interval and, where it is hit, for intervals that end at t
//! and one step beside it. Then for all of them together: a traversal of a TLAS commits the hit with
//! the least key (t, primitive), or hands boxes out in the order of that key.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::accel::{Blas, Cursor, Geometry, GeometryFlags, Instance, RayFlags, Tlas, TraceRay};
use crate::geometry::block::{self, BlockRay, BoxRay, LANES};
use crate::geometry::{
    Bounds, Intersection, ObjectRay, Precision, Ray, Surface, Transform, aabb, linear_swept_sphere, sphere,
    triangle,
};
use crate::math::eight::TwoFours;
use crate::stress::case::{Case, Shape};
use crate::stress::reference::{Expected, LineOf};

/// What a case added to a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Rays: a line, an interval and a primitive, or a traversal.
    pub rays: u64,
    /// Lines, each with all intervals.
    pub lines: u64,
    /// Rays that hit.
    pub hits: u64,
    /// Lines and primitives that the f32 block test dropped.
    pub dropped: u64,
}

impl Tally {
    /// The sums.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            lines: self.lines + other.lines,
            hits: self.hits + other.hits,
            dropped: self.dropped + other.dropped,
        }
    }
}

/// What is wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure(String);

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

fn fail<T>(what: impl Into<String>) -> Result<T, Failure> {
    Err(Failure(what.into()))
}

/// [`check`], with a panic as a failure.
pub fn check_caught(case: &Case, precision: Precision) -> Result<Tally, Failure> {
    catch_unwind(AssertUnwindSafe(|| check(case, precision))).unwrap_or_else(|_| fail("it panics"))
}

/// Judges all answers about a case.
///
/// # Errors
/// The first wrong answer.
pub fn check(case: &Case, precision: Precision) -> Result<Tally, Failure> {
    let mut tally = Tally { lines: 1, ..Tally::default() };
    let ray = case.ray();
    let object = ObjectRay::new(&ray, case.transform.as_ref());
    let finite = |v: &[f32; 3]| v.iter().all(|x| x.is_finite());
    let is_ray = finite(&ray.origin) && finite(&ray.direction);
    let line = if is_ray { LineOf::new(&ray, case.transform.as_ref()) } else { None };
    if object.is_some() != line.is_some() {
        return fail(format!("an object-space ray: {}, not {}", object.is_some(), line.is_some()));
    }
    let (Some(object), Some(line)) = (object, line) else { return Ok(tally) };

    let mut hits = Vec::new();
    for (index, shape) in case.shapes.iter().enumerate() {
        let one = One { shape, line: &line, matrix: case.transform.as_ref(), precision, index };
        let expected = one.expected();
        one.check_block(&object, expected.as_ref(), &mut tally)?;
        let found = one.check(&ray, expected.as_ref(), &mut tally)?;
        let Some(found) = found else { continue };
        hits.push((index as u32, found.t));
        if found.t.is_finite() {
            for end in [found.t.next_down(), found.t, found.t.next_up()] {
                if end >= 0.0 && end.is_finite() {
                    one.check(&ray.with_interval(end, f32::INFINITY), expected.as_ref(), &mut tally)?;
                    one.check(&ray.with_interval(0.0, end), expected.as_ref(), &mut tally)?;
                }
            }
        }
    }
    check_traversal(case, &ray, precision, hits, &mut tally)?;
    Ok(tally)
}

/// One primitive of a case.
struct One<'a> {
    shape: &'a Shape,
    line: &'a LineOf,
    matrix: Option<&'a [[f32; 4]; 3]>,
    precision: Precision,
    index: usize,
}

impl One<'_> {
    /// Where the line meets it; `None` for a box, whose entry depends on the interval.
    fn expected(&self) -> Option<Expected> {
        match *self.shape {
            Shape::Triangle(vertices) => self.line.triangle(vertices),
            Shape::Aabb(_) => None,
            Shape::Sphere { center, radius } => self.line.sphere(center, radius),
            Shape::LinearSweptSphere { positions, radii, caps } => {
                self.line.linear_swept_sphere(positions, radii, caps)
            }
        }
    }

    fn intersect(&self, ray: &ObjectRay) -> Option<Intersection> {
        match *self.shape {
            Shape::Triangle(vertices) => triangle::intersect(ray, vertices, self.precision),
            Shape::Aabb([min, max]) => aabb::intersect(ray, min, max, self.precision),
            Shape::Sphere { center, radius } => sphere::intersect(ray, center, radius, self.precision),
            Shape::LinearSweptSphere { positions, radii, caps } => {
                linear_swept_sphere::intersect(ray, positions, radii, caps, self.precision)
            }
        }
    }

    /// The block test, with the primitive in one lane and nothing in the others.
    fn check_block(
        &self,
        ray: &ObjectRay,
        expected: Option<&Expected>,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let lane = self.index % LANES;
        // As it is prepared, and in an instance in f32 as well.
        let transform = self.matrix.and_then(Transform::new);
        let rough = transform.and_then(|transform| transform.rough(ray.world()));
        let block_rays = |bounds: &Bounds| {
            let rough = rough.and_then(|rough| BlockRay::rough(&rough, bounds));
            [Some(BlockRay::new(ray, bounds)), rough].into_iter().flatten()
        };
        let (met, is_met) = match *self.shape {
            Shape::Triangle(vertices) => {
                let Some(bounds) = triangle::bounds(vertices) else { return Ok(()) };
                let mut block = block::Triangles::EMPTY;
                block.set(lane, vertices);
                (
                    block_rays(&bounds).fold(u32::MAX, |met, ray| met & block.met(TwoFours, &ray)),
                    expected.is_some(),
                )
            }
            Shape::Aabb([min, max]) => {
                let Some(bounds) = aabb::bounds(min, max) else { return Ok(()) };
                let mut block = block::Aabbs::EMPTY;
                block.set(lane, min, max);
                let is_met = self.line.aabb(min, max, ray.t_min(), ray.t_max()).is_some();
                (block.met(&BoxRay::new(ray, &bounds)), is_met)
            }
            Shape::Sphere { center, radius } => {
                let Some(bounds) = sphere::bounds(center, radius) else { return Ok(()) };
                let mut block = block::Spheres::EMPTY;
                block.set(lane, center, radius);
                (
                    block_rays(&bounds).fold(u32::MAX, |met, ray| met & block.met(TwoFours, &ray)),
                    expected.is_some(),
                )
            }
            Shape::LinearSweptSphere { positions, radii, caps } => {
                let Some(bounds) = linear_swept_sphere::bounds(positions, radii) else { return Ok(()) };
                let mut block = block::LinearSweptSpheres::EMPTY;
                block.set(lane, positions, radii, caps);
                (
                    block_rays(&bounds).fold(u32::MAX, |met, ray| met & block.met(TwoFours, &ray)),
                    expected.is_some(),
                )
            }
        };
        let kept = met >> lane & 1 != 0;
        tally.dropped += u64::from(!kept);
        if is_met && !kept {
            return fail(format!("primitive {}: the block test drops what the line meets", self.index));
        }
        Ok(())
    }

    fn check(
        &self,
        ray: &Ray,
        expected: Option<&Expected>,
        tally: &mut Tally,
    ) -> Result<Option<Intersection>, Failure> {
        tally.rays += 1;
        let Ray { t_min, t_max, .. } = *ray;
        let index = self.index;
        let Some(object) = ObjectRay::new(ray, self.matrix) else {
            return fail(format!("no object-space ray over {t_min:e}..{t_max:e}"));
        };
        let found = self.intersect(&object);
        let place = || format!("primitive {index} over {t_min:e}..{t_max:e}");
        if let Shape::Aabb([min, max]) = *self.shape {
            let entry = self.line.aabb(min, max, t_min, t_max);
            match (&found, entry) {
                (None, None) => {}
                (Some(hit), Some(t)) if t.rounds_to(hit.t) => tally.hits += 1,
                (Some(hit), Some(_)) => return fail(format!("{}: t {:e} is wrong", place(), hit.t)),
                (found, entry) => {
                    return fail(format!("{}: hit {}, not {}", place(), found.is_some(), entry.is_some()));
                }
            }
            return Ok(found);
        }
        let is_open = matches!(self.shape, Shape::Triangle(_));
        let expected = expected.filter(|expected| expected.t.is_within(t_min, t_max, is_open));
        let (hit, expected) = match (found, expected) {
            (None, None) => return Ok(None),
            (Some(hit), Some(expected)) => (hit, expected),
            (found, expected) => {
                return fail(format!("{}: hit {}, not {}", place(), found.is_some(), expected.is_some()));
            }
        };
        if hit.surface != expected.surface {
            return fail(format!("{}: {:?}, not {:?}", place(), hit.surface, expected.surface));
        }
        if !expected.t.rounds_to(hit.t) {
            return fail(format!("{}: t {:e} is wrong", place(), hit.t));
        }
        for (value, exact) in hit.attributes.iter().zip(&expected.attributes) {
            let clamped =
                hit.surface == Surface::Side && [f32::MIN_POSITIVE, 1.0f32.next_down()].contains(value);
            if !clamped && !exact.rounds_to(*value) {
                return fail(format!("{}: attribute {value:e} is wrong", place()));
            }
        }
        tally.hits += 1;
        Ok(Some(hit))
    }
}

/// Traverses the case's primitives as one BLAS and compares with the hits that are known.
fn check_traversal(
    case: &Case,
    ray: &Ray,
    precision: Precision,
    mut hits: Vec<(u32, f32)>,
    tally: &mut Tally,
) -> Result<(), Failure> {
    let Some(data) = case.geometry() else { return Ok(()) };
    // Validation refuses negative radii and boxes that are inside out.
    let Ok(blas) = Blas::new(vec![Geometry::new(data, GeometryFlags::OPAQUE)]) else { return Ok(()) };
    let transform =
        case.transform.unwrap_or([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
    // Above four instances there is a tree over them, too; the others are far away or masked out.
    let instance = Instance::of(blas, transform);
    let mut instances = vec![instance.clone()];
    instances.extend((0..4).map(|_| Instance { mask: 2, ..instance.clone() }));
    let Ok(tlas) = Tlas::with_precision(instances, precision) else {
        return fail("a regular matrix is refused");
    };
    hits.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let mut cursor =
        Cursor::new(&tlas, TraceRay { ray: *ray, flags: RayFlags::default(), cull_mask: 1, time: 0.0 });
    let mut seen = Vec::new();
    while let Some(candidate) = cursor.proceed(&tlas) {
        seen.push((candidate.primitive, candidate.intersection.t));
    }
    tally.rays += 1;
    tally.hits += u64::from(!hits.is_empty());
    if matches!(case.shapes.first(), Some(Shape::Aabb(_))) {
        if seen != hits {
            return fail(format!("traversal: boxes {seen:?}, not {hits:?}"));
        }
        return Ok(());
    }
    let committed = cursor.committed().map(|hit| (hit.candidate.primitive, hit.t));
    if !seen.is_empty() || committed.as_ref() != hits.first() {
        return fail(format!("traversal: {committed:?} {seen:?}, not {:?}", hits.first()));
    }
    Ok(())
}
