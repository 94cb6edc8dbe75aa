//! Running a loaded scene: its launch, or one of its rays, on a copy of its resources.

use std::sync::Arc;

use crate::cost::{Costs, Meter};
use crate::coverage::Recorder;
use crate::expect::{Observed, RayFound};
use crate::observe::{first_ray, fresh_resources, read_resources};
use crate::stability::StableExpectation;
use crate::stability::perturb::perturb_one;
use crate::tasks::in_tasks;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_debugger::session::{self, ResolvedRequest};
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::{Observer, Resources};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::{BatchWidth, Event, Launch, Pipeline, PipelineObserver, RunOptions, Stats};
use anyhit_engine::program::Program;
use anyhit_engine::reflect::{Layout, Rules};
use anyhit_scene::file::RayEntry;
use anyhit_scene::pass::PassWork;
use anyhit_scene::{Assembled, ResolvedScene};

/// Runs a scene's launch and dispatches at a width, and traces its rays.
pub fn run(scene: &ResolvedScene, assembled: &Assembled, width: BatchWidth) -> Observed {
    let options = RunOptions::of(width);
    let mut observed = launch(scene, assembled, |resources| assembled.run(resources, options));
    observed.rays = rays(scene, assembled, &mut RayMeasurements::default());
    observed
}

/// Runs a scene's launch and dispatches at the batch width for their size; results do not depend on
/// the width.
pub fn run_launch(scene: &ResolvedScene, assembled: &Assembled) -> Observed {
    let width = match assembled.invocations() {
        0..=1 => BatchWidth::One,
        _ => BatchWidth::default(),
    };
    launch(scene, assembled, |resources| assembled.run(resources, RunOptions::of(width)))
}

/// Traces each ray of a scene, on resources as the scene describes them.
pub fn rays(
    scene: &ResolvedScene,
    assembled: &Assembled,
    measurements: &mut RayMeasurements<'_>,
) -> Vec<(Option<String>, Result<RayFound>)> {
    (0..scene.rays.len()).flat_map(|at| run_ray(scene, assembled, at, measurements).rays).collect()
}

/// Runs a scene as [`run`] does and records the coverage of its launch and dispatches.
pub fn launch_covered(scene: &ResolvedScene, assembled: &Assembled, recorder: &mut Recorder) -> Observed {
    launch(scene, assembled, |resources| {
        let mut stats = Stats::default();
        for (number, pass) in assembled.passes.iter().enumerate() {
            let resources = assembled.pass_resources(pass, resources);
            let more = match &pass.work {
                PassWork::Launch(launch) => {
                    let (mut sink, counts) = recorder.parts(launch.pipeline);
                    let pipeline = assembled.pass_pipeline(launch);
                    let size = launch.size(&resources);
                    let launch = Launch { pipeline: &pipeline, resources: &resources };
                    launch.run_observed(size, &mut |event: Event| sink.event(&event), counts)
                }
                PassWork::Dispatch(at) => {
                    let (mut sink, counts) = recorder.dispatch(*at);
                    let dispatch = &assembled.dispatches[*at];
                    let on_event = &mut |event: Event| sink.event(&event);
                    dispatch.compute.run_observed(&resources, dispatch.groups(&resources), on_event, counts)
                }
            };
            stats = stats.plus(&more.map_err(|error| assembled.in_pass(number, error))?);
        }
        Ok(stats)
    })
}

fn launch(
    scene: &ResolvedScene,
    assembled: &Assembled,
    run: impl FnOnce(&Resources) -> Result<Stats>,
) -> Observed {
    let resources = fresh_resources(assembled);
    let mut observed = Observed::default();
    if !assembled.passes.is_empty() {
        match run(&resources) {
            Ok(stats) => observed.stats = Some(stats),
            Err(trap) => observed.trap = Some(trap),
        }
    }
    read_resources(scene, &resources, &mut observed);
    observed
}

/// Counts the cost of every ray of a scene's launches. Each invocation runs by itself.
///
/// # Errors
/// The trap of the first invocation that traps, and `UnsupportedModule` where invocations cannot
/// run by themselves.
pub fn costs(assembled: &Assembled) -> Result<Costs> {
    let resources = fresh_resources(assembled);
    let last = assembled.passes.iter().rposition(|pass| pass.launch().is_some());
    let mut sum = Costs::default();
    for pass in &assembled.passes[..last.map_or(0, |last| last + 1)] {
        let Some(launch) = pass.launch() else {
            assembled.run_pass(pass, &resources, RunOptions::default())?;
            continue;
        };
        let (pipeline, resources) =
            (assembled.pass_pipeline(launch), assembled.pass_resources(pass, &resources));
        sum = sum
            .or(costs_of(&Launch { pipeline: &pipeline, resources: &resources }, launch.size(&resources))?);
    }
    Ok(sum)
}

fn costs_of(launch: &Launch<'_>, size: [u32; 3]) -> Result<Costs> {
    if launch.pipeline.uses_subgroups() && launch.pipeline.subgroup_size > 1 {
        let message = "the cost of single rays cannot be counted in a pipeline with subgroup instructions";
        return Err(Error::new(ErrorKind::UnsupportedModule, message)
            .note("set the subgroup size to 1 to count each invocation separately"));
    }
    let run = |meter: &mut Meter, id: [u32; 3]| {
        meter.begin(Some(id));
        let meter = &*meter;
        let mut sink = |event: Event| meter.event(&event);
        launch.run_one(id, size, Some(&mut sink), Some(&mut meter.counter()))
    };
    let all = in_tasks(launch, size, |_, ids| {
        let mut meter = Meter::new(launch.pipeline);
        for id in ids {
            run(&mut meter, id)?;
        }
        Ok(meter.costs())
    });
    all.into_iter().try_fold(Costs::default(), |sum, one| Ok(sum.or(one?)))
}

