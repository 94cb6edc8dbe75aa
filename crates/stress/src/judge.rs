//! Compares every result for a case with that of the exact reference.
//!
//! For each primitive and instance that the ray hits or nearly hits: the block test keeps what the
//! line hits; hit or miss, the surface, t and the attributes are right, for the case's interval
//! and, if it is hit, for intervals that end at t and at the next f32 on either side. Moving
//! primitives have the right numbers at the ray's time. Then, for all of them together, BVH
//! traversal of the single ray, and of a packet with its neighbours, finds the same as testing
//! every primitive.

mod case_at_time;
pub(crate) mod primitive;
pub(crate) mod traversal;

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use serde::{Deserialize, Serialize};

use crate::case::{Shape, StressCase};
use crate::judge::case_at_time::{CaseAtTime, ExactHit};
use crate::judge::primitive::{LineAndPrimitive, intersect};
use crate::judge::traversal::TracedScene;
use crate::reference::ObjectLine;
use anyhit_engine::accel::TraceRay;
use anyhit_engine::geometry::{Precision, Ray};
use anyhit_engine::math::array;

/// The counts of one case or of a whole run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tally {
    /// The number of rays: each is a line, an interval and a primitive, or a traversal, or a ray of
    /// a packet.
    pub rays: u64,
    /// The number of lines; each is tested with several intervals.
    pub lines: u64,
    /// The number of rays that hit.
    pub hits: u64,
    /// The number of pairs of line and primitive that the f32 block test culled.
    pub culled: u64,
    /// The number of single rays that traversed nodes of a BLAS.
    pub trees: u64,
    /// The number of rays that were traced in a packet to the end.
    pub packets: u64,
}

impl Tally {
    /// The sum of both.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            rays: self.rays.saturating_add(other.rays),
            lines: self.lines.saturating_add(other.lines),
            hits: self.hits.saturating_add(other.hits),
            culled: self.culled.saturating_add(other.culled),
            trees: self.trees.saturating_add(other.trees),
            packets: self.packets.saturating_add(other.packets),
        }
    }
}

/// The description of a wrong result.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure(pub(crate) String);

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

fn fail<T>(what: impl Into<String>) -> Result<T, Failure> {
    Err(Failure(what.into()))
}

/// Runs [`check`]; a panic counts as a failure.
pub fn check_caught(case: &StressCase, precision: Precision) -> Result<Tally, Failure> {
    catch_unwind(AssertUnwindSafe(|| check(case, precision)))
        .unwrap_or_else(|_| fail("the code under test panics"))
}

/// Up to this many pairs of instance and primitive of a case are all checked.
const MAX_EXHAUSTIVE_PAIRS: usize = 24;
/// Of more pairs, all hits and up to this many near misses are checked.
const MAX_NEAR_MISSES: usize = 16;
/// The most instances without hits that are checked.
const MAX_MISSED_INSTANCES: usize = 4;
/// For up to this many hits, intervals that end there are checked too.
const MAX_SHORTENED_HITS: usize = 12;
/// For up to this many neighbours, the hit is checked in rational numbers too.
const MAX_EXACT_NEIGHBOURS: usize = 3;

/// Checks all results for a case.
///
/// # Errors
/// The first wrong result.
pub fn check(case: &StressCase, precision: Precision) -> Result<Tally, Failure> {
    let mut tally = Tally { lines: 1 + case.neighbours.len() as u64, ..Tally::default() };
    let trace = case.trace();
    if !(0.0..=1.0).contains(&trace.time) {
        return Ok(tally);
    }
    let case_at_time = CaseAtTime::new(case, trace.time);
    let judge = Judge { case, precision, case_at_time: &case_at_time, ray: trace.ray };
    if !judge.check_primitives(&mut tally)? || trace.check().is_err() {
        return Ok(tally);
    }
    let Some(scene) = TracedScene::new(case, precision)? else { return Ok(tally) };
    scene.check_single(&case_at_time, &trace, &mut tally)?;
    if let Some(closest) = case_at_time.hits(&trace, precision).first() {
        let (Ray { t_min, t_max, .. }, t) = (trace.ray, closest.found.t);
        for (t_min, t_max) in [(t_min, t), (t_min, t.next_down()), (t, t_max)] {
            let shortened = TraceRay { ray: trace.ray.with_interval(t_min, t_max), ..trace };
            if shortened.check().is_ok() {
                scene.check_single(&case_at_time, &shortened, &mut tally)?;
            }
        }
    }
    check_neighbours(case, &scene, &case_at_time, precision, &mut tally)?;
    Ok(tally)
}

