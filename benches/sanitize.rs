//! What the sanitizer costs: a launch with the optimizer, as it was translated, and under the
//! sanitizer without the rules about races and with them, each on one thread. The clock is that of
//! the processor time, so that other programs on the machine count for little.
//!
//! `cargo bench --bench sanitize` prints the table of `docs/sanitize.md`: medians of runs in turn,
//! and their ratios. Without `--bench` (`cargo test --benches`) every row runs once.

#![allow(clippy::print_stdout, reason = "a table is printed")]

use std::path::Path;
use std::time::Duration;

use anyhit_cases::sanitized::run_sanitized;
use anyhit_engine::machine::Resources;
use anyhit_engine::pipeline::RunOptions;
use anyhit_sanitize::rule::race;
use anyhit_sanitize::{Level, Levels};
use anyhit_scene::{Assembled, DiskFiles, LoadOptions, assemble, load, load_text};

#[path = "speed/clock.rs"]
mod clock;

/// Scenes, each with the size of its launch.
const SCENES: [(&str, [u32; 2]); 3] = [
    ("scenes/swept-spheres.toml", [160, 90]),
    ("examples/renderer/scene.toml", [64, 36]),
    (ARITHMETIC, [64, 64]),
];

/// The scene of a shader that only computes.
const ARITHMETIC: &str = "arithmetic";
const ARITHMETIC_SCENE: &str = r#"
version = 1
launch = [64, 64]
[shaders]
raygen = "spirv-fixtures/bench/arithmetic.rgen.spv"
[pipeline]
raygen = "raygen"
[resources.pixels]
type = "storage_buffer"
binding = 1
size = 65536
"#;

/// How often each launch runs in turn with the others.
const RUNS: usize = 25;

fn main() {
    let full = std::env::args().any(|argument| argument == "--bench");
    println!("| launch | optimised | translated | without races | with races | ratios to translated |");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for (path, size) in SCENES {
        pool.install(|| row(path, size, if full { RUNS } else { 1 }));
    }
}

fn row(path: &str, size: [u32; 2], runs: usize) {
    let options = LoadOptions { size: Some(size), ..LoadOptions::default() };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = match path {
        ARITHMETIC => load_text(&root.join("scene.toml"), ARITHMETIC_SCENE, &DiskFiles, &options),
        path => load(&root.join(path), &DiskFiles, &options),
    };
    let scene = scene.expect("a scene");
    let assembled = assemble(&scene).expect("valid shaders");
    let reference = assembled.unoptimized().expect("valid shaders");
    let all = Levels::default();
    let mut without_races = Levels::default();
    for rule in race::RULES {
        without_races.set(rule.id, Level::Allow).expect("a rule");
    }
    let launch = |assembled: &Assembled, resources: &Resources| {
        assembled.run(resources, RunOptions::default()).expect("no trap");
    };
    let sanitize = |levels: &Levels| {
        let run = run_sanitized(&scene, &assembled, &assembled.resources, levels).expect("valid shaders");
        run.outcome.expect("no trap");
    };
    let mut times = [const { Vec::new() }; 4];
    for _ in 0..runs {
        times[0].push(timed(|| launch(&assembled, &assembled.resources)));
        times[1].push(timed(|| launch(&reference, &assembled.resources)));
        times[2].push(timed(|| sanitize(&without_races)));
        times[3].push(timed(|| sanitize(&all)));
    }
    let medians = times.map(|mut times| {
        times.sort_unstable();
        times[times.len() / 2].as_secs_f64() * 1e3
    });
    let [optimized, translated, without_races, with_races] = medians;
    println!(
        "| {path}, {} x {} | {optimized:.2} ms | {translated:.2} ms | {without_races:.1} ms | \
         {with_races:.1} ms | {:.1}, {:.1} |",
        size[0],
        size[1],
        without_races / translated,
        with_races / translated
    );
}

fn timed(work: impl FnOnce()) -> Duration {
    let begin = clock::process();
    work();
    clock::process() - begin
}
