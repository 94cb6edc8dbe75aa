//! `subjects::picture` of `tests/robustness/`, without end: `cargo +nightly fuzz run picture`.

#![no_main]

anyhit_fuzz::target!(picture, bytes);
