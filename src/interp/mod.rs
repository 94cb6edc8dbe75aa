//! The interpreter: one loop, at every width, with or without an observer.
//!
//! It stops, it never calls the host: what a shader asks of the pipeline comes back as a
//! [`Stop`](crate::machine::Stop), and running the batch again goes on behind it.

mod run;

pub use run::run;
