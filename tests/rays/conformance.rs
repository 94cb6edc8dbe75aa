//! Behaviours that public conformance suites check, restated with values derived here: see
//! `docs/conformance.md`.
//!
//! Small tables over one set of shaders, `shaders/pass/conformance/probe`: its ray generation
//! shader traces the rays of a buffer and stores what became of each, hit and miss shaders note all
//! that they are told, any-hit and intersection shaders do as their shader record says.

mod builtins;
mod rig;
mod shader_binding_table;
mod swept_spheres;
mod traversal;
mod triangles;
