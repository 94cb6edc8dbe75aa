//! One shader or one ray on one thread, under observers; a trap is returned as [`Trapped`].

use std::sync::Arc;

use crate::accel::Tlas;
use crate::machine::{Invocation, Observer};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::group::Shader;
use crate::pipeline::host_ray::RayOperands;
use crate::pipeline::launch::Launch;
use crate::pipeline::observer::PipelineObserver;
use crate::pipeline::order::LaunchOrder;
use crate::pipeline::stack::{Stack, bindings};
use crate::pipeline::stats::Stats;
use crate::pipeline::trapped::Trapped;

impl Launch<'_> {
    /// Runs the pipeline's ray generation shader over a small grid, W lanes at a time.
    ///
    /// # Errors
    /// The trap of the lowest launch index.
    pub fn run_single_threaded<const W: usize, T: PipelineObserver, O: Observer<W>>(
        &self,
        size: [u32; 3],
        (pipeline_observer, observer): (&mut T, &mut O),
    ) -> Result<Stats, Box<Trapped>>
    where
        LaneKernel: Width<W>,
    {
        let Some(record) = &self.pipeline.sbt.ray_generation else { return Ok(Stats::default()) };
        let bindings = bindings(self.pipeline, self.resources);
        let count = size.iter().map(|&side| u64::from(side)).product::<u64>();
        let watch = self.watchdog(count).watch();
        watch.begin_task(count);
        let mut stack =
            Stack::<W, T, O>::new(self.pipeline, &bindings, pipeline_observer, observer).watched(watch);
        stack.launch_batches(record, &LaunchOrder::by_index(size), 0..count);
        outcome(stack.trapped, stack.stats)
    }

    /// Runs a shader for one invocation, in the first of W lanes, without a caller. The payload and
    /// attributes that it writes are discarded. Intersection shaders cannot run so: they report to
    /// a trace.
    ///
    /// # Errors
    /// The trap.
    pub fn invoke<const W: usize, T: PipelineObserver, O: Observer<W>>(
        &self,
        shader: Shader,
        invocation: Invocation,
        payload: &[u32],
        attributes: &[u32],
        (pipeline_observer, observer): (&mut T, &mut O),
    ) -> Result<Stats, Box<Trapped>>
    where
        LaneKernel: Width<W>,
    {
        let bindings = bindings(self.pipeline, self.resources);
        let mut stack = Stack::<W, T, O>::new(self.pipeline, &bindings, pipeline_observer, observer)
            .watched(self.watch_of_one());
        stack.invoke(shader, invocation, payload.into(), attributes.into());
        outcome(stack.trapped, stack.stats)
    }

    /// Traces one ray, in the first of W lanes, without a ray generation shader.
    ///
    /// # Errors
    /// The trap.
    pub fn trace_single<const W: usize, T: PipelineObserver, O: Observer<W>>(
        &self,
        tlas: &Arc<Tlas>,
        operands: RayOperands,
        (pipeline_observer, observer): (&mut T, &mut O),
    ) -> Result<Stats, Box<Trapped>>
    where
        LaneKernel: Width<W>,
    {
        let bindings = bindings(self.pipeline, self.resources);
        let mut stack = Stack::<W, T, O>::new(self.pipeline, &bindings, pipeline_observer, observer)
            .watched(self.watch_of_one());
        stack.trace(tlas, operands);
        outcome(stack.trapped, stack.stats)
    }
}

fn outcome(trapped: Option<Trapped>, stats: Stats) -> Result<Stats, Box<Trapped>> {
    trapped.map_or(Ok(stats), |trapped| Err(Box::new(trapped)))
}
