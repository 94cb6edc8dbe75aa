//! Runs a scene's invocations one by one under observers.

use std::cell::RefCell;

use crate::debug::session::ResolvedRequest;
use crate::error::{Error, ErrorKind, Result};
use crate::harness::run::in_tasks;
use crate::machine::{Batch, Bindings, Observer, Resources};
use crate::pipeline::{Event, Launch};
use crate::scene::{Assembled, ResolvedScene};

/// A part of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RunPart {
    /// An invocation of ray generation.
    Invocation([u32; 3]),
    /// A dispatch, by the index of its program among [`Programs`](super::place::Programs).
    Dispatch(usize),
    /// A ray that the host traces.
    Ray,
}

/// Observes the parts of a run one after the other, each in one lane.
pub(super) trait Probe: Send {
    /// Begins a part: the following calls belong to it.
    fn begin(&mut self, part: RunPart);
    /// See [`Observer::resumed`].
    fn resumed(&mut self, shader: usize, batch: &mut Batch<1>);
    /// See [`Observer::stopped`].
    fn stopped(&mut self, batch: &Batch<1>);
    /// See [`Observer::after`].
    fn after(&mut self, batch: &mut Batch<1>, bindings: &Bindings, op: u32);
    /// See [`Observer::edge`], for an edge that was taken.
    fn edge_taken(&mut self, block: u32, edge: u32);
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
    fn resumed(&mut self, shader: u32, batch: &mut Batch<1>) {
        self.probe.borrow_mut().resumed(self.first + shader as usize, batch);
    }

    fn stopped(&mut self, _: u32, batch: &Batch<1>) {
        self.probe.borrow_mut().stopped(batch);
    }

    fn after(&mut self, batch: &mut Batch<1>, bindings: &Bindings, op: u32) {
        self.probe.borrow_mut().after(batch, bindings, op);
    }

    fn edge(&mut self, block: u32, edge: u32, lanes: u32) {
        if lanes > 0 {
            self.probe.borrow_mut().edge_taken(block, edge);
        }
    }
}

/// Runs the launch and the dispatches of a scene on resources. Each task of the launch
/// ([`in_tasks`]) and each dispatch has a probe of its own; all are given to `collect` in order.
pub(super) fn run<P: Probe>(
    assembled: &Assembled,
    resources: &Resources,
    make_probe: &(impl Fn(u64) -> P + Sync),
    collect: &mut dyn FnMut(P),
) -> Result<()> {
    if assembled.is_frame() {
        let message = "watching the invocations of a scene whose `[[pass]]` launch the pipeline";
        return Err(Error::new(ErrorKind::UnsupportedModule, message));
    }
    let pipeline = &assembled.pipeline;
    let mut number = 0;
    if pipeline.sbt.ray_generation.is_some() {
        check_single_lane(assembled)?;
        let launch = Launch { pipeline, resources };
        let done = in_tasks(assembled, |number, ids| {
            let probe = RefCell::new(make_probe(number));
            let mut outcome = Ok(());
            for id in ids {
                outcome = invocation(&launch, assembled, id, &probe);
                if outcome.is_err() {
                    break;
                }
            }
            (probe.into_inner(), outcome)
        });
        number = done.len() as u64;
        for (probe, outcome) in done {
            collect(probe);
            outcome?;
        }
    }
    for (at, dispatch) in assembled.dispatches.iter().enumerate() {
        let first = pipeline.programs.len() + at;
        let probe = RefCell::new(make_probe(number + at as u64));
        probe.borrow_mut().begin(RunPart::Dispatch(first));
        let own = dispatch.push_constants.clone();
        let own = own.map(|constants| Resources { push_constants: Some(constants), ..resources.clone() });
        let resources = own.as_ref().unwrap_or(resources);
        let outcome = dispatch.compute.run_one_lane_observed(
            resources,
            dispatch.groups,
            &mut ProbeObserver { probe: &probe, first },
        );
        collect(probe.into_inner());
        outcome?;
    }
    Ok(())
}

/// Runs one invocation of ray generation.
pub(super) fn invocation<P: Probe>(
    launch: &Launch<'_>,
    assembled: &Assembled,
    id: [u32; 3],
    probe: &RefCell<P>,
) -> Result<()> {
    probe.borrow_mut().begin(RunPart::Invocation(id));
    let mut sink = |event: Event| probe.borrow_mut().event(&event);
    let mut sink: &mut dyn FnMut(Event) = &mut sink;
    let mut observer = ProbeObserver { probe, first: 0 };
    let mut observer: &mut dyn Observer<1> = &mut observer;
    launch.run_one(id, assembled.size, &mut sink, &mut observer).map(|_| ())
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
    check_single_lane(assembled)?;
    let probe = RefCell::new(probe);
    let launch = Launch { pipeline: &assembled.pipeline, resources };
    let outcome = {
        let mut sink = |one: Event| {
            probe.borrow_mut().event(&one);
            event(one);
        };
        let mut sink: &mut dyn FnMut(Event) = &mut sink;
        let mut observer = ProbeObserver { probe: &probe, first: 0 };
        let mut observer: &mut dyn Observer<1> = &mut observer;
        match which {
            ResolvedRequest::Pixel(id) => {
                probe.borrow_mut().begin(RunPart::Invocation(*id));
                launch.run_one(*id, assembled.size, &mut sink, &mut observer).map(|_| ())
            }
            ResolvedRequest::Ray(given) => {
                probe.borrow_mut().begin(RunPart::Ray);
                let Some((_, tlas)) = scene.tlas.first() else {
                    let message = "a ray needs a scene with instances";
                    return Err(Error::new(ErrorKind::InvalidScene, message));
                };
                let operands = given.operands(launch.pipeline)?;
                launch.trace_observed(tlas, operands, &mut sink, &mut observer).map(|_| ())
            }
        }
    };
    Ok((probe.into_inner(), outcome))
}

/// Refuses pipelines whose invocations cannot run one by one.
fn check_single_lane(assembled: &Assembled) -> Result<()> {
    if assembled.pipeline.uses_subgroups() && assembled.pipeline.subgroup_size > 1 {
        let message = "watching invocations one by one, of a pipeline with subgroup instructions";
        return Err(Error::new(ErrorKind::UnsupportedModule, message)
            .note("set the subgroup size to 1 to run each invocation by itself"));
    }
    Ok(())
}
