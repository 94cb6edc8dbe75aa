//! Instructions that are no rows: small programs, run at every width of a batch.

#[path = "../support/assembly.rs"]
mod assembly;

mod atomics;
mod calls;
mod float_controls;
mod integers;
mod memory;
mod messages;
mod motion;
mod ray_queries;
mod run;
mod subgroups;
