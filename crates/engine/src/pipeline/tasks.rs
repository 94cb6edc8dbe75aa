//! The task queue of a launch, from which each worker thread takes the next task.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::pipeline::stats::Stats;
use crate::pipeline::trapped::Trapped;
use anyhit_base::threads::{has_threads, map_on_threads, thread_count};

/// A queue of numbered tasks. Each idle thread takes the next one, so that threads end at about the
/// same time even if the tasks take very different times. (rayon's ranges, halved in advance, are
/// split again only when a thread steals.)
#[derive(Debug)]
pub(super) struct TaskQueue {
    count: u64,
    next: AtomicU64,
    /// The lowest number of an invocation that is known to have trapped.
    lowest_trap: AtomicU64,
}

/// The results of several tasks.
#[derive(Default)]
pub(super) struct TaskResults {
    /// The sums of the tasks' counts.
    pub stats: Stats,
    /// The trap with the lowest number, which is the one to report, with that number.
    pub trapped: Option<(u64, Trapped)>,
}

impl TaskResults {
    /// Adds the results of other tasks.
    pub(super) fn merge(self, other: Self) -> Self {
        let trapped = self.trapped.into_iter().chain(other.trapped).min_by_key(|(number, _)| *number);
        Self { stats: self.stats.plus(&other.stats), trapped }
    }
}

impl TaskQueue {
    /// A queue of `count` tasks, none of them begun.
    pub(super) fn new(count: u64) -> Self {
        Self { count, next: AtomicU64::new(0), lowest_trap: AtomicU64::new(u64::MAX) }
    }

    /// Takes tasks from the queue, in ascending order. Several iterators share the queue.
    pub(super) fn iter(&self) -> impl Iterator<Item = u64> {
        std::iter::from_fn(|| {
            let next = self.next.fetch_add(1, Relaxed);
            (next < self.count).then_some(next)
        })
    }

    /// Whether an invocation of a lower number has trapped: this number then no longer affects the
    /// result.
    pub(super) fn is_after_trap(&self, number: u64) -> bool {
        self.lowest_trap.load(Relaxed) < number
    }

    /// Records that the invocation of this number has trapped.
    pub(super) fn record_trap(&self, number: u64) {
        self.lowest_trap.fetch_min(number, Relaxed);
    }

    /// Runs the worker on this thread only, or on at most so many threads of the pool. Returns the
    /// summed counts, or the trap with the lowest number.
    ///
    /// The worker is called through a pointer: rayon would be instantiated for each type of worker.
    pub(super) fn run(
        &self,
        threads: usize,
        worker: &(dyn Fn() -> TaskResults + Sync),
    ) -> Result<Stats, Box<Trapped>> {
        // A single task runs here: starting threads would take longer.
        let results = match threads <= 1 || self.count <= 1 || !has_threads() {
            true => worker(),
            false => {
                self.on_threads(threads, worker).into_iter().fold(TaskResults::default(), TaskResults::merge)
            }
        };
        match results.trapped {
            Some((_, trapped)) => Err(Box::new(trapped)),
            None => Ok(results.stats),
        }
    }

    /// Runs the worker on at most so many threads of the pool, at most one for each task, and
    /// returns their results. Each works until [`TaskQueue::iter`] is empty.
    fn on_threads(&self, most: usize, worker: &(dyn Fn() -> TaskResults + Sync)) -> Vec<TaskResults> {
        let threads = (thread_count().min(most) as u64).min(self.count) as usize;
        map_on_threads(threads, |_| worker())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::machine::ShaderIndex;
    use crate::machine::TrapCode;
    use anyhit_base::error::{Error, ErrorKind};

    #[test]
    fn the_trap_with_the_lowest_number_is_reported() {
        let trapped = |task: u64| Trapped {
            launch_id: [task as u32, 0, 0],
            code: TrapCode::Unreachable,
            fault_value: 0,
            shader: ShaderIndex(0),
            offset: 0,
            error: Error::new(ErrorKind::Trap, "a trap"),
        };
        for (threads, most) in [(1, 1), (1, usize::MAX), (3, usize::MAX), (3, 2)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let tasks = TaskQueue::new(100);
            let done = |task| TaskResults { trapped: Some((task, trapped(task))), ..TaskResults::default() };
            let worker = || {
                // In descending order, as threads may end in any order.
                let own: Vec<u64> = tasks.iter().filter(|task| task % 7 == 6).collect();
                own.into_iter().rev().map(done).fold(TaskResults::default(), TaskResults::merge)
            };
            let trapped = pool.install(|| tasks.run(most, &worker)).expect_err("every seventh task traps");
            assert_eq!(trapped.launch_id, [6, 0, 0]);
        }
    }

    #[test]
    fn every_task_is_done_once_and_each_worker_goes_up() {
        for (pool, threads, count) in [(1, 1, 5), (3, 3, 1000), (4, 4, 2), (2, 2, 0), (4, 2, 1000)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(pool).build().unwrap();
            let tasks = TaskQueue::new(count);
            let done = Mutex::new(Vec::new());
            let worker = || {
                let own: Vec<u64> = tasks.iter().collect();
                done.lock().unwrap().push(own);
                TaskResults::default()
            };
            let workers = pool.install(|| tasks.on_threads(threads, &worker)).len();
            let done = done.into_inner().unwrap();
            assert!(workers <= threads && workers == done.len(), "{done:?}");
            assert!(done.iter().all(|own| own.is_sorted()), "{done:?}");
            let mut all = done.concat();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count));
        }
    }
}
