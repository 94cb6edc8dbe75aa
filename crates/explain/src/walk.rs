//! Ways through a transcript: all its rays and shader runs, in the order in which they began.

use crate::near_hits::NearHits;
use crate::transcript::TranscriptLine;
use crate::transcript::{HitReport, QueryReport, ShaderRun, Step, Trace, Traversal};
use anyhit_engine::reflect::value::FloatValue;

/// A ray that was traced, or that of a ray query.
#[derive(Clone, Copy, Debug)]
pub enum AnyRay<'a> {
    /// A traced ray.
    Trace(&'a Trace),
    /// A ray query.
    Query(&'a QueryReport),
}

impl<'a> AnyRay<'a> {
    /// The ray of a step, if the step is one.
    pub fn of_step(step: &'a Step) -> Option<Self> {
        match step {
            Step::Trace(trace) => Some(Self::Trace(trace)),
            Step::RayQuery(query) => Some(Self::Query(query)),
            Step::Shader(_) | Step::Report { .. } => None,
        }
    }

    /// The ray and what it met.
    pub fn traversal(self) -> &'a Traversal {
        match self {
            Self::Trace(trace) => &trace.traversal,
            Self::Query(query) => &query.traversal,
        }
    }

    /// The closest hit.
    pub fn hit(self) -> Option<&'a HitReport> {
        match self {
            Self::Trace(trace) => trace.hit.as_ref(),
            Self::Query(query) => query.hit.as_ref(),
        }
    }

    /// Whether a trap ended it.
    pub(super) fn is_trapped(self) -> bool {
        matches!(self, Self::Trace(Trace { record: None, .. }))
    }
}

/// A ray with the hits that it may start from.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedRay<'r, 'a> {
    /// The ray.
    pub ray: AnyRay<'a>,
    /// The hit that its shader was called for, and those of the shader's own rays before it.
    pub from: &'r EarlierHits<'a>,
}

/// Rays that hit something, in order, with indices of the places of their hits.
#[derive(Clone, Debug, Default)]
pub(super) struct EarlierHits<'a> {
    rays: Vec<AnyRay<'a>>,
    /// Within [`AT_START`] of the rays' length, by primitive.
    at_start: NearHits,
    /// Within the rounding of coordinates.
    same_points: NearHits,
}

/// What part of the distance from the camera, or the ray before, counts as "at its start".
pub(super) const AT_START: f64 = 1e-3;

impl<'a> EarlierHits<'a> {
    fn add(&mut self, ray: AnyRay<'a>) {
        let Some(hit) = ray.hit() else { return };
        let (number, point) = (self.rays.len(), hit.position.map(FloatValue::as_f64));
        self.at_start.add(number, primitive_of(hit), point, AT_START * hit_distance(ray, hit));
        // A point that is so near has at most the double rounding.
        self.same_points.add(number, [0; 3], point, 2.0 * rounding(&point));
        self.rays.push(ray);
    }

    /// The first of these rays.
    pub(super) fn first(&self) -> Option<AnyRay<'a>> {
        self.rays.first().copied()
    }

    /// The first hit of these at whose point, within rounding, a ray starts.
    pub(super) fn at_origin(&self, ray: AnyRay<'_>) -> Option<&'a HitReport> {
        let origin = ray.traversal().origin.map(FloatValue::as_f64);
        let rounding = rounding(&origin);
        let is_at = |hit: &HitReport| distance(&origin, &hit.position.map(FloatValue::as_f64)) <= rounding;
        let is_wanted = |number: usize| self.rays[number].hit().is_some_and(is_at);
        self.rays[self.same_points.first([0; 3], origin, 0.0, is_wanted)?].hit()
    }

    /// The first hit of these at which a ray starts and hits the same primitive again.
    pub(super) fn hit_again_by(&self, ray: AnyRay<'_>) -> Option<&'a HitReport> {
        let hit = ray.hit()?;
        let (key, length) = (primitive_of(hit), hit_distance(ray, hit));
        let origin = ray.traversal().origin.map(FloatValue::as_f64);
        let is_start = |from: AnyRay<'_>, before: &HitReport| {
            let near = AT_START * hit_distance(from, before);
            length <= near && distance(&origin, &before.position.map(FloatValue::as_f64)) <= near
        };
        let is_wanted =
            |number: usize| self.rays[number].hit().is_some_and(|before| is_start(self.rays[number], before));
        self.rays[self.at_start.first(key, origin, length, is_wanted)?].hit()
    }
}

/// Instance, geometry and primitive.
fn primitive_of(hit: &HitReport) -> [u32; 3] {
    [hit.instance, hit.geometry, hit.primitive]
}

/// Distance from the origin of a ray to its hit.
fn hit_distance(ray: AnyRay<'_>, hit: &HitReport) -> f64 {
    hit.t.as_f64() * ray.traversal().direction_length.as_f64()
}

/// Bound of the rounding of a point of a ray.
fn rounding(point: &[f64; 3]) -> f64 {
    4.0 * f64::from(f32::EPSILON) * point.iter().map(|value| value.abs()).fold(0.0, f64::max)
}

/// Distance between two points.
pub(super) fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

/// All rays from a step on.
pub fn rays(root: &Step) -> Vec<AnyRay<'_>> {
    let mut all = Vec::new();
    for_each_ray(root, &mut |placed| all.push(placed.ray));
    all
}

