//! Begins to debug an invocation or ray of a scene.

use std::sync::Arc;

use crate::session::{ExplainRequest, Session, SingleRun};
use anyhit_base::error::Result;
use anyhit_engine::accel::Tlas;
use anyhit_engine::machine::Resources;
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_engine::pipeline::{Company, Compute, Pipeline, SteppedDispatch, SteppedLaunch};
use anyhit_explain::names::Names;
use anyhit_explain::transcript::ShaderLabel;

use super::Debugger;
use super::debuggee::{DebuggedWidth, Debuggee};
use super::memory_state::ChangingMemory;

/// Invocations of a workgroup from which on those that are not followed share batches: of fewer,
/// the registers of a checkpoint would take more memory than they save time.
const SHARING_GROUP: u64 = 32;

impl Debugger {
    /// Calls a function, and puts back what the memory of a scene held before.
    pub fn keeping_memory<T>(session: &Session, run: impl FnOnce() -> T) -> T {
        let assembled = &session.assembled;
        let programs: Vec<_> = assembled.programs().cloned().collect();
        let memory = ChangingMemory::of(&programs, &assembled.resources);
        let before = memory.state(None);
        let result = run();
        memory.restore(&before);
        result
    }

    /// Debugs an invocation or ray of a scene, which has not begun. The passes before it have run.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub fn of_scene(session: &Session, request: &ExplainRequest) -> Result<Self> {
        Self::of_shaders(session, request, &|_| true)
    }

    /// [`Debugger::of_scene`] whose workgroup is observed as a whole, invocation by invocation.
    pub(super) fn observing_all(session: &Session, request: &ExplainRequest) -> Result<Self> {
        match session.invocation(request)? {
            Some((dispatch, id)) => Self::of_dispatch(session, dispatch, id, Some(Company::Observed)),
            None => Self::of_scene(session, request),
        }
    }

    /// [`Debugger::of_scene`] of an invocation or ray that is known to run only some of the shaders
    /// of its pipeline: nothing can be told of the variables of others.
    ///
    /// # Errors
    /// As [`Session::run`].
    pub(crate) fn of_shaders(
        session: &Session,
        request: &ExplainRequest,
        runs: &dyn Fn(&ShaderLabel) -> bool,
    ) -> Result<Self> {
        if let Some((dispatch, id)) = session.invocation(request)? {
            return Self::of_dispatch(session, dispatch, id, None);
        }
        let (_, request) = session.resolve(request)?;
        let all = &session.assembled.resources;
        let single = session.assembled.single_launch(request.pass.as_deref())?;
        single.run_before(all)?;
        let resources = single.resources(all).into_owned();
        let size = single.size_in(&resources);
        let names = Names::new(&session.scene, single.index, &single.pipeline);
        let pipeline = Arc::new(single.pipeline.partly_unoptimized(|shader| runs(&names.shader(shader)))?);
        let needs_subgroup = pipeline.uses_subgroups() && pipeline.subgroup_size > 1;
        let debuggee: Box<dyn Debuggee> = match request.what {
            SingleRun::Pixel(id) => match needs_subgroup.then_some(pipeline.subgroup_size) {
                None => of_invocation::<1>(&pipeline, &resources, id, size)?,
                Some(..=64) => of_invocation::<64>(&pipeline, &resources, id, size)?,
                Some(_) => of_invocation::<128>(&pipeline, &resources, id, size)?,
            },
            SingleRun::Ray(ray) => {
                let tlas = match session.scene.tlas.first() {
                    Some((_, tlas)) => tlas,
                    None => Tlas::empty(),
                };
                let operands = ray.operands(&pipeline)?;
                Box::new(SteppedLaunch::<1>::of_ray(pipeline.clone(), &resources, tlas, operands)?)
            }
        };
        Ok(Self::with(debuggee, pipeline, &resources))
    }

    pub(super) fn of_dispatch(
        session: &Session,
        number: usize,
        id: [u32; 3],
        company: Option<Company>,
    ) -> Result<Self> {
        let dispatch = session.dispatch(number)?;
        let pass = session.run_before_dispatch(number)?;
        let resources = session.assembled.pass_resources(pass, &session.assembled.resources).into_owned();
        let groups = dispatch.groups(&resources);
        Self::of_compute_in(&dispatch.compute, &resources, groups, id, company)
    }

    /// Debugs an invocation of a compute shader, given by its `GlobalInvocationId`, which has not
    /// begun; its workgroup runs with it.
    ///
    /// # Errors
    /// `InvalidArgument` for an invocation outside the dispatch.
    pub fn of_compute(
        compute: &Compute,
        resources: &Resources,
        groups: [u32; 3],
        id: [u32; 3],
    ) -> Result<Self> {
        Self::of_compute_in(compute, resources, groups, id, None)
    }

    /// [`Debugger::of_compute`] of an invocation in the company that is given, if one is.
    pub(super) fn of_compute_in(
        compute: &Compute,
        resources: &Resources,
        groups: [u32; 3],
        id: [u32; 3],
        company: Option<Company>,
    ) -> Result<Self> {
        let compute = compute.unoptimized()?;
        let company = company.unwrap_or_else(|| company_in(&compute, resources, groups));
        let pipeline = Arc::new(compute.as_pipeline()?);
        let subgroup = compute.program.uses_subgroups.then_some(compute.subgroup_size);
        let debuggee = match subgroup {
            None | Some(1) if company != Company::Alone => {
                of_invocation_of_group::<1>(compute, resources, groups, id, company)?
            }
            None | Some(..=64) => of_invocation_of_group::<64>(compute, resources, groups, id, company)?,
            Some(_) => of_invocation_of_group::<128>(compute, resources, groups, id, company)?,
        };
        Ok(Self::with(debuggee, pipeline, resources))
    }

    /// Debugs what has not begun: the shaders of a pipeline, which is not optimised, on resources.
    pub fn with(debuggee: Box<dyn Debuggee>, pipeline: Arc<Pipeline>, resources: &Resources) -> Self {
        let memory = ChangingMemory::of(&pipeline.programs, resources);
        if let Some(printed) = &resources.printed {
            // What was printed before is not the invocation's.
            printed.take();
        }
        Self::new(debuggee, pipeline, memory, resources.printed.clone())
    }
}

/// An invocation in batches of a width.
fn of_invocation<const W: usize>(
    pipeline: &Arc<Pipeline>,
    resources: &Resources,
    id: [u32; 3],
    size: [u32; 3],
) -> Result<Box<dyn Debuggee>>
where
    LaneKernel: DebuggedWidth<W>,
{
    Ok(Box::new(SteppedLaunch::<W>::of_invocation(pipeline.clone(), resources, id, size)?))
}

/// The company in which an invocation of a compute shader is debugged.
pub(super) fn company_in(compute: &Compute, resources: &Resources, groups: [u32; 3]) -> Company {
    match compute.group_size() >= SHARING_GROUP && compute.is_free_of_order(groups, resources) {
        true => Company::Alone,
        false => Company::Batch,
    }
}

/// An invocation of a compute shader in batches of a width.
fn of_invocation_of_group<const W: usize>(
    compute: Compute,
    resources: &Resources,
    groups: [u32; 3],
    id: [u32; 3],
    company: Company,
) -> Result<Box<dyn Debuggee>>
where
    LaneKernel: DebuggedWidth<W>,
{
    Ok(Box::new(SteppedDispatch::<W>::new(compute, resources, groups, id, company)?))
}
