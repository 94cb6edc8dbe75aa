//! `anyhit stress`: draws adversarial rays and checks each answer in arbitrary precision.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::atomic_file;
use crate::cli::input::SceneFileArgs;
use crate::cli::{output, precision};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Precision;
use crate::scene::LoadOptions;
use crate::stress::family::FAMILIES;
use crate::stress::{self, FoundFailure, StressReport, StressSettings, Tally};

/// Draws adversarial rays and shapes and compares every answer with arbitrary precision.
///
/// Runs until --rays or --minutes is reached, or ten answers were wrong; without either until it is
/// interrupted. A wrong answer is made smaller, printed, and saved as a file that the tests replay.
///
/// With a scene file, rays are drawn in its acceleration structures, and what they find there is
/// compared with what they find by the BVHs of another builder over the same primitives.
#[derive(Debug, clap::Args)]
pub struct StressArgs {
    /// A scene file, or `-` for standard input
    #[arg(value_name = "SCENE")]
    scene: Option<PathBuf>,

    /// The seed of the cases; it draws the same cases on every machine
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// End after at least this many rays
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,

    /// End after this many minutes, fractions allowed
    #[arg(long, value_name = "M", value_parser = minutes)]
    minutes: Option<Duration>,

    /// The precision to test; below `exact` wrong answers are expected
    #[arg(long, value_name = "PRECISION", value_parser = precision::parser(), default_value = "exact")]
    precision: Precision,

    /// The folder into which wrong cases are saved
    #[arg(long, value_name = "FOLDER", default_value = "tests/stress-regressions")]
    save: PathBuf,

    #[command(flatten)]
    files: SceneFileArgs,
}

/// Runs the command.
///
/// # Errors
/// `Expectation` where an answer was wrong; `Io` where its case cannot be saved; what the scene
/// lacks.
pub fn run(args: StressArgs) -> Result<()> {
    let settings =
        StressSettings { seed: args.seed, rays: args.rays, time: args.minutes, precision: args.precision };
    if let Some(path) = &args.scene {
        return run_scene(path, &args.files, &settings);
    }
    output::print(format_args!("seed {}, {} families\n", args.seed, FAMILIES.len()))?;
    let mut progress = Progress(Instant::now());
    let report = stress::run(&settings, |report| {
        progress.print(report.time, report.total().rays, report.failures.len());
    });
    output::print(table(&report))?;
    if report.failures.is_empty() {
        return Ok(());
    }
    for found in &report.failures {
        let path = save(&args.save, &settings, found)?;
        output::print(format_args!(
            "\ncase {} of seed {}, family {}: {}\n\n{}\nsaved as {}\n",
            found.number,
            args.seed,
            found.case.family,
            found.failure,
            found.case.to_toml(),
            path.display()
        ))?;
    }
    Err(wrong_answers(report.failures.len()))
}

/// Judges the acceleration structures of a scene.
fn run_scene(path: &Path, files: &SceneFileArgs, settings: &StressSettings) -> Result<()> {
    let scene = files.scene(path, &LoadOptions::default())?;
    output::notes(&scene.notes);
    let mut progress = Progress(Instant::now());
    let report = stress::scene::run(&scene.tlas, settings, |report| {
        progress.print(report.time, report.tally.rays, report.failures.len());
    });
    let Tally { lines, rays, hits, trees, packets, .. } = report.tally;
    if lines == 0 {
        let message = "the scene has no acceleration structure with primitives";
        return Err(Error::new(ErrorKind::InvalidScene, message));
    }
    let (seconds, wrong) = (report.time.as_secs_f64(), report.failures.len());
    output::print(format_args!(
        "{lines} rays, traced {rays} times in {seconds:.1} s: {hits} hit, {trees} went through trees, {packets} in \
         packets\n{wrong} wrong answers, judged by BVHs of obvhs over the same primitives\n"
    ))?;
    for failure in &report.failures {
        output::print(format_args!("\n{failure}\n"))?;
    }
    if wrong == 0 { Ok(()) } else { Err(wrong_answers(wrong)) }
}

fn wrong_answers(count: usize) -> Error {
    Error::new(ErrorKind::Expectation, format!("{count} wrong answers"))
}

fn minutes(text: &str) -> std::result::Result<Duration, String> {
    text.parse::<f64>()
        .ok()
        .filter(|&minutes| minutes > 0.0)
        .and_then(|minutes| Duration::try_from_secs_f64(minutes * 60.0).ok())
        .ok_or_else(|| format!("`{text}` is not a positive number of minutes"))
}

/// Prints a line of progress every ten seconds; holds when it printed the last.
struct Progress(Instant);

impl Progress {
    fn print(&mut self, time: Duration, rays: u64, wrong: usize) {
        if self.0.elapsed() >= Duration::from_secs(10) {
            self.0 = Instant::now();
            let line = format!("{:>6} s  {rays:>12} rays  {wrong} wrong\n", time.as_secs());
            // A closed standard output is reported at the end.
            let _ = output::print(line);
        }
    }
}

fn table(report: &StressReport) -> String {
    let row = |name: &str, columns: [&dyn Display; 5], about: &str| {
        let [lines, rays, hits, trees, packets] = columns;
        let row = format!("{name:<14} {lines:>11} {rays:>11} {hits:>11} {trees:>11} {packets:>11}  {about}");
        format!("{}\n", row.trim_end())
    };
    let tallied = |name: &str, tally: &Tally, about: &str| {
        let Tally { lines, rays, hits, trees, packets, .. } = tally;
        row(name, [lines, rays, hits, trees, packets], about)
    };
    let heads: [&dyn Display; 5] = [&"lines", &"rays", &"hits", &"in trees", &"in packets"];
    let mut out = format!("\n{}", row("family", heads, "what"));
    for (family, tally) in FAMILIES.iter().zip(&report.families) {
        out += &tallied(family.name, tally, family.about);
    }
    let total = report.total();
    out += &format!("{}\n", tallied("all", &total, ""));
    out += &format!(
        "{} rays in {:.1} s: {} wrong decisions; t, u and barycentrics correctly rounded in the others\n",
        total.rays,
        report.time.as_secs_f64(),
        report.failures.len()
    );
    out
}

fn save(folder: &Path, settings: &StressSettings, found: &FoundFailure) -> Result<PathBuf> {
    std::fs::create_dir_all(folder).map_err(|error| Error::io(folder.display().to_string(), error))?;
    let path = folder.join(format!("{}-{}-{}.toml", found.case.family, settings.seed, found.number));
    let text = format!(
        "# {}\n# Found by `anyhit stress --seed {}`, case {}.\n{}",
        found.failure,
        settings.seed,
        found.number,
        found.case.to_toml()
    );
    atomic_file::write(&path, text)?;
    Ok(path)
}
