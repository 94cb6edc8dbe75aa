//! Launches under observers.

use std::ops::Range;
use std::sync::Arc;

use crate::machine::{Bindings, LaunchObserver, Observer, TaskWatch, Watchdog};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::launch::{Launch, MAX_SINGLE_THREADED, task_size};
use crate::pipeline::observer::PipelineObserver;
use crate::pipeline::order::InvocationOrder;
use crate::pipeline::run_options::RunOptions;
use crate::pipeline::sbt::SbtRecord;
use crate::pipeline::stack::{Stack, bindings};
use crate::pipeline::stats::Stats;
use crate::pipeline::tasks::{TaskQueue, TaskResults};
use crate::pipeline::trapped::{Trapped, spent_together, timed_out};
use anyhit_base::error::Result;
use anyhit_base::threads::{has_threads, thread_count};

/// Runs the invocations of a task under a pipeline observer and an observer of operations.
pub type ObservedTask<'a> = dyn FnMut(&mut dyn PipelineObserver, &mut dyn LaunchObserver) + 'a;

/// A launch that is observed, in tasks.
struct ObservedLaunch<'a> {
    record: &'a SbtRecord,
    bindings: Vec<Bindings>,
    order: InvocationOrder,
    /// The number of invocations, and that of each task.
    count: u64,
    task_size: u64,
    watchdog: Arc<Watchdog>,
    /// Whether each invocation runs by itself.
    single_lane: bool,
}

