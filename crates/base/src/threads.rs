//! Independent work on the threads of rayon's pool. A forked child runs it on the calling thread,
//! and the thread that waits for it asks its [`Interrupt`] meanwhile.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

use rayon::prelude::*;

use crate::interrupt::{ASK_INTERVAL, Interrupt};

/// The process in which threads of the pool were first used here.
static POOL_OWNER: PoolOwner = PoolOwner(OnceLock::new());

/// The process whose pool has threads. A forked child inherits the pool without its threads:
/// waiting for them there never returns.
struct PoolOwner(OnceLock<u32>);

impl PoolOwner {
    /// Returns true if the pool has its threads in the process with this number. The first call
    /// makes its process the owner.
    fn is(&self, process: u32) -> bool {
        *self.0.get_or_init(|| process) == process
    }
}

/// Returns whether the pool has threads: false in a child that was forked after they were used.
/// Everything then runs on the calling thread, with the same results.
pub fn has_threads() -> bool {
    POOL_OWNER.is(std::process::id())
}

/// Returns the number of threads of the current pool, which this starts.
pub fn thread_count() -> usize {
    // Makes this process the owner, because the next line starts the threads.
    has_threads();
    rayon::current_num_threads()
}

/// Applies a function to the numbers below `count` on all threads. Returns the results in the order
/// of the numbers.
///
/// The function is called through a pointer, and what it returns is not passed through rayon, which
/// would be instantiated for each type of either.
pub fn map_on_threads<T: Send>(count: usize, function: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let results: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    call_on_threads(count, &|at| {
        let result = function(at);
        *results[at].lock().expect("bug in anyhit: a thread panicked while it wrote a result") = Some(result);
    });
    let result = |one: Mutex<Option<T>>| one.into_inner().ok().flatten();
    results.into_iter().map(|one| result(one).expect("bug in anyhit: a number has no result")).collect()
}

/// Calls a function with each number below `count`, on all threads.
fn call_on_threads(count: usize, function: &(dyn Fn(usize) + Sync)) {
    if !has_threads() {
        return (0..count).for_each(function);
    }
    let numbers = || (0..count).into_par_iter().with_max_len(1);
    match Interrupt::current() {
        None => numbers().for_each(function),
        // A thread of the pool must not wait for others by other means than the pool's.
        Some(interrupt) if rayon::current_thread_index().is_some() => {
            numbers().for_each(|at| interrupt.scope(|| function(at)));
        }
        Some(interrupt) => call_and_ask(count, function, &interrupt),
    }
}

/// Calls a function with each number below `count` on threads of the pool, while this thread asks
/// the interrupt.
fn call_and_ask(count: usize, function: &(dyn Fn(usize) + Sync), interrupt: &Interrupt) {
    let next = AtomicUsize::new(0);
    let workers = rayon::current_num_threads().min(count);
    let running = Running { count: Mutex::new(workers), changed: Condvar::new() };
    let work = || {
        let _ended = Ended(&running);
        interrupt.scope(|| {
            let numbers = std::iter::from_fn(|| Some(next.fetch_add(1, Relaxed)));
            numbers.take_while(|at| *at < count).for_each(function);
        });
    };
    rayon::in_place_scope(|scope| {
        (0..workers).for_each(|_| scope.spawn(|_| work()));
        while running.wait() {
            interrupt.is_raised();
        }
    });
}

/// The workers of one call that have not ended.
struct Running {
    count: Mutex<usize>,
    changed: Condvar,
}

impl Running {
    fn lock(&self) -> MutexGuard<'_, usize> {
        self.count.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until all have ended, or for a while. Returns whether some run.
    fn wait(&self) -> bool {
        let waited = self.changed.wait_timeout_while(self.lock(), ASK_INTERVAL, |count| *count > 0);
        *waited.unwrap_or_else(PoisonError::into_inner).0 > 0
    }
}

/// Ends one worker where it is dropped, also by a panic.
struct Ended<'a>(&'a Running);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        *self.0.lock() -= 1;
        self.0.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_numbers() {
        let squares = || map_on_threads(5, |at| at * at);
        assert_eq!(squares(), [0, 1, 4, 9, 16]);
        assert!(map_on_threads(0, |at| at).is_empty());
        let interrupt = Interrupt::new(|| false);
        assert_eq!(interrupt.scope(squares), [0, 1, 4, 9, 16]);
        assert!(interrupt.scope(|| map_on_threads(0, |at| at)).is_empty());
        // Within a thread of the pool.
        let nested = || map_on_threads(3, |one| map_on_threads(2, |other| 10 * one + other));
        assert_eq!(interrupt.scope(nested), [[0, 1], [10, 11], [20, 21]]);
    }

    /// A child has another number than its parent (POSIX, `fork`).
    #[test]
    fn a_forked_child_has_no_threads() {
        let owner = PoolOwner(OnceLock::new());
        let (parent, child) = (100, 101);
        assert_eq!([parent, child, parent].map(|process| owner.is(process)), [true, false, true]);
    }

    #[test]
    fn a_panic_reaches_the_caller() {
        let run = || map_on_threads(3, |at| assert!(at < 2, "number {at}"));
        let interrupt = Interrupt::new(|| false);
        for payload in [std::panic::catch_unwind(run), std::panic::catch_unwind(|| interrupt.scope(run))] {
            let payload = payload.expect_err("the last one panics");
            assert_eq!(payload.downcast_ref::<String>().map(String::as_str), Some("number 2"));
        }
    }

    #[test]
    fn the_thread_that_waits_asks_and_all_workers_see_it() {
        let asking = std::thread::current().id();
        let interrupt = Interrupt::new(move || std::thread::current().id() == asking);
        let ended = interrupt.scope(|| {
            map_on_threads(4, |_| {
                let interrupt = Interrupt::current().expect("that of the caller");
                // Only the waiting thread can raise it.
                while !interrupt.is_raised() {
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
            })
            .len()
        });
        assert_eq!(ended, 4);
    }
}
