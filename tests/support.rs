//! What several areas share. `judges/` includes these files, too, by their paths.

pub mod assembly;
pub mod files;
pub mod imports;
pub mod mutate;
pub mod program;
pub mod recorded;
pub mod skipped;
#[cfg(unix)]
pub mod terminal;
pub mod verdict;
