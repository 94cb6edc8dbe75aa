//! All integration tests of the crate, as one executable: a module for each area.
//!
//! `cargo test --test main stability::` runs one area. What is not here is `cases.rs`, which lists
//! its tests while it runs. The tests share a process: none may change what belongs to all of it,
//! such as environment variables, the current directory or the panic hook. Whoever needs that
//! starts the program `anyhit` as a process of its own.

mod support;

mod commands;
mod debugger;
mod execution;
mod input;
mod modules;
mod rays;
mod repository;
mod rust;
mod sanitizer;
mod scenes;
