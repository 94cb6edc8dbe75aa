//! The threads that build one tree.

use std::panic::resume_unwind;
use std::thread;

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use anyhit_base::threads::thread_count;

/// A tree over more boxes than this is built by several threads, and so are subtrees.
pub(super) const PARALLEL_BUILD_MIN: usize = 16_384;

/// The number of items of a list that a thread takes at once.
pub(super) const CHUNK: usize = 8_192;

/// Which threads build a tree. What is built does not depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BuildThreads {
    /// The one that needs the tree.
    One,
    /// Those of the pool that this one belongs to, in which nothing else runs.
    Pool,
}

impl BuildThreads {
    /// Builds something over so many primitives: many by as many threads as rayon's current pool
    /// has. Few start no thread, nor that pool.
    pub(super) fn build<R: Send>(primitives: usize, build: impl FnOnce(Self) -> R + Send) -> R {
        if primitives <= PARALLEL_BUILD_MIN {
            return build(Self::One);
        }
        match thread_count() {
            1 => build(Self::One),
            count => Self::build_in_pool(count, build),
        }
    }

    /// Builds something by so many threads.
    ///
    /// They make a pool of their own: a thread of the common pool that waits here would steal other
    /// work, which may wait for this very tree. For the same reason this thread does not wait by
    /// rayon's means.
    pub(super) fn build_in_pool<R: Send>(count: usize, build: impl FnOnce(Self) -> R + Send) -> R {
        let Ok(pool) = ThreadPoolBuilder::new().num_threads(count).build() else {
            return build(Self::One);
        };
        let run = || pool.install(|| build(Self::Pool));
        thread::scope(|scope| scope.spawn(run).join()).unwrap_or_else(|panic| resume_unwind(panic))
    }

    /// Appends what `make` makes of each index below `count`.
    #[inline(always)]
    pub(super) fn extend<T: Send>(
        self,
        list: &mut Vec<T>,
        count: usize,
        make: impl Fn(usize) -> T + Sync + Send,
    ) {
        match self {
            Self::One => list.extend((0..count).map(make)),
            Self::Pool => extend_in_pool(list, count, &make),
        }
    }

    /// Drops something large while it makes something else.
    pub(super) fn drop_while<R: Send>(self, old: impl Send, make: impl FnOnce() -> R + Send) -> R {
        match self {
            Self::One => {
                drop(old);
                make()
            }
            Self::Pool => rayon::join(make, || drop(old)).0,
        }
    }

    /// A list of what `make` makes of each index.
    #[inline(always)]
    pub(super) fn collect<T: Send>(self, count: usize, make: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        let mut list = Vec::with_capacity(count);
        self.extend(&mut list, count, make);
        list
    }

    /// What `make` makes of each item, which takes it a while.
    pub(super) fn map<T: Send, R: Send>(self, items: Vec<T>, make: impl Fn(T) -> R + Sync + Send) -> Vec<R> {
        match self {
            Self::One => items.into_iter().map(make).collect(),
            Self::Pool => {
                let mut made: Vec<Option<R>> = Vec::new();
                made.resize_with(items.len(), || None);
                let make = &make;
                let jobs = items.into_iter().zip(&mut made);
                run_all(jobs.map(|(item, to)| Box::new(|| *to = Some(make(item))) as Job<'_>).collect());
                made.into_iter().flatten().collect()
            }
        }
    }
}

/// Appends what `make` makes of each index, by all threads of the pool. It is called through a
/// pointer: rayon would be instantiated for each of them, not only for each type.
fn extend_in_pool<T: Send>(list: &mut Vec<T>, count: usize, make: &(dyn Fn(usize) -> T + Sync)) {
    list.par_extend((0..count).into_par_iter().map(make));
}

/// Something that a thread of the pool does.
type Job<'a> = Box<dyn FnOnce() + Send + 'a>;

/// Does all of it. Jobs are called through pointers: rayon would be instantiated for each kind.
fn run_all(jobs: Vec<Job<'_>>) {
    jobs.into_par_iter().for_each(|job| job());
}
