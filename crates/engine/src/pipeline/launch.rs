//! Launches: a grid of ray generation invocations, or one ray.

use std::ops::Range;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::machine::{Bindings, Observer, OpenChoices, Reg, Registers, Resources, TaskWatch, Watchdog};
use crate::math::array;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::ray_rules;
use crate::pipeline::Pipeline;
use crate::pipeline::host_ray::{RayOperands, RayOutcome, ShadowWord};
use crate::pipeline::observer::{OnlyInvocation, PipelineObserver};
use crate::pipeline::order::{InvocationOrder, OrderMatters};
use crate::pipeline::run_options::{BatchWidth, RunOptions};
use crate::pipeline::sbt::SbtRecord;
use crate::pipeline::stack::{Stack, bindings};
use crate::pipeline::stats::Stats;
use crate::pipeline::tasks::{TaskQueue, TaskResults};
use crate::pipeline::tracing::check_trace;
use crate::pipeline::trapped::{Trapped, host_ray_trap, spent_together, timed_out};
use anyhit_base::error::{Error, ErrorKind, Result};

/// A pipeline with its resources, ready to launch.
#[derive(Clone, Debug)]
pub struct Launch<'a> {
    /// The pipeline.
    pub pipeline: &'a Pipeline,
    /// The resources.
    pub resources: &'a Resources,
}

/// The number of invocations of one task, a multiple of the widest batch: enough that starting a
/// task costs little, few enough that the threads end at about the same time.
pub(super) fn task_size(count: u64) -> u64 {
    const MIN_SIZE: u64 = 128;
    (count / 1024).clamp(MIN_SIZE, 8192) / MIN_SIZE * MIN_SIZE
}

/// Up to this many invocations run on one thread: starting more threads would take longer.
pub(super) const MAX_SINGLE_THREADED: u64 = 1024;