/// Calls a function with all rays from a step on, in order, each with the hits that it may start
/// from.
pub(super) fn for_each_ray<'a>(root: &'a Step, visit: &mut dyn FnMut(PlacedRay<'_, 'a>)) {
    match root {
        Step::Shader(run) => rays_of_run(run, None, visit),
        step => rays_of_step(step, &EarlierHits::default(), visit),
    }
}

fn rays_of_run<'a>(
    run: &'a ShaderRun,
    called_for: Option<AnyRay<'a>>,
    visit: &mut dyn FnMut(PlacedRay<'_, 'a>),
) {
    let mut from = EarlierHits::default();
    called_for.into_iter().for_each(|ray| from.add(ray));
    for step in &run.steps {
        rays_of_step(step, &from, visit);
        AnyRay::of_step(step).into_iter().for_each(|ray| from.add(ray));
    }
}

fn rays_of_step<'a>(step: &'a Step, from: &EarlierHits<'a>, visit: &mut dyn FnMut(PlacedRay<'_, 'a>)) {
    if let Some(ray) = AnyRay::of_step(step) {
        visit(PlacedRay { ray, from });
    }
    match step {
        Step::Trace(trace) => {
            let decided = trace.decisions.iter().filter_map(|decision| decision.shader.as_ref());
            decided.for_each(|run| rays_of_run(run, None, visit));
            let ray = AnyRay::Trace(trace);
            let called_for = trace.hit.is_some().then_some(ray);
            trace.shader.iter().for_each(|run| rays_of_run(run, called_for, visit));
        }
        Step::Shader(run) => rays_of_run(run, None, visit),
        Step::RayQuery(_) | Step::Report { .. } => {}
    }
}

/// The shader runs from a step on.
pub fn runs(root: &Step) -> Vec<&ShaderRun> {
    let mut all = Vec::new();
    runs_of_step(root, &mut all);
    all
}

fn runs_of_step<'a>(step: &'a Step, all: &mut Vec<&'a ShaderRun>) {
    for run in shaders(step) {
        all.push(run);
        run.steps.iter().for_each(|step| runs_of_step(step, all));
    }
}

/// The shaders that a step runs itself, in order.
pub(super) fn shaders(step: &Step) -> Vec<&ShaderRun> {
    match step {
        Step::Trace(trace) => {
            let decided = trace.decisions.iter().filter_map(|decision| decision.shader.as_ref());
            decided.chain(trace.shader.as_deref()).collect()
        }
        Step::Shader(run) => vec![run],
        Step::RayQuery(_) | Step::Report { .. } => Vec::new(),
    }
}

/// Calls a function with every shader run from a step on.
pub fn for_each_run(step: &mut Step, visit: &mut dyn FnMut(&mut ShaderRun)) {
    let mut enter = |run: &mut ShaderRun| {
        visit(run);
        run.steps.iter_mut().for_each(|step| for_each_run(step, visit));
    };
    match step {
        Step::Trace(trace) => {
            trace.decisions.iter_mut().filter_map(|one| one.shader.as_mut()).for_each(&mut enter);
            trace.shader.iter_mut().for_each(|run| enter(run));
        }
        Step::Shader(run) => enter(run),
        Step::RayQuery(_) | Step::Report { .. } => {}
    }
}

/// Calls a function with every source line that steps from one on tell of.
pub fn for_each_source_line(step: &mut Step, visit: &mut dyn FnMut(&mut TranscriptLine)) {
    match step {
        Step::Trace(trace) => trace.traversal.called_at.iter_mut().for_each(&mut *visit),
        Step::RayQuery(query) => query.traversal.called_at.iter_mut().for_each(&mut *visit),
        Step::Shader(_) | Step::Report { .. } => {}
    }
    for_each_run(step, &mut |run| {
        run.exit.at.iter_mut().for_each(&mut *visit);
        for step in &mut run.steps {
            match step {
                Step::Trace(trace) => trace.traversal.called_at.iter_mut().for_each(&mut *visit),
                Step::RayQuery(query) => query.traversal.called_at.iter_mut().for_each(&mut *visit),
                Step::Shader(_) | Step::Report { .. } => {}
            }
        }
    });
}

/// The rays that the outermost shader traces itself, in order; of a ray from the host itself.
pub fn samples(root: &Step) -> Vec<&Step> {
    match root {
        Step::Shader(run) => run.steps.iter().filter(|step| AnyRay::of_step(step).is_some()).collect(),
        step => vec![step],
    }
}

/// The closest-hit or miss shader of a ray of the outermost shader, by its number; where the ray's
/// hit object keeps it, the shader that runs when that is executed.
pub fn shader_of_sample(root: &Step, sample: usize) -> Option<&ShaderRun> {
    let Step::Trace(trace) = *samples(root).get(sample)? else { return None };
    if let Some(run) = &trace.shader {
        return Some(run);
    }
    let Step::Shader(run) = root else { return None };
    let is_own = |step: &&Step| matches!(step, Step::Trace(one) if std::ptr::eq(&**one, &**trace));
    let after = run.steps.iter().skip_while(|step| !is_own(step)).skip(1);
    let mut until_next = after.take_while(|step| AnyRay::of_step(step).is_none());
    until_next.find_map(|step| match step {
        Step::Shader(run) if ["ClosestHitKHR", "MissKHR"].contains(&run.shader.stage) => Some(&**run),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_is_that_of_two_points() {
        assert_eq!(distance(&[1.0, 2.0, 3.0], &[1.0, 5.0, 7.0]), 5.0);
    }
}
