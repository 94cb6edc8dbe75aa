//! `anyhit stress`: draws adversarial rays and checks each answer in arbitrary precision.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::cli::input::SceneFileArgs;
use crate::cli::numbers::{minutes, seed_range};
use crate::cli::share::ShareArgs;
use crate::cli::{output, precision};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::{atomic_file, escape};
use anyhit_cases::shares::ShareResults;
use anyhit_cases::shares::stress::{StressFailure, StressResult, StressWhole};
use anyhit_engine::geometry::Precision;
use anyhit_scene::LoadOptions;
use anyhit_stress::family::FAMILIES;
use anyhit_stress::{FixedCases, StressReport, StressSettings, Tally};

/// Generate adversarial rays and shapes and compare every hit with arbitrary-precision arithmetic.
///
/// The run ends at --rays or --minutes, after ten wrong answers, or when it is interrupted. A wrong
/// answer is reduced, printed, and saved as a file that the tests replay.
///
/// --cases fixes the number of cases, so that --shard can divide them among machines.
///
/// With a scene file, trace random rays through its acceleration structures and through BVHs of
/// obvhs over the same primitives, and compare the hits.
#[derive(Debug, clap::Args)]
pub(super) struct StressArgs {
    /// Scene file, or `-` for standard input
    #[arg(value_name = "SCENE")]
    scene: Option<PathBuf>,

    /// Seed of the cases; a seed generates the same cases on every machine
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Run exactly N cases of each seed, however many are wrong; the first ten wrong ones are
    /// reported
    #[arg(long, value_name = "N", conflicts_with_all = ["rays", "minutes"], value_parser = clap::value_parser!(u64).range(1..))]
    cases: Option<u64>,

    /// With --cases: generate cases from each of the seeds A to B - 1
    #[arg(long, value_name = "A..B", conflicts_with = "seed", value_parser = seed_range)]
    seed_range: Option<Range<u64>>,

    /// Stop after at least this many rays
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    rays: Option<u64>,

    /// Stop after this many minutes; fractions are allowed
    #[arg(long, value_name = "M", value_parser = minutes)]
    minutes: Option<Duration>,

    /// Precision to test; below `exact`, wrong answers are expected
    #[arg(long, value_name = "PRECISION", value_parser = precision::parser(), default_value = "exact")]
    precision: Precision,

    /// Folder in which wrong cases are saved
    #[arg(long, value_name = "FOLDER", default_value = "tests/stress-regressions")]
    save: PathBuf,

    /// Print no times and no progress, so that the output is the same in every run
    #[arg(long)]
    no_times: bool,

    #[command(flatten)]
    files: SceneFileArgs,

    #[command(flatten)]
    share: ShareArgs,
}

/// Runs the command.
///
/// # Errors
/// `Expectation` where an answer was wrong; `Io` where its case cannot be saved; what the scene
/// lacks; `InvalidArgument` for a share of what has no fixed number of cases.
pub(super) fn run(args: StressArgs) -> Result<()> {
    let settings =
        StressSettings { seed: args.seed, rays: args.rays, time: args.minutes, precision: args.precision };
    if let Some(path) = &args.scene {
        let given = [
            (args.share.is_requested(), "`--shard` and `--result`"),
            (args.seed_range.is_some(), "`--seed-range`"),
            (args.cases.is_some(), "`--cases`"),
        ];
        if let Some((_, flags)) = given.iter().find(|(given, _)| *given) {
            let message = format!("{flags} cannot be used with a scene file");
            let note = "help: pass a different `--seed` to each run over the scene";
            return Err(Error::new(ErrorKind::InvalidArgument, message).note(note));
        }
        return run_scene(path, &args.files, &settings);
    }
    let seeds = args.seed_range.clone().unwrap_or(args.seed..args.seed.saturating_add(1));
    let whole = StressWhole {
        seeds: [seeds.start, seeds.end],
        cases: args.cases,
        precision: args.precision.name().to_owned(),
    };
    output::print(heading(&whole))?;
    let mut progress = Progress(Instant::now());
    let mut on_progress = |report: &StressReport| {
        if !args.no_times {
            progress.print(report.time, report.total().rays, report.wrong);
        }
    };
    let report = match args.cases {
        Some(cases) => {
            let (fixed, shard) = (FixedCases { seeds, cases }, args.share.shard_or_whole());
            anyhit_stress::run_fixed(&fixed, args.precision, |place| shard.holds(place), on_progress)
        }
        None if args.share.is_requested() || args.seed_range.is_some() => return Err(needs_cases()),
        None => anyhit_stress::run(&settings, &mut on_progress),
    };
    let results = ShareResults::new(whole, args.share.shard_or_whole(), StressResult::of(&report));
    args.share.write(&results)?;
    print_end(&StressResult::of_shares(&results), &args.save, !args.no_times)
}

fn needs_cases() -> Error {
    let message = "`--shard`, `--result` and `--seed-range` require `--cases N`";
    Error::new(ErrorKind::InvalidArgument, message).note(
        "a run that `--rays`, `--minutes` or ten failures end has no fixed number of cases that shards could \
         divide",
    )
}