impl Launch<'_> {
    /// Runs the ray generation shader over a grid.
    ///
    /// # Errors
    /// The trap of the lowest launch index. The other invocations have run nevertheless, but where
    /// a limit stopped one: then those behind it are stopped, too, and what they have left behind
    /// depends on the width.
    pub fn run(&self, size: [u32; 3], options: RunOptions<'_>) -> Result<Stats> {
        let count = self.invocation_count(size)?;
        self.run_positions(size, 0..count, &self.watchdog_of(count, options), &mut 0, options)
    }

    /// Runs the invocations at a range of positions in a launch's order. The range starts at a
    /// multiple of the widest batch. The watchdog is that of the whole launch; its tasks are
    /// numbered on from one range to the next: `first_task` is the number of this range's first.
    pub(super) fn run_positions(
        &self,
        size: [u32; 3],
        positions: Range<u64>,
        watchdog: &Arc<Watchdog>,
        first_task: &mut u64,
        options: RunOptions<'_>,
    ) -> Result<Stats> {
        let record = self.ray_generation()?;
        let bindings = bindings(self.pipeline, self.resources);
        let subgroups = self.pipeline.whole_subgroups();
        let ordered = self.pipeline.order_dependent();
        let single_threaded = ordered || self.pipeline.shared_memory(size, self.resources).is_some();
        let by_index = single_threaded || subgroups.is_some();
        let matters = OrderMatters { subgroup_size: subgroups, is_shared: single_threaded };
        let choices = self.resources.choices.as_deref().filter(|_| by_index);
        let order = match choices {
            Some(choices) => {
                InvocationOrder::drawn(size, matters.draw(choices, self.invocation_count(size)?))
            }
            None if by_index => InvocationOrder::by_index(size),
            None => InvocationOrder::by_tiles(size),
        };
        let one_by_one = ordered || choices.is_some_and(OpenChoices::runs_one_by_one);
        let is_small = positions.end - positions.start <= MAX_SINGLE_THREADED;
        let task_size = task_size(positions.end - positions.start);
        let task_count = (positions.end - positions.start).div_ceil(task_size);
        let tasks = TaskQueue::new(task_count);
        let work = LaunchTasks {
            record,
            bindings: &bindings,
            order,
            tasks: &tasks,
            positions,
            task_size,
            on_progress: options.on_progress,
            watchdog,
            first_task: *first_task,
        };
        *first_task += task_count;
        let worker = || match matters.width(one_by_one, options.width) {
            BatchWidth::One => self.run_tasks::<1>(&work),
            BatchWidth::Of64 => self.run_tasks::<64>(&work),
            BatchWidth::Of128 => self.run_tasks::<128>(&work),
        };
        tasks.run(options.most_threads(single_threaded || is_small), &worker).map_err(|trapped| trapped.error)
    }

    /// The loop of a worker thread: runs tasks until the queue is empty.
    fn run_tasks<const W: usize>(&self, work: &LaunchTasks<'_>) -> TaskResults
    where
        LaneKernel: Width<W>,
    {
        let (dog, first_task) = (work.watchdog, work.first_task);
        let watch = dog.watch();
        let mut stack = Stack::<W>::new(self.pipeline, work.bindings, None, None).watched(watch.clone());
        let mut together = None;
        for (task, range) in work.tasks.iter().map(|task| (task, work.range(task))) {
            let least = work.order.min_linear_index(&range);
            if work.tasks.is_after_trap(least) || dog.is_beyond(least) {
                continue;
            }
            watch.begin_task(range.end - range.start);
            stack.launch_batches(work.record, &work.order, range.clone());
            if let Some(trapped) = &stack.trapped {
                let linear_index = work.order.linear_index(trapped.launch_id);
                work.tasks.record_trap(linear_index);
                if trapped.code.is_limit() {
                    dog.stop_at(linear_index);
                }
            }
            if let (None, None, Some(code)) = (&stack.trapped, &together, watch.timed_out()) {
                let launch_id = work.order.launch_id(range.end - 1);
                let linear_index = work.order.linear_index(launch_id);
                work.tasks.record_trap(linear_index);
                dog.stop_at(linear_index);
                together = Some(timed_out(launch_id, code, dog));
            }
            // All tasks of the ranges before have ended.
            if let Some(over) = dog.end_task(first_task + task, watch.spent()) {
                let launch_id = work.order.launch_id(work.range(over - first_task).end - 1);
                dog.stop_at(work.order.linear_index(launch_id));
                together = Some(spent_together(None, launch_id, dog));
            }
            (work.on_progress)(range.end - range.start);
        }
        let numbered = |trapped: Trapped| (work.order.linear_index(trapped.launch_id), trapped);
        let own = TaskResults { stats: stack.stats, trapped: stack.trapped.map(numbered) };
        own.merge(TaskResults { stats: Stats::default(), trapped: together.map(numbered) })
    }

    /// The watchdog of a launch of so many invocations, which may have limits of its own.
    pub(super) fn watchdog_of(&self, invocations: u64, options: RunOptions<'_>) -> Arc<Watchdog> {
        Watchdog::new(options.limits.unwrap_or(self.pipeline.launch_limits), invocations)
    }

    /// The watchdog of a launch of so many invocations.
    pub(super) fn watchdog(&self, invocations: u64) -> Arc<Watchdog> {
        self.watchdog_of(invocations, RunOptions::default())
    }

    /// The number of invocations of a launch; an error above `maxRayDispatchInvocationCount`.
    pub(super) fn invocation_count(&self, size: [u32; 3]) -> Result<u64> {
        let count = size.iter().try_fold(1u64, |count, &side| count.checked_mul(side.into()));
        let limit = self.pipeline.max_invocations;
        count.filter(|&count| count <= limit).ok_or_else(|| {
            Error::new(
                ErrorKind::InvalidArgument,
                format!(
                    "a launch of {} x {} x {} exceeds the limit of {limit} invocations \
                     (maxRayDispatchInvocationCount)",
                    size[0], size[1], size[2]
                ),
            )
        })
    }

    pub(super) fn ray_generation(&self) -> Result<&SbtRecord> {
        self.pipeline.sbt.ray_generation.as_ref().ok_or_else(|| {
            Error::new(
                ErrorKind::InvalidScene,
                "the pipeline has no ray generation shader: there is nothing to launch",
            )
        })
    }

    /// Runs the ray generation shader for one launch index in one lane, under observers. If a
    /// shader has subgroup instructions, its whole subgroup runs: the pipeline observer sees only
    /// that index, and operations are not observed.
    ///
    /// # Errors
    /// The trap, if there is one; `InvalidArgument` for an index outside the launch, and as
    /// [`Launch::run`].
    pub fn run_one(
        &self,
        id: [u32; 3],
        size: [u32; 3],
        pipeline_observer: Option<&mut dyn PipelineObserver>,
        observer: Option<&mut dyn Observer<1>>,
    ) -> Result<Stats> {
        let record = self.ray_generation()?;
        self.check_invocation(id, size)?;
        if self.pipeline.uses_subgroups() && self.pipeline.subgroup_size > 1 {
            return match self.pipeline.subgroup_size {
                ..=64 => self.run_subgroup::<64>(record, id, size, pipeline_observer),
                _ => self.run_subgroup::<128>(record, id, size, pipeline_observer),
            };
        }
        let bindings = bindings(self.pipeline, self.resources);
        let mut stack = Stack::<1>::new(self.pipeline, &bindings, pipeline_observer, observer)
            .watched(self.watch_of_one());
        let order = InvocationOrder::by_index(size);
        let position = order.linear_index(id);
        stack.launch_batch(record, &order, position..position + 1);
        match stack.trapped {
            Some(trapped) => Err(trapped.error),
            None => Ok(stack.stats),
        }
    }

    /// Checks that a launch has an invocation.
    pub(super) fn check_invocation(&self, id: [u32; 3], size: [u32; 3]) -> Result<()> {
        self.invocation_count(size)?;
        if id.iter().zip(size).all(|(&at, side)| at < side) {
            return Ok(());
        }
        let ([x, y, z], [width, height, depth]) = (id, size);
        let message = format!("invocation {x},{y},{z} is outside the launch of {width} x {height} x {depth}");
        Err(Error::new(ErrorKind::InvalidArgument, message))
    }

    /// The positions of an invocation's subgroup in the launch by index.
    pub(super) fn subgroup_of(&self, id: [u32; 3], size: [u32; 3]) -> Range<u64> {
        let subgroup = u64::from(self.pipeline.subgroup_size);
        let first = InvocationOrder::by_index(size).linear_index(id) / subgroup * subgroup;
        let count: u64 = array::map(size, u64::from).iter().product();
        first..count.min(first + subgroup)
    }

    /// The watch of what runs without a launch: one invocation, one ray.
    pub(super) fn watch_of_one(&self) -> Arc<TaskWatch> {
        let watch = self.watchdog(1).watch();
        watch.begin_task(1);
        watch
    }

    /// Runs the subgroup of a launch index; the observer sees only the events of that index.
    fn run_subgroup<const W: usize>(
        &self,
        record: &SbtRecord,
        id: [u32; 3],
        size: [u32; 3],
        pipeline_observer: Option<&mut dyn PipelineObserver>,
    ) -> Result<Stats>
    where
        LaneKernel: Width<W>,
    {
        let bindings = bindings(self.pipeline, self.resources);
        let mut only = pipeline_observer.map(|observer| OnlyInvocation::new(id, observer));
        let only = only.as_mut().map(|only| only as &mut dyn PipelineObserver);
        let mut stack = Stack::<W>::new(self.pipeline, &bindings, only, None).watched(self.watch_of_one());
        stack.launch_batch(record, &InvocationOrder::by_index(size), self.subgroup_of(id, size));
        match stack.trapped {
            Some(trapped) => Err(trapped.error),
            None => Ok(stack.stats),
        }
    }

    /// Checks a ray that the host traces, as `OpTraceRayKHR` of a shader would.
    pub(super) fn check_ray(&self, operands: &RayOperands) -> Result<()> {
        check_trace(&operands.trace, self.pipeline.flags).map_err(|rule| {
            let rule = ray_rules::describe_of_trace(rule);
            Error::new(ErrorKind::InvalidArgument, format!("invalid ray: {rule}"))
        })
    }

    /// Traces one ray without a ray generation shader.
    ///
    /// # Errors
    /// The trap, if there is one; `InvalidArgument` for a ray that breaks a rule.
    pub fn trace(
        &self,
        tlas: &Arc<Tlas>,
        operands: RayOperands,
        pipeline_observer: Option<&mut dyn PipelineObserver>,
    ) -> Result<RayOutcome> {
        self.trace_observed(tlas, operands, pipeline_observer, None)
    }

    /// Traces one ray as [`Launch::trace`] does, with an observer of the shaders' operations.
    ///
    /// # Errors
    /// As [`Launch::trace`].
    pub fn trace_observed(
        &self,
        tlas: &Arc<Tlas>,
        operands: RayOperands,
        pipeline_observer: Option<&mut dyn PipelineObserver>,
        observer: Option<&mut dyn Observer<1>>,
    ) -> Result<RayOutcome> {
        self.check_ray(&operands)?;
        let bindings = bindings(self.pipeline, self.resources);
        let mut stack = Stack::<1>::new(self.pipeline, &bindings, pipeline_observer, observer)
            .watched(self.watch_of_one());
        let trace = stack.trace(tlas, operands);
        let words = |payload: &Registers<1>| payload.lane_words(Reg(0), payload.len() as u32, 0).collect();
        match (stack.trapped, trace) {
            (Some(trapped), _) => Err(trapped.error),
            (None, Some(trace)) => match host_ray_trap(self.pipeline, &trace) {
                Some(trapped) => Err(trapped.error),
                None => Ok(RayOutcome {
                    committed: trace.committed[0],
                    payload: trace.host_payload.as_ref().map_or_else(Vec::new, words),
                    shadow: trace.host_payload.as_ref().map_or_else(Vec::new, shadow_words),
                    stats: stack.stats,
                }),
            },
            (None, None) => unreachable!("bug in anyhit: a trace without a ray"),
        }
    }
}

/// What a sanitizer knows of the words of a payload.
fn shadow_words(payload: &Registers<1>) -> Vec<ShadowWord> {
    let Some(shadow) = &payload.shadow else { return Vec::new() };
    let word = |register: Reg| ShadowWord {
        is_undefined: shadow.undefined(register).contains(0),
        cause: shadow.cause(register, 0),
    };
    (0..payload.len() as u32).map(|at| word(Reg(at))).collect()
}

/// The tasks of a launch and the data that its worker threads share.
struct LaunchTasks<'a> {
    record: &'a SbtRecord,
    bindings: &'a [Bindings],
    order: InvocationOrder,
    tasks: &'a TaskQueue,
    /// The positions of all tasks.
    positions: Range<u64>,
    /// The number of positions of a task.
    task_size: u64,
    on_progress: &'a (dyn Fn(u64) + Sync),
    /// The watchdog of the whole launch.
    watchdog: &'a Arc<Watchdog>,
    /// The number that the first of these tasks has in the whole launch.
    first_task: u64,
}

impl LaunchTasks<'_> {
    /// The positions of a task.
    fn range(&self, task: u64) -> Range<u64> {
        let first = self.positions.start + task * self.task_size;
        first..self.positions.end.min(first + self.task_size)
    }
}
