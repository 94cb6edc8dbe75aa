//! Running a scene under the sanitizer.

use std::collections::HashSet;
use std::sync::Arc;

use crate::clean_launch::CleanLaunch;
use crate::module_files::module_files;
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, Result, Trap};
use anyhit_base::sorted::SortedMap;
use anyhit_debugger::session::{ResolvedRequest, SingleRun};
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::{Resources, ShaderIndex};
use anyhit_engine::math::array;
use anyhit_engine::pipeline::{Launch, Pipeline, Stats};
use anyhit_engine::program::Program;
use anyhit_sanitize::contract::check_pipeline;
use anyhit_sanitize::hit_indices::check_hit_indices;
use anyhit_sanitize::module_checks::check_module;
use anyhit_sanitize::structures::check_structures;
use anyhit_sanitize::unreached_records::{HostRay, check_records};
use anyhit_sanitize::{
    Findings, LaunchSize, Levels, ProgramPlan, RayWatch, Sanitizer, SeenRays, UnwrittenMemory,
};
use anyhit_scene::pass::PassWork;
use anyhit_scene::unwritten::unwritten_memory;
use anyhit_scene::{Assembled, ResolvedScene};
use anyhit_unit_test::side_by_side::SideBySide;

/// What a run under the sanitizer gave: its statistics or its trap, and what was found until then.
#[derive(Debug)]
pub struct SanitizedRun {
    /// The statistics, or the trap.
    pub outcome: Result<Stats>,
    /// What was found.
    pub findings: Findings,
}

/// What is known before a scene runs: of its structures, of its pipelines, and of each module.
pub fn check_scene(scene: &ResolvedScene, assembled: &Assembled, levels: &Levels) -> Findings {
    let mut findings = check_structures(scene, levels);
    for (index, pipeline) in assembled.all_pipelines() {
        let mut found = check_pipeline(pipeline, levels);
        found.extend(check_hit_indices(&pipeline.programs, levels));
        findings.extend(found.of_shaders_from(assembled.first_program(index)));
    }
    for (index, dispatch) in assembled.dispatches.iter().enumerate() {
        let found = check_hit_indices(std::slice::from_ref(&dispatch.compute.program), levels);
        findings.extend(found.of_shaders_from(assembled.dispatch_program(index)));
    }
    // Shaders of several pipelines are told of once.
    let mut seen = HashSet::new();
    for (at, program) in assembled.programs().enumerate() {
        if seen.insert((Arc::as_ptr(&program.module), program.stage, &program.name)) {
            findings.extend(check_module(program, ShaderIndex::new(at), levels));
        }
    }
    findings
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
    let reference = assembled.for_sanitizer()?;
    let modules = module_files(scene, &reference);
    let SanitizedRun { outcome, findings } = run_passes(scene, &reference, resources, levels, &modules)?;
    let findings = findings.in_modules(&modules).of_same_shaders(&first_same(&reference));
    Ok(SanitizedRun { outcome, findings })
}

/// By shader of a scene: the first that is the same entry point of the same module.
fn first_same(assembled: &Assembled) -> Vec<usize> {
    let programs: Vec<_> = assembled.programs().collect();
    let is_same = |one: &Program, other: &Program| {
        one.stage == other.stage
            && one.name == other.name
            && (Arc::ptr_eq(&one.module, &other.module) || one.module.words == other.module.words)
    };
    let first = |(at, program): (usize, &&Arc<Program>)| {
        programs[..at].iter().position(|other| is_same(other, program)).unwrap_or(at)
    };
    programs.iter().enumerate().map(first).collect()
}

/// A trap with the module of its shader; `modules` are those of the scene's shaders, of which the
/// pipeline's first has an index.
fn in_module(trap: Error, first: usize, modules: &[String]) -> Error {
    let shader = trap.trap().and_then(Trap::frame).map(|frame| first + frame.shader as usize);
    match shader.and_then(|shader| modules.get(shader)) {
        Some(module) => trap.in_module(module),
        None => trap,
    }
}

