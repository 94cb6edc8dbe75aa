//! Running a scene under the sanitizer.

use std::collections::BTreeMap;

use crate::accel::Tlas;
use crate::debug::session::{ResolvedRequest, SingleRun};
use crate::error::{Error, ErrorKind, Result};
use crate::machine::{Observer, Resources, ShaderIndex};
use crate::pipeline::{Event, Launch, Stats};
use crate::sanitize::contract::check_pipeline;
use crate::sanitize::hit_indices::check_hit_indices;
use crate::sanitize::module_checks::check_module;
use crate::sanitize::structures::check_structures;
use crate::sanitize::{Findings, Levels, ProgramPlan, RayWatch, Sanitizer, SeenRays};
use crate::scene::pass::PassWork;
use crate::scene::{Assembled, ResolvedScene};

/// What a run under the sanitizer gave: its statistics or its trap, and what was found until then.
#[derive(Debug)]
pub struct SanitizedRun {
    /// The statistics, or the trap.
    pub outcome: Result<Stats>,
    /// What was found.
    pub findings: Findings,
}

/// Runs the launches and dispatches of a scene, as [`Assembled::run`] does.
///
/// # Errors
/// Those of lowering a shader without optimization.
pub fn run_sanitized(
    scene: &ResolvedScene,
    assembled: &Assembled,
    resources: &Resources,
    levels: &Levels,
) -> Result<SanitizedRun> {
    let reference = assembled.unoptimized()?;
    let mut findings = check_structures(scene, levels);
    let mut stats = Stats::default();
    // Rays by the pipeline that traces them, and those of compute shaders' ray queries.
    let mut traced: BTreeMap<Option<usize>, SeenRays> = BTreeMap::new();
    let mut queried = SeenRays::default();
    for (number, pass) in reference.passes.iter().enumerate() {
        let resources = reference.pass_resources(pass, resources);
        let outcome = match &pass.work {
            PassWork::Launch(launch) => {
                let pipeline = reference.pass_pipeline(launch);
                findings.extend(check_pipeline(&pipeline, levels));
                findings.extend(check_hit_indices(&pipeline.programs, levels));
                let plans: Vec<_> = pipeline.programs.iter().map(ProgramPlan::new).collect();
                let mut sanitizer = Sanitizer::new(&plans, levels);
                let seen = traced.entry(launch.pipeline).or_default();
                let mut watch = RayWatch::new(&pipeline, scene, levels, seen);
                let size = launch.size;
                let launch = Launch { pipeline: &pipeline, resources: &resources };
                let outcome = launch.run_observed(size, &mut |event| watch.event(event), &mut sanitizer);
                findings.extend(watch.into_findings());
                findings.extend(sanitizer.into_findings());
                outcome
            }
            PassWork::Dispatch(at) => {
                let dispatch = &reference.dispatches[*at];
                let program = &dispatch.compute.program;
                findings.extend(check_module(program, ShaderIndex(0), levels));
                findings.extend(check_hit_indices(std::slice::from_ref(program), levels));
                let plans = [ProgramPlan::new(program)];
                let mut sanitizer = Sanitizer::new(&plans, levels);
                let on_event = &mut |event| queried.add_event(&event);
                let compute = &dispatch.compute;
                let outcome = compute.run_observed(&resources, dispatch.groups, on_event, &mut sanitizer);
                findings.extend(sanitizer.into_findings());
                outcome
            }
        };
        match outcome {
            Ok(more) => stats = stats.plus(&more),
            Err(trap) => {
                return Ok(SanitizedRun { outcome: Err(reference.in_pass(number, trap)), findings });
            }
        }
    }
    for (&pipeline, seen) in &traced {
        findings.extend(seen.check_any_hit(reference.pipeline_at(pipeline), scene, levels));
    }
    let all: Vec<&SeenRays> = traced.values().chain([&queried]).collect();
    findings.extend(SeenRays::check_masks(&all, scene, levels));
    Ok(SanitizedRun { outcome: Ok(stats), findings })
}

/// Runs one ray of a scene, or one invocation.
///
/// # Errors
/// Those of the request, and of lowering a shader without optimization; `UnsupportedModule` where
/// the invocations of a subgroup run together.
pub fn sanitize_one(
    scene: &ResolvedScene,
    assembled: &Assembled,
    which: &ResolvedRequest,
    resources: &Resources,
    levels: &Levels,
) -> Result<SanitizedRun> {
    let reference = assembled.unoptimized()?;
    let single = reference.single_launch(which.pass.as_deref())?;
    if single.pipeline.uses_subgroups() && single.pipeline.subgroup_size > 1 {
        let message = "a single invocation under the sanitizer, of a pipeline with subgroup instructions";
        return Err(Error::new(ErrorKind::UnsupportedModule, message)
            .note("run the whole launch, or set the subgroup size to 1"));
    }
    single.run_before(resources)?;
    let resources = single.resources(resources);
    let mut findings = check_structures(scene, levels);
    findings.extend(check_pipeline(&single.pipeline, levels));
    findings.extend(check_hit_indices(&single.pipeline.programs, levels));
    let plans: Vec<_> = single.pipeline.programs.iter().map(ProgramPlan::new).collect();
    let mut sanitizer = Sanitizer::new(&plans, levels);
    // One ray says nothing of what no ray does.
    let mut seen = SeenRays::default();
    let mut watch = RayWatch::new(&single.pipeline, scene, levels, &mut seen);
    let launch = Launch { pipeline: &single.pipeline, resources: &resources };
    let outcome = {
        let mut on_event: &mut dyn FnMut(Event) = &mut |event| watch.event(event);
        let mut observer: &mut dyn Observer<1> = &mut sanitizer;
        match &which.what {
            SingleRun::Pixel(id) => launch.run_one(*id, single.size, &mut on_event, &mut observer),
            SingleRun::Ray(given) => {
                let tlas = if let Some((_, tlas)) = scene.tlas.first() { tlas } else { Tlas::empty() };
                let operands = given.operands(launch.pipeline)?;
                let outcome = launch.trace_observed(tlas, operands, &mut on_event, &mut observer);
                outcome.map(|outcome| outcome.stats)
            }
        }
    };
    findings.extend(watch.into_findings());
    findings.extend(sanitizer.into_findings());
    Ok(SanitizedRun { outcome, findings })
}

/// The error of what is denied, if anything is. Its reports are told apart from it.
///
/// # Errors
/// `Finding`.
pub fn deny(findings: &Findings) -> Result<()> {
    match findings.denied().count() {
        0 => Ok(()),
        1 => Err(Error::new(ErrorKind::Finding, "the sanitizer denies 1 finding")),
        count => Err(Error::new(ErrorKind::Finding, format!("the sanitizer denies {count} findings"))),
    }
}
