//! `subjects::command_line` of `tests/input/robustness/`, without end:
//! `cargo +nightly fuzz run command_line`.

#![no_main]

anyhit_fuzz::target!(command_line, text);
