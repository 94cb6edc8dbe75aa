//! `subjects::smoke` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run smoke`.

#![no_main]

anyhit_fuzz::target!(smoke, module);
