//! `subjects::wgsl` of `tests/robustness/`, without end: `cargo +nightly fuzz run wgsl`.

#![no_main]

anyhit_fuzz::target!(wgsl, text);
