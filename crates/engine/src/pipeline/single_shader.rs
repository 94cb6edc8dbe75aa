//! One shader or one ray on one thread, under observers; a trap is returned as [`Trapped`].

use std::sync::Arc;

use crate::accel::Tlas;
use crate::machine::{Invocation, Observer, ShaderIndex};
use crate::module::interface::Stage;
use crate::pipeline::host_ray::RayOperands;
use crate::pipeline::launch::Launch;
use crate::pipeline::observer::PipelineObserver;
use crate::pipeline::order::InvocationOrder;
use crate::pipeline::stack::{Stack, bindings};
use crate::pipeline::stats::Stats;
use crate::pipeline::trapped::{Trapped, host_ray_trap};
use anyhit_base::error::{Error, ErrorKind, Result};

/// How shaders end that ran: with their counts, or with a trap.
pub(super) type Ended = std::result::Result<Stats, Box<Trapped>>;

impl Launch<'_> {
    /// Runs the pipeline's ray generation shader over a small grid, 64 lanes at a time. The inner
    /// result is the trap of the lowest launch index.
    ///
    /// # Errors
    /// `InvalidArgument` for more invocations than `maxRayDispatchInvocationCount`.
    pub fn run_single_threaded(
        &self,
        size: [u32; 3],
        pipeline_observer: Option<&mut dyn PipelineObserver>,
        observer: Option<&mut dyn Observer<64>>,
    ) -> Result<Ended> {
        let count = self.invocation_count(size)?;
        let Some(record) = &self.pipeline.sbt.ray_generation else { return Ok(Ok(Stats::default())) };
        let bindings = bindings(self.pipeline, self.resources);
        let watch = self.watchdog(count).watch();
        watch.begin_task(count);
        let mut stack =
            Stack::<64>::new(self.pipeline, &bindings, pipeline_observer, observer).watched(watch);
        stack.launch_batches(record, &InvocationOrder::by_index(size), 0..count);
        Ok(outcome(stack.trapped, stack.stats))
    }

    /// Runs a shader for one invocation, in the first of 64 lanes, without a caller. The payload
    /// and attributes that it writes are discarded. The inner result is its trap.
    ///
    /// # Errors
    /// `InvalidArgument` where the pipeline has no such shader, and for one that does not run by
    /// itself: an intersection shader, which reports to a trace, and any that is not of ray
    /// tracing.
    pub fn invoke(
        &self,
        shader: ShaderIndex,
        invocation: Invocation,
        payload: &[u32],
        attributes: &[u32],
        pipeline_observer: Option<&mut dyn PipelineObserver>,
        observer: Option<&mut dyn Observer<64>>,
    ) -> Result<Ended> {
        let invalid = |message| Error::new(ErrorKind::InvalidArgument, message);
        let program = self.pipeline.programs.get(shader.index());
        let program = program.ok_or_else(|| invalid(format!("the pipeline has no shader {}", shader.0)))?;
        if matches!(program.stage, Stage::Intersection | Stage::Compute | Stage::Other(_)) {
            let (name, stage) = (&program.name, program.stage.name());
            return Err(invalid(format!("shader `{name}` is {stage}, which cannot run alone")));
        }
        let bindings = bindings(self.pipeline, self.resources);
        let mut stack = Stack::<64>::new(self.pipeline, &bindings, pipeline_observer, observer)
            .watched(self.watch_of_one());
        stack.invoke(shader, invocation, payload.into(), attributes.into());
        Ok(outcome(stack.trapped, stack.stats))
    }

    /// Traces one ray, in the first of 64 lanes, without a ray generation shader. The inner result
    /// is the trap.
    ///
    /// # Errors
    /// `InvalidArgument` for a ray that breaks a rule.
    pub fn trace_single(
        &self,
        tlas: &Arc<Tlas>,
        operands: RayOperands,
        pipeline_observer: Option<&mut dyn PipelineObserver>,
        observer: Option<&mut dyn Observer<64>>,
    ) -> Result<Ended> {
        self.check_ray(&operands)?;
        let bindings = bindings(self.pipeline, self.resources);
        let mut stack = Stack::<64>::new(self.pipeline, &bindings, pipeline_observer, observer)
            .watched(self.watch_of_one());
        let trace = stack.trace(tlas, operands);
        let of_ray = || trace.and_then(|trace| host_ray_trap(self.pipeline, &trace));
        Ok(outcome(stack.trapped.or_else(of_ray), stack.stats))
    }
}

fn outcome(trapped: Option<Trapped>, stats: Stats) -> Ended {
    trapped.map_or(Ok(stats), |trapped| Err(Box::new(trapped)))
}
