//! `subjects::recording` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run
//! recording`.

#![no_main]

anyhit_fuzz::target!(recording, bytes);
