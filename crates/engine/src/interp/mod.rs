//! The interpreter: one loop for every batch width, with or without an observer.
//!
//! It never calls the pipeline: at an instruction that needs it, such as a trace, the loop returns
//! a [`Stop`](crate::machine::Stop). Running the batch again continues after that instruction.

mod run;
mod superop;

pub use run::{run, run_lane, run_shader};
