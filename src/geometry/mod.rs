//! Primitives and their intersection with a ray, one file a primitive.

pub mod ray;

pub use ray::{Intersection, Ray, Surface};
