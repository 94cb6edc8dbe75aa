//! What tests share, where their files look for it.

#[path = "../../tests/support/files.rs"]
pub mod files;
#[path = "../../tests/support/mutate.rs"]
pub mod mutate;
