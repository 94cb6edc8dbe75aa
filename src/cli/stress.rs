//! `anyhit stress`: draws adversarial rays and checks each answer in arbitrary precision.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::atomic_file;
use crate::cli::{output, precision};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Precision;
use crate::stress::family::FAMILIES;
use crate::stress::{self, FoundFailure, StressReport, StressSettings, Tally};

/// Draws adversarial rays and shapes and compares every answer with arbitrary precision.
///
/// Runs until --rays or --minutes is reached, or ten answers were wrong; without either until it is
/// interrupted. A wrong answer is made smaller, printed, and saved as a file that the tests replay.
#[derive(Debug, clap::Args)]
pub struct StressArgs {
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
}

/// Runs the command.
///
/// # Errors
/// `Expectation` where an answer was wrong; `Io` where its case cannot be saved.
pub fn run(args: StressArgs) -> Result<()> {
    let settings =
        StressSettings { seed: args.seed, rays: args.rays, time: args.minutes, precision: args.precision };
    output::print(format_args!("seed {}, {} families\n", args.seed, FAMILIES.len()))?;
    let mut last_printed = Instant::now();
    let report = stress::run(&settings, |report| {
        if last_printed.elapsed() >= Duration::from_secs(10) {
            last_printed = Instant::now();
            // A closed standard output is reported at the end.
            let _ = output::print(line(report));
        }
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
    let message = format!("{} wrong answers", report.failures.len());
    Err(Error::new(ErrorKind::Expectation, message))
}

fn minutes(text: &str) -> std::result::Result<Duration, String> {
    text.parse::<f64>()
        .ok()
        .filter(|&minutes| minutes > 0.0)
        .and_then(|minutes| Duration::try_from_secs_f64(minutes * 60.0).ok())
        .ok_or_else(|| format!("`{text}` is not a positive number of minutes"))
}

fn line(report: &StressReport) -> String {
    let total = report.total();
    format!("{:>6} s  {:>12} rays  {} wrong\n", report.time.as_secs(), total.rays, report.failures.len())
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
