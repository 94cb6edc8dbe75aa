//! `subjects::picture` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run
//! picture`.

#![no_main]

anyhit_fuzz::target!(picture, bytes);