fn run_passes(
    scene: &ResolvedScene,
    reference: &Assembled,
    resources: &Resources,
    levels: &Levels,
    modules: &[String],
) -> Result<SanitizedRun> {
    let mut findings = check_scene(scene, reference, levels);
    let mut stats = Stats::default();
    // Rays by the pipeline that traces them, and those of compute shaders' ray queries.
    let mut traced: SortedMap<Option<usize>, SeenRays> = SortedMap::new();
    let mut queried = SeenRays::default();
    let mut unwritten = unwritten_memory(scene, resources);
    let mut sizes = Vec::new();
    for (number, pass) in reference.passes.iter().enumerate() {
        let resources = reference.pass_resources(pass, resources);
        let outcome = match &pass.work {
            PassWork::Launch(launch) => {
                let pipeline = reference.pass_pipeline(launch);
                let plans: Vec<_> = pipeline.programs.iter().map(ProgramPlan::new).collect();
                let pass_pipeline = launch.pipeline;
                let seen = traced.entry(pass_pipeline).or_default();
                let size = launch.size(&resources);
                sizes.push(LaunchSize { invocations: size, workgroup: [1; 3] });
                let launch = Launch { pipeline: &pipeline, resources: &resources };
                let clean = CleanLaunch { scene, launch: &launch, plans: &plans, levels };
                if let Some(clean) = clean.run(size, &unwritten, seen) {
                    unwritten = clean.unwritten;
                    *seen = clean.seen;
                    stats = stats.plus(&clean.stats);
                    continue;
                }
                let mut sanitizer = Sanitizer::new(&plans, levels)
                    .of_pipeline(&pipeline)
                    .with_unwritten(unwritten)
                    .with_resources(&resources);
                let mut watch = RayWatch::new(&pipeline, scene, levels, seen);
                let side_by_side = SideBySide::of(&plans, &resources);
                let outcome = launch.run_observed(size, &mut watch, &mut sanitizer);
                let first = reference.first_program(pass_pipeline);
                findings.extend(watch.into_findings_of_launch().of_shaders_from(first));
                let (found, left) = sanitizer.into_findings_and_unwritten();
                findings.extend(found.of_shaders_from(first));
                if let Some(run) = side_by_side {
                    findings.extend(run.launch(&pipeline, size, levels).of_shaders_from(first));
                }
                unwritten = left;
                outcome
            }
            PassWork::Dispatch(at) => {
                let dispatch = &reference.dispatches[*at];
                let plans = [ProgramPlan::new(&dispatch.compute.program)];
                let mut sanitizer =
                    Sanitizer::new(&plans, levels).with_unwritten(unwritten).with_resources(&resources);
                let on_event = &mut |event| queried.add_event(&event);
                let compute = &dispatch.compute;
                let side_by_side = SideBySide::of(&plans, &resources);
                let groups = dispatch.groups(&resources);
                if let Some(layout) = compute.program.workgroup {
                    let invocations = |axis: usize| layout.size[axis].saturating_mul(groups[axis]);
                    let invocations = array::from_fn(invocations);
                    sizes.push(LaunchSize { invocations, workgroup: layout.size });
                }
                let outcome = compute.run_observed(&resources, groups, on_event, &mut sanitizer);
                let first = reference.dispatch_program(*at);
                let (found, left) = sanitizer.into_findings_and_unwritten();
                findings.extend(found.of_shaders_from(first));
                if let Some(run) = side_by_side {
                    findings.extend(run.dispatch(compute, groups, levels).of_shaders_from(first));
                }
                unwritten = left;
                outcome
            }
        };
        match outcome {
            Ok(more) => stats = stats.plus(&more),
            Err(trap) => {
                let first = reference.first_program_of(pass);
                let trap = reference.in_pass(number, in_module(trap, first, modules));
                return Ok(SanitizedRun { outcome: Err(trap), findings });
            }
        }
    }
    for (&pipeline, seen) in &traced {
        let (at, first) = (reference.pipeline_at(pipeline), reference.first_program(pipeline));
        findings.extend(seen.check_any_hit(at, scene, levels));
        // Rays that a shader did not trace in this run may meet any structure of the scene.
        let all: Vec<_> = scene.tlas.iter().map(|(_, tlas)| tlas.clone()).collect();
        if seen.structures().next().is_some() {
            findings.extend(check_records(at, &all, &host_rays(scene, at)?, levels).of_shaders_from(first));
        }
    }
    let all: Vec<&SeenRays> = traced.values().chain([&queried]).collect();
    findings.extend(SeenRays::check_masks(&all, scene, levels));
    findings.extend(unwritten.check_outputs(&sizes, levels));
    Ok(SanitizedRun { outcome: Ok(stats), findings })
}

