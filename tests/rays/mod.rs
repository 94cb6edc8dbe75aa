//! Rays: traversal and intersection, beside references and recorded drivers.

mod conformance;
mod driver_golden;
#[cfg(feature = "stress")]
mod exact_intersections;
#[cfg(all(feature = "proptest", feature = "wgsl"))]
mod laws;
#[cfg(feature = "stress")]
mod stress;
mod swept_sphere_tables;
mod traversal_order;
mod traversal_rules;
mod verify;
