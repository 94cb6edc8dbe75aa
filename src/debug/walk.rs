//! Ways through a transcript: all its rays and shader runs, in the order in which they began.

#[cfg(feature = "scenes")]
use crate::debug::transcript::TranscriptLine;
use crate::debug::transcript::{HitReport, QueryReport, ShaderRun, Step, Trace, Traversal};

/// A ray that was traced, or that of a ray query.
#[derive(Clone, Copy, Debug)]
pub(super) enum AnyRay<'a> {
    /// A traced ray.
    Trace(&'a Trace),
    /// A ray query.
    Query(&'a QueryReport),
}

impl<'a> AnyRay<'a> {
    /// The ray of a step, if the step is one.
    pub(super) fn of_step(step: &'a Step) -> Option<Self> {
        match step {
            Step::Trace(trace) => Some(Self::Trace(trace)),
            Step::RayQuery(query) => Some(Self::Query(query)),
            Step::Shader(_) | Step::Report { .. } => None,
        }
    }

    /// The ray and what it met.
    pub(super) fn traversal(self) -> &'a Traversal {
        match self {
            Self::Trace(trace) => &trace.traversal,
            Self::Query(query) => &query.traversal,
        }
    }

    /// The closest hit.
    pub(super) fn hit(self) -> Option<&'a HitReport> {
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
#[derive(Clone, Debug)]
pub(super) struct PlacedRay<'a> {
    /// The ray.
    pub ray: AnyRay<'a>,
    /// The hit that its shader was called for, and those of the shader's own rays before it.
    pub from: Vec<AnyRay<'a>>,
}

/// All rays from a step on.
pub(super) fn rays(root: &Step) -> Vec<PlacedRay<'_>> {
    let mut all = Vec::new();
    match root {
        Step::Shader(run) => rays_of_run(run, None, &mut all),
        step => rays_of_step(step, &[], &mut all),
    }
    all
}

fn rays_of_run<'a>(run: &'a ShaderRun, called_for: Option<AnyRay<'a>>, all: &mut Vec<PlacedRay<'a>>) {
    let mut from: Vec<AnyRay<'a>> = called_for.into_iter().collect();
    for step in &run.steps {
        rays_of_step(step, &from, all);
        from.extend(AnyRay::of_step(step).filter(|ray| ray.hit().is_some()));
    }
}

fn rays_of_step<'a>(step: &'a Step, from: &[AnyRay<'a>], all: &mut Vec<PlacedRay<'a>>) {
    if let Some(ray) = AnyRay::of_step(step) {
        all.push(PlacedRay { ray, from: from.to_vec() });
    }
    match step {
        Step::Trace(trace) => {
            let decided = trace.decisions.iter().filter_map(|decision| decision.shader.as_ref());
            decided.for_each(|run| rays_of_run(run, None, all));
            let ray = AnyRay::Trace(trace);
            let called_for = trace.hit.is_some().then_some(ray);
            trace.shader.iter().for_each(|run| rays_of_run(run, called_for, all));
        }
        Step::Shader(run) => rays_of_run(run, None, all),
        Step::RayQuery(_) | Step::Report { .. } => {}
    }
}

/// The shader runs from a step on.
pub(super) fn runs(root: &Step) -> Vec<&ShaderRun> {
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
#[cfg(feature = "scenes")]
pub(super) fn for_each_run(step: &mut Step, visit: &mut dyn FnMut(&mut ShaderRun)) {
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
#[cfg(feature = "scenes")]
pub(super) fn for_each_source_line(step: &mut Step, visit: &mut dyn FnMut(&mut TranscriptLine)) {
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
pub(super) fn samples(root: &Step) -> Vec<&Step> {
    match root {
        Step::Shader(run) => run.steps.iter().filter(|step| AnyRay::of_step(step).is_some()).collect(),
        step => vec![step],
    }
}

/// The closest-hit or miss shader of a ray of the outermost shader, by its number; where the ray's
/// hit object keeps it, the shader that runs when that is executed.
#[cfg(feature = "scenes")]
pub(super) fn shader_of_sample(root: &Step, sample: usize) -> Option<&ShaderRun> {
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
