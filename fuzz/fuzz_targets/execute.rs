//! `subjects::execute` of `tests/robustness/`, without end: `cargo +nightly fuzz run execute`.

#![no_main]

anyhit_fuzz::target!(execute, module);
