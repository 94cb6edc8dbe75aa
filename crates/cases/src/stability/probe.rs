//! Runs a scene's invocations one by one under observers.

use std::cell::RefCell;

use crate::tasks::in_tasks;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_debugger::session::{ResolvedRequest, SingleRun};
use anyhit_engine::machine::{Batch, Bindings, BlockIndex, Observer, OpIndex, Resources, ShaderIndex};
use anyhit_engine::pipeline::{Event, Launch, Pipeline};
use anyhit_scene::pass::{LaunchPass, PassWork};
use anyhit_scene::{Assembled, ResolvedScene};

/// A part of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RunPart {
    /// An invocation of ray generation.
    Invocation {
        /// Index of the pass in the scene.
        pass: usize,
        /// Index of the launch in the scene.
        launch: usize,
        /// The pipeline: a named one by its index, or `[pipeline]`.
        pipeline: Option<usize>,
        /// The launch index.
        id: [u32; 3],
    },
    /// A dispatch.
    Dispatch {
        /// Index of the pass in the scene.
        pass: usize,
        /// The index of its program among [`Programs`](super::place::Programs).
        program: usize,
    },
    /// A ray that the host traces, with a pipeline.
    Ray(Option<usize>),
}

impl RunPart {
    /// The pipeline, for what has one.
    pub(super) fn pipeline(self) -> Option<usize> {
        match self {
            Self::Invocation { pipeline, .. } | Self::Ray(pipeline) => pipeline,
            Self::Dispatch { .. } => None,
        }
    }
}

/// Observes the parts of a run one after the other, each in one lane.
pub(super) trait Probe: Send {
    /// Begins a part: the following calls belong to it.
    fn begin(&mut self, part: RunPart);
    /// The index of the first program of the part's pipeline among all programs of the scene.
    fn first_program(&self) -> usize;
    /// See [`Observer::resumed`].
    fn resumed(&mut self, shader: usize, batch: &mut Batch<1>);
    /// See [`Observer::stopped`].
    fn stopped(&mut self, batch: &Batch<1>);
    /// See [`Observer::after`].
    fn after(&mut self, batch: &mut Batch<1>, bindings: &Bindings, op: OpIndex);
    /// See [`Observer::edge`], for an edge that was taken.
    fn edge_taken(&mut self, block: BlockIndex, edge: u32);
    /// Receives an event of the pipeline.
    fn event(&mut self, event: &Event);
}

/// Passes the calls of an observer of the interpreter on to a probe.
struct ProbeObserver<'a, P> {
    probe: &'a RefCell<P>,
    /// The index of the observer's first program among all programs of the scene.
    first: usize,
}

impl<P: Probe> Observer<1> for ProbeObserver<'_, P> {
    fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<1>) {
        self.probe.borrow_mut().resumed(self.first + shader.index(), batch);
    }

    fn stopped(&mut self, _: ShaderIndex, batch: &Batch<1>) {
        self.probe.borrow_mut().stopped(batch);
    }

    fn after(&mut self, batch: &mut Batch<1>, bindings: &Bindings, op: OpIndex) {
        self.probe.borrow_mut().after(batch, bindings, op);
    }

    fn edge(&mut self, block: BlockIndex, edge: u32, lanes: u32) {
        if lanes > 0 {
            self.probe.borrow_mut().edge_taken(block, edge);
        }
    }
}

/// Runs the passes of a scene on resources. Each task of a launch ([`in_tasks`]) and each dispatch
/// has a probe of its own; all are given to `collect` in order.
pub(super) fn run<P: Probe>(
    assembled: &Assembled,
    resources: &Resources,
    make_probe: &(impl Fn() -> P + Sync),
    collect: &mut dyn FnMut(P),
) -> Result<()> {
    let mut launches = 0;
    for (number, pass) in assembled.passes.iter().enumerate() {
        let resources = assembled.pass_resources(pass, resources);
        match &pass.work {
            PassWork::Launch(one) => {
                let pipeline = assembled.pass_pipeline(one);
                let run = Launch { pipeline: &pipeline, resources: &resources };
                watch_launch(run, one, [number, launches], make_probe, collect)?;
                launches += 1;
            }
            PassWork::Dispatch(at) => {
                let (dispatch, first) = (&assembled.dispatches[*at], assembled.dispatch_program(*at));
                let probe = RefCell::new(make_probe());
                probe.borrow_mut().begin(RunPart::Dispatch { pass: number, program: first });
                let outcome = dispatch.compute.run_one_lane_observed(
                    &resources,
                    dispatch.groups(&resources),
                    &mut ProbeObserver { probe: &probe, first },
                );
                collect(probe.into_inner());
                outcome?;
            }
        }
    }
    Ok(())
}