/// What is measured while a ray runs.
#[derive(Debug, Default)]
pub struct RayMeasurements<'a> {
    /// The recorder of coverage, if coverage is wanted.
    pub recorder: Option<&'a mut Recorder>,
    /// Whether to count the ray's cost.
    pub costs: bool,
    /// The stability expectation to check, if there is one.
    pub stable: Option<&'a StableExpectation>,
}

/// Runs one ray of a scene: returns its result, as the only entry of [`Observed::rays`], and what
/// its shaders wrote.
pub fn run_ray(
    scene: &ResolvedScene,
    assembled: &Assembled,
    at: usize,
    measurements: &mut RayMeasurements<'_>,
) -> Observed {
    let entry = &scene.rays[at];
    let resources = fresh_resources(assembled);
    let mut observed = Observed::default();
    let outcome = single_ray(scene, assembled, entry, &resources, measurements, &mut observed);
    match outcome {
        Ok((stats, found)) => {
            observed.stats = Some(stats);
            observed.rays.push((entry.name().cloned(), Ok(found)));
        }
        Err(error) => {
            if error.kind() == ErrorKind::Trap {
                observed.trap = Some(error.clone());
            }
            observed.rays.push((entry.name().cloned(), Err(error)));
        }
    }
    read_resources(scene, &resources, &mut observed);
    if let Some(stable) = measurements.stable.filter(|_| observed.trap.is_none()) {
        let found = |which| perturb_one(scene, assembled, &which, &stable.perturbation);
        observed.stability = Some(ResolvedRequest::of(entry).and_then(found));
    }
    observed
}

/// Runs a ray in its pass, after the passes before it.
fn single_ray(
    scene: &ResolvedScene,
    assembled: &Assembled,
    entry: &RayEntry,
    resources: &Resources,
    measurements: &mut RayMeasurements<'_>,
    observed: &mut Observed,
) -> Result<(Stats, RayFound)> {
    let single = assembled.single_launch(entry.pass().map(|key| key.value.0.as_str()))?;
    single.run_before(resources)?;
    let resources = single.resources(resources);
    let size = single.size_in(&resources);
    let launch = Launch { pipeline: &single.pipeline, resources: &resources };
    let mut events: Vec<Event> = Vec::new();
    let stats = if measurements.recorder.is_none() && !measurements.costs {
        trace(scene, &launch, size, entry, &mut events, None)?
    } else {
        let mut meter = Meter::new(launch.pipeline);
        meter.begin(None);
        let mut unused = Recorder::default();
        let recorder = measurements.recorder.as_deref_mut().unwrap_or(&mut unused);
        let (mut sink, counts) = recorder.parts(single.index);
        let mut both = (counts, meter.counter());
        let mut sink = |event: Event| {
            meter.event(&event);
            sink.event(&event);
            events.push(event);
        };
        let outcome = trace(scene, &launch, size, entry, &mut sink, Some(&mut both));
        observed.costs = Some(meter.costs());
        outcome?
    };
    Ok((stats, first_ray(launch.pipeline, &events)))
}

/// Runs one ray, or one invocation of ray generation.
pub(super) fn trace(
    scene: &ResolvedScene,
    launch: &Launch<'_>,
    size: [u32; 3],
    ray: &RayEntry,
    pipeline_observer: &mut dyn PipelineObserver,
    observer: Option<&mut dyn Observer<1>>,
) -> Result<Stats> {
    match ray {
        RayEntry::Pixel { pixel, .. } => {
            let [x, y] = pixel.value;
            launch.run_one([x, y, 0], size, Some(pipeline_observer), observer)
        }
        RayEntry::Given(given) => {
            let tlas = if let Some((_, tlas)) = scene.tlas.first() { tlas } else { Tlas::empty() };
            let operands = session::check(given)?
                .operands(launch.pipeline)
                .map_err(|error| describe_payload(launch.pipeline).into_iter().fold(error, Error::note))?;
            let traced = launch.trace_observed(tlas, operands, Some(pipeline_observer), observer);
            traced.map(|outcome| outcome.stats)
        }
    }
}

/// Describes the largest payload that a pipeline's shaders declare: a line for each member, with
/// its offset.
fn describe_payload(pipeline: &Pipeline) -> Vec<String> {
    let registers = |program: &Arc<Program>| {
        let registers = program.interface_registers(storage::INCOMING_RAY_PAYLOAD)?;
        Some((program.clone(), registers.ty, registers.count))
    };
    let largest = pipeline.programs.iter().filter_map(registers).max_by_key(|(.., count)| *count);
    largest.map_or_else(Vec::new, |(program, ty, _)| {
        let module = &program.module;
        let lines = Layout::new(module, ty, Rules::Packed).lines().into_iter();
        let lines = lines.map(|(offset, member)| format!("{offset:>6}  {member}"));
        std::iter::once(format!("offset  {}", module.describe_type(ty))).chain(lines).collect()
    })
}