/// The rays of a scene that the host traces.
fn host_rays(scene: &ResolvedScene, pipeline: &Pipeline) -> Result<Vec<HostRay>> {
    let mut rays = Vec::new();
    for request in &scene.rays {
        if let SingleRun::Ray(given) = ResolvedRequest::of(request)?.what {
            let operands = given.operands(pipeline)?;
            rays.push([operands.sbt_offset, operands.sbt_stride, operands.miss_index]);
        }
    }
    Ok(rays)
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
    let reference = assembled.for_sanitizer()?;
    let single = reference.single_launch(which.pass.as_deref())?;
    if single.pipeline.uses_subgroups() && single.pipeline.subgroup_size > 1 {
        let message =
            "a single invocation of a pipeline with subgroup instructions cannot run under the sanitizer";
        return Err(Error::new(ErrorKind::UnsupportedModule, message)
            .note("run the whole launch, or set the subgroup size to 1"));
    }
    let is_first = single.number == 0;
    single.run_before(resources)?;
    let resources = single.resources(resources);
    let mut findings = check_scene(scene, &reference, levels);
    let plans: Vec<_> = single.pipeline.programs.iter().map(ProgramPlan::new).collect();
    // What passes before it have written is not known.
    let unwritten = if is_first { unwritten_memory(scene, &resources) } else { UnwrittenMemory::default() };
    let mut sanitizer = Sanitizer::new(&plans, levels)
        .of_pipeline(&single.pipeline)
        .with_unwritten(unwritten)
        .with_resources(&resources);
    // One ray says nothing of what no ray does.
    let mut seen = SeenRays::default();
    let mut watch = RayWatch::new(&single.pipeline, scene, levels, &mut seen);
    let launch = Launch { pipeline: &single.pipeline, resources: &resources };
    let mut left = None;
    let outcome = {
        let (watch, sanitizer) = (Some(&mut watch as _), Some(&mut sanitizer as _));
        match &which.what {
            SingleRun::Pixel(id) => launch.run_one(*id, single.size_in(&resources), watch, sanitizer),
            SingleRun::Ray(given) => {
                let tlas = if let Some((_, tlas)) = scene.tlas.first() { tlas } else { Tlas::empty() };
                let operands = given.operands(launch.pipeline)?;
                let outcome = launch.trace_observed(tlas, operands, watch, sanitizer);
                outcome.map(|outcome| {
                    let stats = outcome.stats.clone();
                    left = Some(outcome);
                    stats
                })
            }
        }
    };
    if let Some(outcome) = left {
        sanitizer.check_payload(&outcome);
    }
    let (first, modules) = (reference.first_program(single.index), module_files(scene, &reference));
    findings.extend(watch.into_findings().of_shaders_from(first));
    findings.extend(sanitizer.into_findings().of_shaders_from(first));
    let findings = findings.in_modules(&modules).of_same_shaders(&first_same(&reference));
    Ok(SanitizedRun { outcome: outcome.map_err(|trap| in_module(trap, first, &modules)), findings })
}

/// The error of what is denied, if anything is. Its reports are told apart from it.
///
/// # Errors
/// `Finding`.
pub fn deny(findings: &Findings) -> Result<()> {
    match findings.denied().count() {
        0 => Ok(()),
        1 => Err(Error::new(ErrorKind::Finding, "1 finding is denied")),
        count => Err(Error::new(ErrorKind::Finding, format!("{} findings are denied", grouped(count)))),
    }
}
