//! Growth of time and memory with the size of inputs.
//!
//! `cargo bench --bench growth` prints a table; `docs/performance.md` describes it. Options after
//! `--`: a part of names of curves, `--list` to print the names, and `--judge` to exit with 1 if a
//! cost grows faster than it may. Without `--bench` (`cargo test --benches`) the smallest size of
//! each curve runs once.
//!
//! Commands run in processes of their own: this program is also `anyhit` (`measure.rs`).

#![allow(clippy::print_stdout, reason = "a table is printed")]

mod bounce_shaders;
mod cases;
#[path = "../speed/clock.rs"]
mod clock;
mod curve;
mod debugging;
mod fit;
mod frames;
mod glb;
mod loading;
mod measure;
mod module_writer;
mod scene_text;
#[allow(dead_code, reason = "shared with the bench `speed`")]
#[path = "../speed/scenes.rs"]
mod scenes;
mod seeds;
mod shapes;
mod trees;

use std::process::ExitCode;

/// Further measurements of a curve that is not accepted: machines are noisy.
const RETRIES: usize = 2;

fn main() -> ExitCode {
    if let Some(code) = measure::run_as_command() {
        return code;
    }
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let given = |option: &str| arguments.iter().any(|argument| argument == option);
    let (full, judge) = (given("--bench"), given("--judge"));
    let filter = arguments.iter().find(|argument| !argument.starts_with('-'));
    let curves = [cases::curves(), loading::curves(), seeds::curves(), frames::curves(), shapes::curves()];
    let curves = curves.into_iter().chain([trees::curves(), debugging::curves()]).flatten();
    let curves = curves.filter(|curve| filter.is_none_or(|text| curve.name.contains(text.as_str())));
    if given("--list") {
        curves.for_each(|curve| println!("{}", curve.name));
        return ExitCode::SUCCESS;
    }
    println!("| curve | sizes | times | peak bytes per unit | time exponent | memory exponent | wanted |");
    println!("|---|---|---|---|---|---|---|");
    let mut failures = Vec::new();
    for curve in curves {
        let mut measured = curve.measure(full);
        for _ in 0..RETRIES {
            if full && judge && !measured.is_accepted(&curve) {
                measured = curve.measure(full);
            }
        }
        println!("{}", measured.row(&curve));
        if !measured.is_accepted(&curve) {
            failures.push(measured.failure(&curve));
        }
    }
    for failure in &failures {
        println!("\ngrows too fast: {failure}");
    }
    if judge && !failures.is_empty() { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
