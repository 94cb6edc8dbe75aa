//! Memory that is about to be read.

use prefetch_index::prefetch_index;

/// What a line of the processor's caches holds, in bytes.
const LINE: usize = 64;

/// Has the processor begin to bring what will be read soon into its caches, a line each; it does not wait for
/// that. Changes nothing but time.
#[inline(always)]
pub fn fetch<T>(numbers: &[T]) {
    for at in (0..numbers.len()).step_by((LINE / size_of::<T>()).max(1)) {
        prefetch_index(numbers, at);
    }
}
