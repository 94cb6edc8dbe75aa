//! `subjects::wgsl` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run wgsl`.

#![no_main]

anyhit_fuzz::target!(wgsl, text);
