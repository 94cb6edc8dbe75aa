//! The queue of a launch's tasks, from which each thread takes the next.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use rayon::prelude::*;

use crate::pipeline::launch::Stats;
use crate::pipeline::trapped::Trapped;

/// Numbers of tasks, of which each free thread takes the next: threads end together, however
/// different the tasks are. (Ranges that are halved in advance are only split again when a thread
/// steals.)
#[derive(Debug)]
pub(super) struct Tasks {
    count: u64,
    next: AtomicU64,
    /// The lowest number that is known to have trapped.
    trapped_at: AtomicU64,
}

/// The results of several tasks.
#[derive(Default)]
pub(super) struct Done {
    /// The sums of their counts.
    pub stats: Stats,
    /// The trap with the lowest number, which is the one to report, with that number.
    pub trapped: Option<(u64, Trapped)>,
}

impl Done {
    /// Adds the results of other tasks.
    pub fn and(self, other: Self) -> Self {
        let trapped = self.trapped.into_iter().chain(other.trapped).min_by_key(|(number, _)| *number);
        Self { stats: self.stats.plus(&other.stats), trapped }
    }
}

impl Tasks {
    /// A queue of `count` tasks, none of them begun.
    pub fn new(count: u64) -> Self {
        Self { count, next: AtomicU64::new(0), trapped_at: AtomicU64::new(u64::MAX) }
    }

    /// Takes tasks from the queue, in ascending order; several such iterators share the queue.
    pub fn iter(&self) -> impl Iterator<Item = u64> {
        std::iter::from_fn(|| {
            let next = self.next.fetch_add(1, Relaxed);
            (next < self.count).then_some(next)
        })
    }

    /// Whether an invocation of a lower number has trapped: this number then no longer affects the
    /// result.
    pub fn is_beyond_trap(&self, number: u64) -> bool {
        self.trapped_at.load(Relaxed) < number
    }

    /// Records that the invocation of this number has trapped.
    pub fn trap_at(&self, number: u64) {
        self.trapped_at.fetch_min(number, Relaxed);
    }

    /// Runs the worker on this thread alone, or on those of the pool; returns the sums, or the trap
    /// with the lowest number.
    ///
    /// The worker is called through a pointer: rayon would be compiled anew for each type of it.
    pub fn run(&self, alone: bool, worker: &(dyn Fn() -> Done + Sync)) -> Result<Stats, Box<Trapped>> {
        // One task needs no threads: starting them would take longer.
        let done = match alone || self.count <= 1 {
            true => worker(),
            false => self.on_threads(worker).into_iter().fold(Done::default(), Done::and),
        };
        match done.trapped {
            Some((_, trapped)) => Err(Box::new(trapped)),
            None => Ok(done.stats),
        }
    }

    /// Runs the worker on threads of the pool, at most one for each task, and returns their
    /// results. Each works until [`Tasks::iter`] is empty.
    fn on_threads(&self, worker: &(dyn Fn() -> Done + Sync)) -> Vec<Done> {
        let threads = (rayon::current_num_threads() as u64).min(self.count) as usize;
        (0..threads).into_par_iter().with_max_len(1).map(|_| worker()).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::error::{Error, ErrorKind};
    use crate::machine::TrapCode;
    use crate::pipeline::Shader;

    #[test]
    fn the_trap_with_the_lowest_number_is_told() {
        let trapped = |task: u64| Trapped {
            launch_id: [task as u32, 0, 0],
            code: TrapCode::Unreachable,
            fault_value: 0,
            shader: Shader(0),
            offset: 0,
            error: Error::new(ErrorKind::Trap, "a trap"),
        };
        for (threads, alone) in [(1, true), (1, false), (3, false)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let tasks = Tasks::new(100);
            let done = |task| Done { trapped: Some((task, trapped(task))), ..Done::default() };
            let worker = || {
                // From the highest on, as threads may end in any order.
                let own: Vec<u64> = tasks.iter().filter(|task| task % 7 == 6).collect();
                own.into_iter().rev().map(done).fold(Done::default(), Done::and)
            };
            let told = pool.install(|| tasks.run(alone, &worker)).expect_err("every seventh task traps");
            assert_eq!(told.launch_id, [6, 0, 0]);
        }
    }

    #[test]
    fn every_task_is_done_once_and_each_worker_goes_up() {
        for (threads, count) in [(1, 5), (3, 1000), (4, 2), (2, 0)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let tasks = Tasks::new(count);
            let done = Mutex::new(Vec::new());
            let worker = || {
                let own: Vec<u64> = tasks.iter().collect();
                done.lock().unwrap().push(own);
                Done::default()
            };
            let workers = pool.install(|| tasks.on_threads(&worker)).len();
            let done = done.into_inner().unwrap();
            assert!(workers <= threads && workers == done.len(), "{done:?}");
            assert!(done.iter().all(|own| own.is_sorted()), "{done:?}");
            let mut all = done.concat();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count));
        }
    }
}
