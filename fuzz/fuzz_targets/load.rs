//! `subjects::load` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run load`.

#![no_main]

anyhit_fuzz::target!(load, module);
