//! Independent work on all threads.

use std::sync::{Mutex, OnceLock};

use rayon::prelude::*;

/// The process in which threads of the pool were first used here.
static POOL_OWNER: PoolOwner = PoolOwner(OnceLock::new());

/// A process whose pool of threads runs. A forked child inherits the pool without its threads:
/// whoever waits for them there waits for ever.
struct PoolOwner(OnceLock<u32>);

impl PoolOwner {
    /// Returns whether the pool has its threads in the process with this number; the first process
    /// that asks starts them.
    fn is(&self, process: u32) -> bool {
        *self.0.get_or_init(|| process) == process
    }
}

/// Returns whether the pool has threads: false in a child that was forked after they were used.
/// Everything then runs on the calling thread, with the same results.
pub(super) fn has_threads() -> bool {
    POOL_OWNER.is(std::process::id())
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
    match has_threads() {
        true => (0..count).into_par_iter().for_each(function),
        false => (0..count).for_each(function),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_numbers() {
        assert_eq!(map_on_threads(5, |at| at * at), [0, 1, 4, 9, 16]);
        assert!(map_on_threads(0, |at| at).is_empty());
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
        let payload = std::panic::catch_unwind(run).expect_err("the last one panics");
        assert_eq!(payload.downcast_ref::<String>().map(String::as_str), Some("number 2"));
    }
}
