//! Threads that decode one input together.
//!
//! They are not threads of rayon's pool: a waiting thread of the pool starts another task, which
//! can wait for the same input (deadlock). All inputs that are being decoded share the helpers, one
//! fewer than the pool has threads. The number of threads does not change the result.

use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;

use crate::threads::thread_count;

/// The number of helper threads that are running.
static HELPERS: AtomicUsize = AtomicUsize::new(0);

/// A share of [`HELPERS`].
struct Reserved(usize);

impl Reserved {
    /// At most so many threads, fewer where others are busy.
    fn new(most: usize) -> Self {
        let all = if most == 0 { 0 } else { thread_count() - 1 };
        let mut count = 0;
        let reserve = |used: usize| {
            count = most.min(all.saturating_sub(used));
            Some(used + count)
        };
        let _ = HELPERS.fetch_update(Relaxed, Relaxed, reserve);
        Self(count)
    }
}

impl Drop for Reserved {
    fn drop(&mut self) {
        HELPERS.fetch_sub(self.0, Relaxed);
    }
}

/// Calls `work` on helpers, and `own` on this thread.
fn with_helpers<R>(helpers: &Reserved, work: &(dyn Fn() + Sync), own: impl FnOnce() -> R) -> R {
    thread::scope(|scope| {
        // If a thread cannot be started, the other threads do its work.
        let start = |_| thread::Builder::new().spawn_scoped(scope, work).ok();
        let started: Vec<_> = (0..helpers.0).map_while(start).collect();
        let result = own();
        for helper in started {
            helper.join().unwrap_or_else(|panic| resume_unwind(panic));
        }
        result
    })
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Fills a list in parts of so many elements; `fill` is given the index of the first one of each.
pub fn fill<T: Send>(list: &mut [T], part: usize, fill: &(dyn Fn(usize, &mut [T]) + Sync)) {
    let count = list.len().div_ceil(part);
    let parts = Mutex::new(list.chunks_mut(part).enumerate());
    let work = || {
        loop {
            let taken = lock(&parts).next();
            let Some((at, elements)) = taken else { return };
            fill(at * part, elements);
        }
    };
    with_helpers(&Reserved::new(count.saturating_sub(1)), &work, work);
}

/// Applies a function to the numbers below `count`, each of which takes a while. Returns the
/// results in the order of the numbers.
pub fn map<T: Send>(count: usize, make: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    fill(&mut results, 1, &|at, result| result[0] = Some(make(at)));
    results.into_iter().flatten().collect()
}

/// Items that are made, and not used yet.
struct Queue<T> {
    /// The next item to make.
    next: usize,
    /// The number of items that were used.
    used: usize,
    made: BTreeMap<usize, Result<T, Box<dyn Any + Send>>>,
}

/// Makes the items below `count` on all threads, and uses them on this one, in their order, as long
/// as `consume` returns true. Two for each thread are held at most; a single thread holds one.
pub fn in_order<T: Send>(
    count: usize,
    make: &(dyn Fn(usize) -> T + Sync),
    consume: &mut dyn FnMut(T) -> bool,
) {
    let helpers = Reserved::new(count.saturating_sub(1));
    if helpers.0 == 0 {
        (0..count).all(|at| consume(make(at)));
        return;
    }
    let ahead = 2 * (helpers.0 + 1);
    let queue = Mutex::new(Queue { next: 0, used: 0, made: BTreeMap::new() });
    let changed = Condvar::new();
    let make_one = |at: usize| {
        let item = catch_unwind(AssertUnwindSafe(|| make(at)));
        lock(&queue).made.insert(at, item);
        changed.notify_all();
    };
    let take = |queue: &mut Queue<T>| {
        let at = queue.next;
        (at < count.min(queue.used + ahead)).then(|| {
            queue.next += 1;
            at
        })
    };
    let wait = |held| drop(changed.wait(held).unwrap_or_else(PoisonError::into_inner));
    let work = || {
        loop {
            let mut held = lock(&queue);
            if held.next >= count {
                return;
            }
            match take(&mut held) {
                Some(at) => {
                    drop(held);
                    make_one(at);
                }
                None => wait(held),
            }
        }
    };
    let next_item = |at: usize| {
        loop {
            let mut held = lock(&queue);
            if let Some(item) = held.made.remove(&at) {
                held.used = at + 1;
                changed.notify_all();
                return item;
            }
            match take(&mut held) {
                Some(other) => {
                    drop(held);
                    make_one(other);
                }
                None => wait(held),
            }
        }
    };
    let own = || {
        let consumed = catch_unwind(AssertUnwindSafe(|| {
            (0..count).all(|at| match next_item(at) {
                Ok(item) => consume(item),
                Err(panic) => resume_unwind(panic),
            })
        }));
        // Helpers end where there is nothing left to make.
        lock(&queue).next = count;
        changed.notify_all();
        consumed.unwrap_or_else(|panic| resume_unwind(panic));
    };
    with_helpers(&helpers, &work, own);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_threads<R: Send>(count: usize, run: impl FnOnce() -> R + Send) -> R {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a pool");
        pool.install(run)
    }

    #[test]
    fn parts_are_filled_once_each() {
        for threads in [1, 2, 3] {
            let mut list = vec![0; 1000];
            on_threads(threads, || {
                fill(&mut list, 7, &|first, part| {
                    part.iter_mut().zip(first..).for_each(|(element, at)| *element += at);
                });
            });
            assert!(list.into_iter().eq(0..1000));
            assert_eq!(on_threads(threads, || map(5, &|at| at * at)), [0, 1, 4, 9, 16]);
        }
        fill(&mut [0; 0], 7, &|_, part| assert!(part.is_empty()));
    }

    #[test]
    fn items_are_used_in_order_until_one_is_refused() {
        for threads in [1, 2, 3] {
            let mut used = Vec::new();
            on_threads(threads, || {
                in_order(1000, &|at| at, &mut |at| {
                    used.push(at);
                    at < 700
                })
            });
            assert!(used.into_iter().eq(0..=700));
        }
        in_order(0, &|at| at, &mut |at: usize| panic!("item {at}"));
    }

    #[test]
    fn a_panic_reaches_the_caller() {
        let message = |run: &(dyn Fn() + Sync)| {
            let panic = catch_unwind(AssertUnwindSafe(|| on_threads(3, run))).expect_err("it panics");
            panic.downcast_ref::<String>().cloned()
        };
        let wrong = Some("number 50".to_owned());
        let make = |at: usize| assert!(at != 50, "number {at}");
        assert_eq!(message(&|| drop(map(100, &make))), wrong);
        assert_eq!(message(&|| in_order(100, &make, &mut |()| true)), wrong);
        let consume = |at: usize| {
            make(at);
            true
        };
        assert_eq!(message(&|| in_order(100, &|at| at, &mut { consume })), wrong);
    }
}
