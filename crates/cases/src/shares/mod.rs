//! Shares: parts of the work of a long command, which several machines do, and their results.
//!
//! A [`Shard`] says which part of how many. What a command finds in it is a [`ShareResult`], and a
//! file holds [`ShareResults`]: those of one share or of several, by their numbers. To merge is to
//! unite such sets, so neither the order nor the grouping of files changes what comes out. All
//! reports are made of a set, and a run that was not shared is share 1 of 1: so the reports of a
//! merged set are those of the whole run.

#[cfg(feature = "stress")]
pub mod check_math;
#[cfg(feature = "reports")]
pub mod render;
mod results;
mod shard;
pub mod smoke;
#[cfg(feature = "stress")]
pub mod stress;
mod timings;

pub use results::{ShareResult, ShareResults, command_of, fingerprint};
pub use shard::Shard;
pub use timings::Timings;