impl ObservedLaunch<'_> {
    fn tasks(&self) -> u64 {
        self.count.div_ceil(self.task_size)
    }

    /// The positions of a task in launch order.
    fn range(&self, task: u64) -> Range<u64> {
        task * self.task_size..self.count.min((task + 1) * self.task_size)
    }

    /// The launch index of the last invocation of a task.
    fn last(&self, task: u64) -> [u32; 3] {
        self.order.launch_id(self.range(task).end - 1)
    }
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
        let Some(work) = self.observed(size)? else { return self.run(size, RunOptions::default()) };
        let (dog, watch) = (&work.watchdog, work.watchdog.watch());
        let mut stats = Stats::default();
        for task in 0..work.tasks() {
            let range = work.range(task);
            let (task_stats, trapped) =
                self.run_observed_task(&work, &watch, range, pipeline_observer, observer);
            if let Some(trapped) = trapped {
                return Err(trapped.error);
            }
            if dog.end_task(task, watch.spent()).is_some() {
                return Err(spent_together(None, work.last(task), dog).error);
            }
            if let Some(code) = watch.timed_out() {
                return Err(timed_out(work.last(task), code, dog).error);
            }
            stats = stats.plus(&task_stats);
        }
        Ok(stats)
    }

    /// Runs the ray generation shader over a grid as [`Launch::run_observed`] does, on all threads
    /// where [`Launch::run`] uses them. The function is called for each task with its positions in
    /// launch order, and runs it under observers of its own, or leaves it out. Tasks are ascending
    /// on each thread; those behind a trap may be left out.
    ///
    /// # Errors
    /// As [`Launch::run`].
    pub fn run_observed_on_threads(
        &self,
        size: [u32; 3],
        observe: &(dyn Fn(Range<u64>, &mut ObservedTask<'_>) + Sync),
    ) -> Result<Stats> {
        let Some(work) = self.observed(size)? else { return self.run(size, RunOptions::default()) };
        let (dog, tasks) = (&work.watchdog, TaskQueue::new(work.tasks()));
        let stop = |trapped: Trapped| {
            let number = work.order.linear_index(trapped.launch_id);
            tasks.record_trap(number);
            if trapped.code.is_limit() {
                dog.stop_at(number);
            }
            TaskResults { stats: Stats::default(), trapped: Some((number, trapped)) }
        };
        let worker = || {
            let watch = dog.watch();
            let mut results = TaskResults::default();
            for (task, range) in tasks.iter().map(|task| (task, work.range(task))) {
                if tasks.is_after_trap(range.start) || dog.is_beyond(range.start) {
                    continue;
                }
                let mut ran = None;
                observe(range.clone(), &mut |pipeline_observer, observer| {
                    let range = range.clone();
                    ran = Some(self.run_observed_task(&work, &watch, range, pipeline_observer, observer));
                });
                let (stats, trapped) = ran.unwrap_or_default();
                results = results.merge(TaskResults { stats, trapped: None });
                let late = watch.timed_out().filter(|_| trapped.is_none());
                let late = late.map(|code| timed_out(work.last(task), code, dog));
                results = trapped.into_iter().chain(late).map(&stop).fold(results, TaskResults::merge);
                // All tasks before have ended.
                if let Some(over) = dog.end_task(task, watch.spent()) {
                    results = results.merge(stop(spent_together(None, work.last(over), dog)));
                }
            }
            results
        };
        let threads = RunOptions::default().most_threads(!self.may_use_threads(size, work.count));
        tasks.run(threads, &worker).map_err(|trapped| trapped.error)
    }

    /// Returns whether [`Launch::run_observed_on_threads`] uses several threads. No invocation then
    /// accesses memory that another one writes, except by atomic instructions.
    pub fn is_observed_on_threads(&self, size: [u32; 3]) -> bool {
        let Ok(Some(work)) = self.observed(size) else { return false };
        work.tasks() > 1 && has_threads() && thread_count() > 1 && self.may_use_threads(size, work.count)
    }

    /// Returns whether several threads may run a launch of so many invocations.
    fn may_use_threads(&self, size: [u32; 3], count: u64) -> bool {
        count > MAX_SINGLE_THREADED
            && !self.pipeline.order_dependent()
            && self.pipeline.shared_memory(size, self.resources).is_none()
    }

    /// A launch as it is observed; `None` where its subgroups are too large.
    fn observed(&self, size: [u32; 3]) -> Result<Option<ObservedLaunch<'_>>> {
        let (record, count) = (self.ray_generation()?, self.invocation_count(size)?);
        let subgroups = self.pipeline.whole_subgroups();
        if subgroups.is_some_and(|size| size > 64) {
            return Ok(None);
        }
        Ok(Some(ObservedLaunch {
            record,
            bindings: bindings(self.pipeline, self.resources),
            order: InvocationOrder::by_index(size),
            count,
            task_size: task_size(count),
            watchdog: self.watchdog(count),
            single_lane: self.pipeline.order_dependent() && subgroups.is_none(),
        }))
    }

    /// Runs the invocations at a range of positions under observers.
    fn run_observed_task(
        &self,
        work: &ObservedLaunch<'_>,
        watch: &Arc<TaskWatch>,
        range: Range<u64>,
        pipeline_observer: &mut dyn PipelineObserver,
        observer: &mut dyn LaunchObserver,
    ) -> (Stats, Option<Trapped>) {
        match work.single_lane {
            true => self.run_observed_lanes::<1>(work, watch, range, pipeline_observer, observer),
            false => self.run_observed_lanes::<64>(work, watch, range, pipeline_observer, observer),
        }
    }

    fn run_observed_lanes<const W: usize>(
        &self,
        work: &ObservedLaunch<'_>,
        watch: &Arc<TaskWatch>,
        range: Range<u64>,
        pipeline_observer: &mut dyn PipelineObserver,
        observer: &mut dyn Observer<W>,
    ) -> (Stats, Option<Trapped>)
    where
        LaneKernel: Width<W>,
    {
        watch.begin_task(range.end - range.start);
        let mut stack =
            Stack::<W>::new(self.pipeline, &work.bindings, Some(pipeline_observer), Some(observer))
                .watched(watch.clone());
        stack.launch_batches(work.record, &work.order, range);
        (stack.stats, stack.trapped)
    }
}
