//! Instructions that are no rows: small programs, run at every width of a batch.

#[path = "../support/assembly.rs"]
mod assembly;

mod atomics;
mod memory;
mod run;