/// Checks the neighbours of the case's ray.
fn check_neighbours(
    case: &StressCase,
    scene: &TracedScene,
    case_at_time: &CaseAtTime,
    precision: Precision,
    tally: &mut Tally,
) -> Result<(), Failure> {
    let traces = case.neighbours.iter().map(|neighbour| neighbour.trace());
    let traces: Vec<_> = traces.filter(|trace| trace.check().is_ok()).collect();
    let times: Vec<_> = traces.iter().map(|trace| trace.time).collect();
    let mut cases_at_times: Vec<CaseAtTime> = Vec::new();
    for time in times {
        if cases_at_times.iter().chain([case_at_time]).all(|case_at_time| case_at_time.time != time) {
            cases_at_times.push(CaseAtTime::new(case, time));
        }
    }
    let at_time = |time: f32| {
        cases_at_times.iter().find(|case_at_time| case_at_time.time == time).unwrap_or(case_at_time)
    };
    for (at, trace) in traces.iter().enumerate() {
        let case_at_time = at_time(trace.time);
        scene
            .check_single(case_at_time, trace, tally)
            .map_err(|Failure(what)| Failure(format!("neighbour {at}: {what}")))?;
        if at < MAX_EXACT_NEIGHBOURS
            && let Some(hit) = case_at_time.hits(trace, precision).first()
        {
            let judge = Judge { case, precision, case_at_time, ray: trace.ray };
            judge
                .check_hit(hit, tally)
                .map_err(|Failure(what)| Failure(format!("neighbour {at}: {what}")))?;
        }
    }
    if traces.is_empty() {
        return Ok(());
    }
    let all = std::iter::once(case.trace()).chain(traces);
    let all: Vec<_> = all.map(|trace| (trace, at_time(trace.time))).collect();
    scene.check_packets(&all, tally)
}

/// Checks the results of the primitives' tests for one ray.
struct Judge<'a> {
    case: &'a StressCase,
    precision: Precision,
    case_at_time: &'a CaseAtTime,
    ray: Ray,
}

