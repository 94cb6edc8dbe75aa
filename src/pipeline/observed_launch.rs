//! Launches under observers.

use std::ops::Range;
use std::sync::Arc;

use crate::error::Result;
use crate::machine::{Bindings, LaunchObserver, Observer, TaskWatch};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::launch::{Launch, MAX_SINGLE_THREADED, task_size};
use crate::pipeline::observer::PipelineObserver;
use crate::pipeline::order::InvocationOrder;
use crate::pipeline::sbt::SbtRecord;
use crate::pipeline::stack::{Stack, bindings};
use crate::pipeline::stats::Stats;
use crate::pipeline::tasks::{TaskQueue, TaskResults};
use crate::pipeline::trapped::{Trapped, spent_together, timed_out};

/// Runs the invocations of a task under a pipeline observer and an observer of operations.
pub type ObservedTask<'a> = dyn FnMut(&mut dyn PipelineObserver, &mut dyn LaunchObserver) + 'a;

/// The data that all tasks of an observed launch use.
struct ObservedTasks<'a> {
    record: &'a SbtRecord,
    bindings: &'a [Bindings],
    order: &'a InvocationOrder,
    /// Watches the thread that runs them.
    watch: Arc<TaskWatch>,
    /// Whether each invocation runs by itself.
    single_lane: bool,
}

impl Launch<'_> {
    /// Runs the ray generation shader over a grid under observers: in launch order, on one thread,
    /// with the same results as [`Launch::run`]. Events of the lanes of a batch are interleaved. A
    /// launch that needs subgroups of more than 64 is not observed.
    ///
    /// # Errors
    /// As [`Launch::run`].
    pub fn run_observed(
        &self,
        size: [u32; 3],
        pipeline_observer: &mut dyn PipelineObserver,
        observer: &mut dyn LaunchObserver,
    ) -> Result<Stats> {
        let record = self.ray_generation()?;
        let count = self.invocation_count(size)?;
        let bindings = bindings(self.pipeline, self.resources);
        let subgroups = self.pipeline.whole_subgroups();
        if subgroups.is_some_and(|size| size > 64) {
            return self.run::<64>(size, &|_| ());
        }
        let mut stats = Stats::default();
        let task_size = task_size(count);
        let (dog, order) = (self.watchdog(count), InvocationOrder::by_index(size));
        let work = ObservedTasks {
            record,
            bindings: &bindings,
            order: &order,
            watch: dog.watch(),
            single_lane: self.pipeline.order_dependent() && subgroups.is_none(),
        };
        for task in 0..count.div_ceil(task_size) {
            let range = task * task_size..count.min((task + 1) * task_size);
            let last = work.order.launch_id(range.end - 1);
            let (task_stats, trapped) = self.run_observed_task(&work, range, pipeline_observer, observer);
            if let Some(trapped) = trapped {
                return Err(trapped.error);
            }
            if dog.end_task(task, work.watch.spent()).is_some() {
                return Err(spent_together(None, last, &dog).error);
            }
            if let Some(code) = work.watch.timed_out() {
                return Err(timed_out(last, code, &dog).error);
            }
            stats = stats.plus(&task_stats);
        }
        Ok(stats)
    }

    /// Runs the ray generation shader over a grid as [`Launch::run_observed`] does, on all threads
    /// where [`Launch::run`] uses them. The function is called for each task with its positions in
    /// launch order, and must run it under observers of its own. Tasks are ascending; those behind
    /// a trap may be left out.
    ///
    /// # Errors
    /// As [`Launch::run`].
    pub fn run_observed_on_threads(
        &self,
        size: [u32; 3],
        observe: &(dyn Fn(Range<u64>, &mut ObservedTask<'_>) + Sync),
    ) -> Result<Stats> {
        let record = self.ray_generation()?;
        let count = self.invocation_count(size)?;
        let bindings = bindings(self.pipeline, self.resources);
        let subgroups = self.pipeline.whole_subgroups();
        if subgroups.is_some_and(|size| size > 64) {
            return self.run::<64>(size, &|_| ());
        }
        let ordered = self.pipeline.order_dependent();
        let single_threaded = ordered || self.pipeline.shared_memory(size, self.resources).is_some();
        let task_size = task_size(count);
        let (dog, order) = (self.watchdog(count), InvocationOrder::by_index(size));
        let tasks = TaskQueue::new(count.div_ceil(task_size));
        let range_of = |task: u64| task * task_size..count.min((task + 1) * task_size);
        let stop = |trapped: Trapped| {
            let number = order.linear_index(trapped.launch_id);
            tasks.record_trap(number);
            if trapped.code.is_limit() {
                dog.stop_at(number);
            }
            TaskResults { stats: Stats::default(), trapped: Some((number, trapped)) }
        };
        let worker = || {
            let watch = dog.watch();
            let single_lane = ordered && subgroups.is_none();
            let work = ObservedTasks {
                record,
                bindings: &bindings,
                order: &order,
                watch: watch.clone(),
                single_lane,
            };
            let mut results = TaskResults::default();
            for (task, range) in tasks.iter().map(|task| (task, range_of(task))) {
                if tasks.is_after_trap(range.start) || dog.is_beyond(range.start) {
                    continue;
                }
                let mut ran = None;
                observe(range.clone(), &mut |pipeline_observer, observer| {
                    ran = Some(self.run_observed_task(&work, range.clone(), pipeline_observer, observer));
                });
                let (stats, trapped) = ran.expect("bug in anyhit: an observed task did not run");
                let has_trapped = trapped.is_some();
                results = results.merge(TaskResults { stats, trapped: None });
                results = trapped.into_iter().map(&stop).fold(results, TaskResults::merge);
                if let (false, Some(code)) = (has_trapped, watch.timed_out()) {
                    results = results.merge(stop(timed_out(order.launch_id(range.end - 1), code, &dog)));
                }
                // All tasks before have ended.
                if let Some(over) = dog.end_task(task, watch.spent()) {
                    let last = order.launch_id(range_of(over).end - 1);
                    results = results.merge(stop(spent_together(None, last, &dog)));
                }
            }
            results
        };
        let is_small = count <= MAX_SINGLE_THREADED;
        tasks.run(single_threaded || is_small, &worker).map_err(|trapped| trapped.error)
    }

    /// Runs the invocations at a range of positions under observers.
    fn run_observed_task(
        &self,
        work: &ObservedTasks<'_>,
        range: Range<u64>,
        pipeline_observer: &mut dyn PipelineObserver,
        observer: &mut dyn LaunchObserver,
    ) -> (Stats, Option<Trapped>) {
        match work.single_lane {
            true => self.run_observed_lanes::<1>(work, range, pipeline_observer, observer),
            false => self.run_observed_lanes::<64>(work, range, pipeline_observer, observer),
        }
    }

    fn run_observed_lanes<const W: usize>(
        &self,
        work: &ObservedTasks<'_>,
        range: Range<u64>,
        pipeline_observer: &mut dyn PipelineObserver,
        observer: &mut dyn Observer<W>,
    ) -> (Stats, Option<Trapped>)
    where
        LaneKernel: Width<W>,
    {
        work.watch.begin_task(range.end - range.start);
        let mut stack =
            Stack::<W>::new(self.pipeline, work.bindings, Some(pipeline_observer), Some(observer))
                .watched(work.watch.clone());
        stack.launch_batches(work.record, work.order, range);
        (stack.stats, stack.trapped)
    }
}