/// Runs the invocations of a launch one by one. The numbers are those of its pass and of the launch
/// among all.
fn watch_launch<P: Probe>(
    run: Launch<'_>,
    launch: &LaunchPass,
    [pass, number]: [usize; 2],
    make_probe: &(impl Fn() -> P + Sync),
    collect: &mut dyn FnMut(P),
) -> Result<()> {
    check_single_lane(run.pipeline)?;
    let size = launch.size(run.resources);
    let done = in_tasks(&run, size, |_, ids| {
        let probe = RefCell::new(make_probe());
        let mut outcome = Ok(());
        for id in ids {
            probe.borrow_mut().begin(RunPart::Invocation {
                pass,
                launch: number,
                pipeline: launch.pipeline,
                id,
            });
            let mut sink = |event: Event| probe.borrow_mut().event(&event);
            let first = probe.borrow().first_program();
            let mut observer = ProbeObserver { probe: &probe, first };
            outcome = run.run_one(id, size, Some(&mut sink), Some(&mut observer)).map(|_| ());
            if outcome.is_err() {
                break;
            }
        }
        (probe.into_inner(), outcome)
    });
    for (probe, outcome) in done {
        collect(probe);
        outcome?;
    }
    Ok(())
}

/// Runs one ray from the host, or one invocation of ray generation; `event` receives the events,
/// too.
pub(super) fn run_one<P: Probe>(
    scene: &ResolvedScene,
    assembled: &Assembled,
    resources: &Resources,
    which: &ResolvedRequest,
    probe: P,
    event: &mut dyn FnMut(Event),
) -> Result<(P, Result<()>)> {
    let single = assembled.single_launch(which.pass.as_deref())?;
    check_single_lane(&single.pipeline)?;
    single.run_before(resources)?;
    let resources = single.resources(resources);
    let probe = RefCell::new(probe);
    let launch = Launch { pipeline: &single.pipeline, resources: &resources };
    let outcome = {
        let mut sink = |one: Event| {
            probe.borrow_mut().event(&one);
            event(one);
        };
        let pipeline = single.index;
        probe.borrow_mut().begin(match &which.what {
            SingleRun::Pixel(id) => RunPart::Invocation { pass: single.number, launch: 0, pipeline, id: *id },
            SingleRun::Ray(_) => RunPart::Ray(pipeline),
        });
        let first = probe.borrow().first_program();
        let mut observer = ProbeObserver { probe: &probe, first };
        let (sink, observer) = (Some(&mut sink as _), Some(&mut observer as _));
        match &which.what {
            SingleRun::Pixel(id) => {
                launch.run_one(*id, single.size_in(&resources), sink, observer).map(|_| ())
            }
            SingleRun::Ray(given) => {
                let Some((_, tlas)) = scene.tlas.first() else {
                    let message = "a ray needs a scene with instances";
                    return Err(Error::new(ErrorKind::InvalidScene, message));
                };
                let operands = given.operands(launch.pipeline)?;
                launch.trace_observed(tlas, operands, sink, observer).map(|_| ())
            }
        }
    };
    Ok((probe.into_inner(), outcome))
}

/// Refuses pipelines whose invocations cannot run one by one.
fn check_single_lane(pipeline: &Pipeline) -> Result<()> {
    if pipeline.uses_subgroups() && pipeline.subgroup_size > 1 {
        let message = "single invocations of a pipeline with subgroup instructions cannot be observed";
        return Err(Error::new(ErrorKind::UnsupportedModule, message)
            .note("set the subgroup size to 1 to run each invocation separately"));
    }
    Ok(())
}