impl Judge<'_> {
    /// The line of the ray in an instance; checks that the code under test agrees whether there is
    /// one.
    fn line(&self, instance: usize) -> Result<Option<ObjectLine>, Failure> {
        let Ray { origin, direction, .. } = self.ray;
        let matrix = self.case_at_time.instances[instance].matrix.as_ref();
        let numbers = origin.iter().chain(&direction).chain(matrix.into_iter().flatten().flatten());
        let is_ray = numbers.copied().all(f32::is_finite);
        let line = if is_ray { ObjectLine::new(&self.ray, matrix) } else { None };
        let found = self.case_at_time.object_ray(instance, &self.ray).is_some();
        if found != line.is_some() {
            return fail(format!("instance {instance}: an object-space ray exists: {found}, not {}", !found));
        }
        self.case_at_time.check_transform(instance)?;
        Ok(line)
    }

    /// Checks all primitives; returns `false` where there is no ray in the first instance.
    fn check_primitives(&self, tally: &mut Tally) -> Result<bool, Failure> {
        let Some(first) = self.line(0)? else { return Ok(false) };
        let shapes = self.case_at_time.shapes.len();
        // Hidden copies do not count.
        let instances = 1 + self.case.others.len();
        let all = shapes * instances <= MAX_EXHAUSTIVE_PAIRS;
        let (mut shortened, mut near_misses, mut missed_instances) = (0, 0, 0);
        let mut first = Some(first);
        for instance in 0..instances {
            let object = self.case_at_time.object_ray(instance, &self.ray);
            let is_hit = |at: usize| {
                object.as_ref().is_some_and(|ray| {
                    intersect(&self.case_at_time.shapes[at], ray, self.precision).is_some()
                })
            };
            let hits: Vec<bool> = (0..shapes).map(is_hit).collect();
            if !all && !hits.contains(&true) {
                missed_instances += 1;
                if missed_instances > MAX_MISSED_INSTANCES {
                    continue;
                }
            }
            let line = match first.take() {
                Some(line) => Some(line),
                None => self.line(instance)?,
            };
            let Some(line) = line else { continue };
            let approximate = ApproximateLine::of(&line);
            for (at, &is_hit) in hits.iter().enumerate() {
                if !all && !is_hit {
                    if near_misses >= MAX_NEAR_MISSES
                        || approximate.is_far_from(&self.case_at_time.shapes[at])
                    {
                        continue;
                    }
                    near_misses += 1;
                }
                let shortens = all || shortened < MAX_SHORTENED_HITS;
                shortened += usize::from(is_hit);
                self.check_primitive(instance, at, &line, shortens, tally)?;
            }
        }
        Ok(true)
    }

    /// Checks an expected hit.
    fn check_hit(&self, hit: &ExactHit, tally: &mut Tally) -> Result<(), Failure> {
        match self.line(hit.instance)? {
            Some(line) => self.check_primitive(hit.instance, hit.shape, &line, false, tally),
            None => fail(format!("instance {} is hit without an object-space ray", hit.instance)),
        }
    }

    /// Checks a primitive; with `shortens`, also over intervals that end at a hit.
    fn check_primitive(
        &self,
        instance: usize,
        index: usize,
        line: &ObjectLine,
        shortens: bool,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let in_instance = |Failure(what): Failure| match instance {
            0 => Failure(what),
            _ => Failure(format!("instance {instance}: {what}")),
        };
        self.case_at_time.check_shape(self.case, index)?;
        let Some(object) = self.case_at_time.object_ray(instance, &self.ray) else { return Ok(()) };
        let matrix = self.case_at_time.instances[instance].matrix.as_ref();
        let (shape, precision) = (&self.case_at_time.shapes[index], self.precision);
        let primitive = LineAndPrimitive { shape, line, matrix, precision, index };
        let expected = primitive.expected();
        primitive.check_block(&object, expected.as_ref(), tally).map_err(in_instance)?;
        let found = primitive.check(&self.ray, expected.as_ref(), tally).map_err(in_instance)?;
        let Some(t) = found.map(|found| found.t).filter(|t| shortens && t.is_finite()) else {
            return Ok(());
        };
        for end in [t.next_down(), t, t.next_up()] {
            if end >= 0.0 && end.is_finite() {
                for (t_min, t_max) in [(end, f32::INFINITY), (0.0, end)] {
                    let ray = self.ray.with_interval(t_min, t_max);
                    primitive.check(&ray, expected.as_ref(), tally).map_err(in_instance)?;
                }
            }
        }
        Ok(())
    }
}

/// A line in f64, used only to skip shapes that are far from it.
struct ApproximateLine {
    origin: [f64; 3],
    direction: [f64; 3],
}

impl ApproximateLine {
    fn of(line: &ObjectLine) -> Self {
        let (origin, direction) = line.to_f64();
        Self { origin, direction }
    }

    /// Whether the line certainly misses a shape by some distance; false for a NaN.
    fn is_far_from(&self, shape: &Shape) -> bool {
        let wide = |v: [f32; 3]| v.map(f64::from);
        let distance = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
        let (center, bounding_radius) = match *shape {
            Shape::Triangle(vertices) | Shape::MovingTriangle([vertices, _]) => {
                let center = wide(vertices[0]);
                (center, distance(wide(vertices[1]), center).max(distance(wide(vertices[2]), center)))
            }
            Shape::Aabb([min, max]) => (wide(min), distance(wide(min), wide(max))),
            Shape::Sphere { center, radius } => (wide(center), f64::from(radius)),
            Shape::LinearSweptSphere { positions: [p, q], radii: [r, s], .. } => {
                (wide(p), distance(wide(p), wide(q)) + f64::from(r.max(s)))
            }
        };
        let [m, d] = [array::from_fn::<f64, 3>(|i| center[i] - self.origin[i]), self.direction];
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
        let along = dot(m, d) / dot(d, d);
        let perpendicular = array::from_fn(|i| m[i] - along * d[i]);
        // Cancellation leaves an error relative to the subtracted terms.
        dot(perpendicular, perpendicular).sqrt() - 1e-12 * dot(m, m).sqrt() > 1.01 * bounding_radius
    }
}
