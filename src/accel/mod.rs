//! Acceleration structures and the resumable traversal.

pub mod blas;
pub mod cursor;
pub mod geometry_data;
pub mod tlas;

pub use blas::{Blas, Geometry, GeometryFlags};
pub use cursor::{Candidate, Committed, Cursor, HitKind, RayFlags, TraceRay};
pub use geometry_data::{EndCaps, GeometryData, Indexing};
pub use tlas::{Instance, InstanceFlags, Tlas};