/// The report of merged shares, but for times.
///
/// # Errors
/// As [`run`].
pub(super) fn print_merged(results: &ShareResults<StressResult>, save: &Path) -> Result<()> {
    StressResult::check_shares(results)?;
    output::print(heading(results.whole()))?;
    print_end(&StressResult::of_shares(results), save, false)
}

fn heading(whole: &StressWhole) -> String {
    let [first, end] = whole.seeds;
    let seeds = match end.saturating_sub(first) {
        0 | 1 => format!("seed {first}"),
        _ => format!("seeds {first} to {}", end - 1),
    };
    format!("{seeds}, {} families\n", FAMILIES.len())
}

/// Prints the table and what was wrong, and saves that.
fn print_end(result: &StressResult, folder: &Path, with_times: bool) -> Result<()> {
    output::print(table(result, with_times))?;
    for found in &result.failures {
        let path = save(folder, found)?;
        output::print(format_args!(
            "\ncase {} of seed {}, family {}: {}\n\n{}\nsaved as {}\n",
            found.number,
            found.seed,
            found.family,
            found.failure,
            found.case,
            escape::path(&path)
        ))?;
    }
    if result.wrong == 0 { Ok(()) } else { Err(wrong_answers(result.wrong)) }
}

/// Judges the acceleration structures of a scene.
fn run_scene(path: &Path, files: &SceneFileArgs, settings: &StressSettings) -> Result<()> {
    let scene = files.scene(path, &LoadOptions::default())?;
    output::notes(&scene.notes);
    let mut progress = Progress(Instant::now());
    let report = anyhit_stress::scene::run(&scene.tlas, settings, |report| {
        progress.print(report.time, report.tally.rays, report.failures.len() as u64);
    });
    let Tally { lines, rays, hits, trees, packets, .. } = report.tally;
    if lines == 0 {
        let message = "no acceleration structure of the scene contains primitives";
        return Err(Error::new(ErrorKind::InvalidScene, message));
    }
    let [lines, rays, hits, trees, packets] = [lines, rays, hits, trees, packets].map(grouped);
    let (seconds, wrong) = (report.time.as_secs_f64(), report.failures.len() as u64);
    output::print(format_args!(
        "{lines} rays, traced {rays} times in {seconds:.1} s: {hits} hits, {trees} through trees, {packets} in \
         packets\n{} wrong answers, compared with BVHs that obvhs builds of the same primitives\n",
        grouped(wrong)
    ))?;
    for failure in &report.failures {
        output::print(format_args!("\n{failure}\n"))?;
    }
    if wrong == 0 { Ok(()) } else { Err(wrong_answers(wrong)) }
}

fn wrong_answers(count: u64) -> Error {
    Error::new(ErrorKind::Expectation, format!("{} wrong answers", grouped(count)))
}

/// Prints a line of progress every ten seconds; holds when it printed the last.
struct Progress(Instant);

impl Progress {
    fn print(&mut self, time: Duration, rays: u64, wrong: u64) {
        if self.0.elapsed() >= Duration::from_secs(10) {
            self.0 = Instant::now();
            let line =
                format!("{:>6} s  {:>15} rays  {} wrong\n", time.as_secs(), grouped(rays), grouped(wrong));
            // A closed standard output is reported at the end.
            let _ = output::print(line);
        }
    }
}

fn table(result: &StressResult, with_times: bool) -> String {
    let row = |name: &str, columns: [String; 5], about: &str| {
        let [lines, rays, hits, trees, packets] = columns;
        let row = format!("{name:<14} {lines:>13} {rays:>13} {hits:>13} {trees:>13} {packets:>13}  {about}");
        format!("{}\n", row.trim_end())
    };
    let tallied = |name: &str, tally: &Tally, about: &str| {
        let Tally { lines, rays, hits, trees, packets, .. } = *tally;
        row(name, [lines, rays, hits, trees, packets].map(grouped), about)
    };
    let heads = ["lines", "rays", "hits", "in trees", "in packets"].map(str::to_owned);
    let mut out = format!("\n{}", row("family", heads, "what"));
    for (family, tally) in FAMILIES.iter().zip(&result.families) {
        out += &tallied(family.name, tally, family.about);
    }
    let total = result.total();
    out += &format!("{}\n", tallied("all", &total, ""));
    let time = match with_times {
        true => format!(" in {:.1} s", result.time().as_secs_f64()),
        false => String::new(),
    };
    out += &format!(
        "{} rays{time}: {} wrong decisions; t, u and barycentrics correctly rounded in the others\n",
        grouped(total.rays),
        grouped(result.wrong)
    );
    out
}

fn save(folder: &Path, found: &StressFailure) -> Result<PathBuf> {
    std::fs::create_dir_all(folder).map_err(|error| Error::io(escape::path(&folder).to_string(), error))?;
    let StressFailure { seed, number, family, failure, case } = found;
    let path = folder.join(format!("{family}-{seed}-{number}.toml"));
    let text = format!("# {failure}\n# Found by `anyhit stress --seed {seed}`, case {number}.\n{case}");
    atomic_file::write(&path, text)?;
    Ok(path)
}
