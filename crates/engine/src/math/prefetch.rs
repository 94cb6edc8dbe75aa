//! Prefetching: loads memory into the L1 cache before it is read.

use bytemuck::NoUninit;
use prefetch_index::prefetch_index;

/// The size of a cache line in bytes.
const CACHE_LINE: usize = 64;

/// A piece of memory whose size divides those of what is prefetched and of a cache line.
type Piece = [u8; 16];

/// Prefetches each cache line of an element of a slice into L1. It does not wait for the loads, and
/// affects only time. An index out of range does nothing useful and no harm, so that nothing is
/// compared.
#[inline(always)]
pub fn prefetch<T: NoUninit>(elements: &[T], index: usize) {
    let pieces: &[Piece] = bytemuck::cast_slice(elements);
    let each = size_of::<T>() / size_of::<Piece>();
    for at in (0..each).step_by(CACHE_LINE / size_of::<Piece>()) {
        prefetch_index(pieces, index.wrapping_mul(each).wrapping_add(at));
    }
}
