//! `subjects::gltf` of `tests/input/robustness/`, without end: `cargo +nightly fuzz run gltf`.

#![no_main]

anyhit_fuzz::target!(gltf, bytes);
