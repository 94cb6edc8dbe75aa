//! Comparison with lavapipe (Mesa's Vulkan driver for the CPU), Embree and a plain loop over obvhs,
//! in turn on the same scenes, rays and shaders: prints the table of ratios.
//!
//! `ANYHIT_PEERS=FOLDER cargo bench --bench peers` takes five rounds, or as many as the number
//! after `--`; a word after `--` chooses the rows whose names contain it. `benches/peers/README.md`
//! says how the folder is made. `growth` after `--` measures building, memory and rays beside
//! Embree instead, for up to as many triangles as the number behind it (a million; 10^8 take 40
//! GiB).
//!
//! Every row is measured here and at its peer at once, one thread each, in processor time; what is
//! printed are medians of the rounds, and the ratio's is that of the rounds' own ratios.

#![allow(clippy::print_stdout, reason = "a table is printed")]

mod growth;
mod installed;
mod obvhs;
mod rows;
mod scene_files;

#[path = "../speed/clock.rs"]
mod clock;
#[path = "../speed/frames.rs"]
mod frames;
#[path = "../speed/scenes.rs"]
#[allow(dead_code, reason = "not all of it is compared")]
mod scenes;
#[path = "../speed/table.rs"]
#[allow(dead_code, reason = "all rows are wanted here")]
mod table;
#[path = "../speed/traverse.rs"]
mod traverse;

use std::process::ExitCode;

use installed::Installed;
use rows::{ROWS, Row, Unit};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(installed) = Installed::from_environment() else {
        println!("SKIPPED: ANYHIT_PEERS names no folder of peers (benches/peers/README.md)");
        return ExitCode::SUCCESS;
    };
    if !arguments.iter().any(|argument| argument == "--bench") {
        println!("SKIPPED: peers are measured by `cargo bench` alone");
        return ExitCode::SUCCESS;
    }
    if arguments.iter().any(|argument| argument == "growth") {
        let most = arguments.iter().find_map(|argument| argument.parse().ok());
        return match growth::run(&installed, most.unwrap_or(1_000_000)) {
            Ok(()) => ExitCode::SUCCESS,
            Err(problem) => {
                println!("{problem}");
                ExitCode::FAILURE
            }
        };
    }
    let mut rounds = 5;
    let mut part = None;
    for argument in arguments.iter().filter(|argument| !argument.starts_with('-')) {
        match argument.parse() {
            Ok(number) => rounds = number,
            Err(_) => part = Some(argument.as_str()),
        }
    }
    let rows: Vec<&Row> = ROWS.iter().filter(|row| part.is_none_or(|part| row.name.contains(part))).collect();
    scene_files::write(&installed.share);
    let mut results: Vec<Vec<rows::RoundResult>> = rows.iter().map(|_| Vec::new()).collect();
    for round in 1..=rounds {
        for (row, results) in rows.iter().zip(&mut results) {
            match row.measure(&installed) {
                Ok(pair) => {
                    println!(
                        "round {round}: {}: {:.3}, {} {:.3}",
                        row.name,
                        pair.ours,
                        row.peer.name(),
                        pair.theirs
                    );
                    results.push(pair);
                }
                Err(problem) => {
                    println!("round {round}: {}: {problem}", row.name);
                    return ExitCode::FAILURE;
                }
            }
        }
    }
    println!("\nMedians of {rounds} rounds.\n");
    println!("| | | peer | here | ratio | lowest, highest | wanted |");
    println!("|---|---|---|---|---|---|---|");
    for (row, results) in rows.iter().zip(&results) {
        let of = |value: fn(&rows::RoundResult) -> f64| {
            let mut values: Vec<f64> = results.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let median = |values: &[f64]| values[values.len() / 2];
        let (here, there) = (median(&of(|pair| pair.ours)), median(&of(|pair| pair.theirs)));
        let ratios = match row.unit {
            Unit::Rate => of(|pair| pair.ours / pair.theirs),
            Unit::Milliseconds => of(|pair| pair.theirs / pair.ours),
        };
        println!(
            "| {} | {} | {there:.2} {unit} | {here:.2} {unit} | {:.2} | {:.2}, {:.2} | {:.2} |",
            row.name,
            row.peer.name(),
            median(&ratios),
            ratios[0],
            ratios[ratios.len() - 1],
            row.wanted,
            unit = row.unit.name(),
        );
    }
    ExitCode::SUCCESS
}
