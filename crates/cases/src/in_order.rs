//! Pieces of work on several threads, whose results are taken in order.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use anyhit_base::error::Result;

/// The number of threads for so many jobs: 0 stands for one per processor.
pub fn job_count(jobs: usize) -> usize {
    match jobs {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        jobs => jobs,
    }
}

/// Does `count` pieces of work on `jobs` threads, 0 for one a processor, and takes each result as
/// soon as all before it are taken: no result and no order depends on the number of threads. No
/// piece begins once `stop` holds.
///
/// # Errors
/// The first that `take` returns, after which nothing is taken any more.
pub fn in_order<T: Send>(
    count: usize,
    jobs: usize,
    stop: &AtomicBool,
    work: &(dyn Fn(usize) -> T + Sync),
    take: &mut dyn FnMut(T) -> Result<()>,
) -> Result<()> {
    let jobs = job_count(jobs);
    if jobs == 1 || count <= 1 {
        for at in 0..count {
            take(work(at))?;
            if stop.load(Ordering::Relaxed) {
                break;
            }
        }
        return Ok(());
    }
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs.min(count) {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    if at >= count || stop.load(Ordering::Relaxed) {
                        break;
                    }
                    // The receiver is gone once a result was not taken.
                    if sender.send((at, work(at))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut waiting: Vec<Option<T>> = (0..count).map(|_| None).collect();
        let mut taken = 0;
        for (at, done) in receiver {
            waiting[at] = Some(done);
            while let Some(done) = waiting.get_mut(taken).and_then(Option::take) {
                taken += 1;
                if let Err(error) = take(done) {
                    stop.store(true, Ordering::Relaxed);
                    return Err(error);
                }
            }
        }
        Ok(())
    })
}
