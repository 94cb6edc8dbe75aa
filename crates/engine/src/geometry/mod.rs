//! Primitives and their intersection with a ray, one file for each primitive.
//!
//! Every `intersect` takes an [`ObjectRay`] and the primitive's `f32` data and answers *exactly*
//! for those inputs: whether the ray meets it, on which surface, and within the interval or not; t
//! and the attributes are the correctly rounded values of the real numbers. An f64 attempt with a
//! proven error bound decides nearly always; exact arithmetic decides the rest. [`Precision`]
//! trades that away. A t beyond the range of `f32` is no hit, as no shader could read it.
//!
//! Before that, [`block`] culls primitives that a ray certainly misses, four at a time, or tests
//! four at once in f64 ([`Intersection4`]).
//!
//! The interval of a ray is the caller's t_min and t_max. A traversal that has found a hit compares
//! the *rounded* t of later ones itself: shrinking `t_max` to a rounded t would make ties depend on
//! the order.

// `!(x > error)` is not `x <= error`: a NaN must count as undecided.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod aabb;
mod approach_terms;
pub mod block;
mod bounded_ray;
mod bounds;
mod closest_approach;
mod double_ray;
mod entry_normal;
mod intersection4;
pub mod linear_swept_sphere;
pub mod normal;
mod object_ray;
pub mod ray;
pub mod sphere;
pub mod triangle;
mod verdict;

pub use bounds::Bounds;
pub use double_ray::DoubleRay;
pub use intersection4::Intersection4;
pub use normal::SurfaceNormal;
pub use object_ray::{
    APPROXIMATE_ERROR, APPROXIMATE_UNDERFLOW, ApproximateRay, ObjectRay, Transform, world_to_object,
};
pub use ray::{Intersection, Ray, Surface};
pub use verdict::Verdict;

/// How intersections are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Plain f32 formulas, rearranged against cancellation, as a careful GPU kernel has them.
    Float,
    /// Plain f64 formulas, rearranged against cancellation.
    Double,
    /// Decisions exact, values correctly rounded.
    #[default]
    Exact,
}

impl Precision {
    /// All precisions, from the lowest.
    pub const ALL: [Self; 3] = [Self::Float, Self::Double, Self::Exact];

    /// Its name in scene files and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Float => "float",
            Self::Double => "double",
            Self::Exact => "exact",
        }
    }
}
