//! `subjects::execute` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run
//! execute`.

#![no_main]

anyhit_fuzz::target!(execute, module);
