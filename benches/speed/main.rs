//! Benchmarks of the stages of a launch in CPU time: loading, lowering, BVH build, traversal,
//! shading.
//!
//! `cargo bench --bench speed` prints a table; an argument after `--` chooses the rows whose names
//! begin with it; `--draw` draws docs/growth.svg from the values of the last complete run. Without
//! `--bench` (`cargo test --benches`) everything runs once and small.
//!
//! Processor time (of all threads of the process) is what is counted, as wall time doubles on a
//! busy machine. Each row is the median of several runs.

#![allow(clippy::print_stdout, reason = "a table is printed")]

#[cfg(feature = "stress")]
mod builders;
mod clock;
#[path = "../figure/mod.rs"]
mod figure;
mod frames;
mod growth;
mod networks;
mod ready;
mod scenes;
mod synthetic;
mod table;
mod threads;
mod traverse;

use table::Table;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let full = arguments.iter().any(|argument| argument == "--bench");
    let only_draws = arguments.iter().any(|argument| argument == "--draw");
    let wanted = arguments.into_iter().find(|argument| !argument.starts_with('-'));
    if only_draws {
        return growth::draw_recorded().expect("a figure");
    }
    if threads::is_worker() {
        return threads::work(full);
    }
    let mut table = Table::new(full, wanted);
    traverse::run(&mut table);
    frames::run(&mut table);
    networks::run(&mut table);
    threads::run(&table);
    ready::run(&mut table);
    growth::run(&table);
    #[cfg(feature = "stress")]
    builders::run(&table);
}
