//! What is checked while shaders run: a file for each kind of operation, or for each matter that
//! several kinds have.

mod atomic;
pub(super) mod barrier;
pub(super) mod begin;
pub(super) mod births;
pub(super) mod bounds;
pub(super) mod call;
pub(super) mod contents;
pub(super) mod cooperative;
mod fast_math;
pub(super) mod hit_object;
pub(super) mod image;
pub(super) mod image_format;
pub(super) mod kernel;
pub(super) mod lanes;
pub(super) mod memory;
pub(super) mod query;
pub(super) mod query_ray;
pub(super) mod ray;
mod reported;
pub(super) mod shared;
pub(super) mod stale;
pub(super) mod stop;
pub(super) mod subgroup;
mod subnormal;
pub(super) mod uniformity;
