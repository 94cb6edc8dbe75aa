//! `subjects::obj` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run obj`.

#![no_main]

anyhit_fuzz::target!(obj, text);
