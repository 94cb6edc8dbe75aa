//! Prefetching: loads memory into the L1 cache before it is read.

use prefetch_index::prefetch_index;

/// The size of a cache line in bytes.
const CACHE_LINE: usize = 64;

/// Prefetches each cache line of a slice into L1. It does not wait for the loads, and affects only
/// time.
#[inline(always)]
pub fn prefetch<T>(numbers: &[T]) {
    for at in (0..numbers.len()).step_by((CACHE_LINE / size_of::<T>()).max(1)) {
        prefetch_index(numbers, at);
    }
}
