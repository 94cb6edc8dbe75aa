//! Acceleration structures and the resumable traversal.
//!
//! A [`Blas`] holds geometries of one kind, a [`Tlas`] places BLASes as instances, and a [`Cursor`]
//! traverses them with one ray, stopping wherever a shader has to decide; a [`Packet`] traverses
//! them with coherent rays. Wide BVHs (`wide_bvh`, built by `binned_sah`) are built when the first
//! rays arrive; for a few rays that are explained, only the parts that they enter. They affect only
//! time: a cursor reports what a linear scan would (`cursor` states the order, `trav_ray` proves
//! that no hit is lost).

mod bin_split;
mod binned_sah;
pub mod blas;
pub mod build_input;
mod build_record;
mod build_threads;
mod built_blas;
mod chunked_partition;
pub mod cursor;
pub mod drawn_hits;
mod element_format;
pub mod flags;
pub mod geometry;
pub mod geometry_data;
pub mod hit;
mod hit_queue;
pub mod instance;
mod instance_ray;
pub mod look_ahead;
pub mod micromap;
pub mod motion;
mod motion_bounds;
mod node;
pub mod observer;
mod opaque_traversal;
pub mod packet;
mod prim_ref;
pub mod primitive;
mod primitive_numbers;
pub mod record_index;
pub mod rules;
mod strided;
pub mod surface_normal;
pub mod tlas;
pub mod trace_ray;
mod transform;
mod trav_ray;
mod traversal;
mod traversal_stack;
mod unit_cube;
mod validate;
mod validate_instances;
mod wide_bvh;
mod world_space_ray;

pub use blas::Blas;
pub use cursor::Cursor;
pub use drawn_hits::TraversalSeeds;
pub use flags::{GeometryFlags, InstanceFlags, RayFlags};
pub use geometry::Geometry;
pub use geometry_data::{EndCaps, GeometryData, GeometryKind, Indexing};
pub use hit::{Candidate, Committed, HitKind, HitPrimitive};
pub use instance::TlasInstance;
pub use look_ahead::LookAhead;
pub use micromap::OpacityMicromap;
pub use motion::{Motion, Srt};
pub use observer::{Counters, InstanceVerdict, PrimitiveVerdict, TestCounts, TraversalObserver};
pub use packet::Packet;
pub use primitive::Primitive;
pub use record_index::RecordIndex;
pub use surface_normal::surface_normal;
pub use tlas::Tlas;
pub use trace_ray::{RayRule, TraceRay};
