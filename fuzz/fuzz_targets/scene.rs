//! `subjects::scene` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run scene`.

#![no_main]

anyhit_fuzz::target!(scene, scene);
