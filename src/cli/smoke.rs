//! `anyhit smoke`: runs every entry point of a module on made-up inputs.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use serde::Serialize;

use crate::cli::input::InputLimitArgs;
use crate::cli::limits::LaunchLimitArgs;
use crate::cli::source::SourceArgs;
use crate::cli::{module_file, output};
use crate::error::{Error, ErrorKind, ErrorReport, Result};
use crate::harness::sanitized::deny;
use crate::harness::smoke::{SmokeOptions, SmokeReport, SmokeVerdict};
use crate::machine::LaunchLimits;

/// Runs every ray-tracing and compute entry point of a module on made-up inputs.
///
/// Buffers, images, samplers, push constants, shader records, payloads, device addresses and
/// acceleration structures are made up from what the module declares: integers 0 to 3, floats in
/// [0, 1), identity matrices. New sets of values are tried until every basic block was entered or
/// new sets enter no further block. Exit codes: 0 all ran to their end, 1 one trapped or entered
/// less than `--min-coverage`, 4 one is not supported, 2 the module is invalid, 6 the sanitizer
/// denies what is in the module.
#[derive(Args, Clone, Debug)]
pub struct SmokeArgs {
    /// A SPIR-V module, or the source of one (GLSL, WGSL, Slang, HLSL), or `-` for standard input
    #[arg(value_name = "MODULE")]
    module: PathBuf,
    #[command(flatten)]
    how: SourceArgs,
    #[command(flatten)]
    limits: InputLimitArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// The seed of all made-up values
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Instructions that an invocation may execute, counted at back edges, calls and stops
    #[arg(long, value_name = "N", default_value_t = SmokeOptions::default().fuel)]
    fuel: u64,
    /// The old name of `--fuel`.
    #[arg(long, value_name = "N", hide = true, conflicts_with = "fuel")]
    budget: Option<u64>,
    /// Operations that all runs of an entry point may execute, counted once for all lanes of a
    /// batch, before no further set of values is tried
    #[arg(long, value_name = "N", default_value_t = SmokeOptions::default().total_fuel)]
    total_fuel: u64,
    /// Try no further sets of values after this time; the report then depends on the machine
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    seconds: Option<Duration>,
    #[command(flatten)]
    launch_limits: LaunchLimitArgs,
    /// Run every set of values under the sanitizer, too, and tell what it finds; as the inputs are
    /// made up, nothing is denied
    #[arg(long)]
    sanitize: bool,
    /// Fail where an entry point entered less than this many percent of its blocks
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    min_coverage: Option<f64>,
}

fn seconds(text: &str) -> std::result::Result<Duration, String> {
    let number: f64 = text.parse().map_err(|_| "a number of seconds is needed".to_owned())?;
    Duration::try_from_secs_f64(number).map_err(|error| error.to_string())
}

fn percent(text: &str) -> std::result::Result<f64, String> {
    let number = text.trim_end_matches('%').parse().ok();
    number.filter(|number| (0.0..=100.0).contains(number)).ok_or_else(|| "0 to 100 is needed".to_owned())
}

/// Runs the command.
///
/// # Errors
/// What reading, compiling and loading the module reports; `Expectation` where an entry point
/// traps; `UnsupportedModule` or `InvalidModule` where one does not run; `Finding` where the
/// sanitizer denies what is in the module.
pub fn run(args: SmokeArgs) -> Result<()> {
    let module = module_file::read_or_compile(&args.module, &args.limits.limits(), &args.how.words());
    let module = Arc::new(module.map_err(|error| output::json_error(args.json, error))?);
    if args.budget.is_some() {
        output::renamed_flag("--budget", "--fuel");
    }
    let options = SmokeOptions {
        seed: args.seed,
        fuel: args.budget.unwrap_or(args.fuel),
        total_fuel: args.total_fuel,
        launch_limits: args.launch_limits.limits(LaunchLimits::SMOKE),
        time_limit: args.seconds,
        sanitize: args.sanitize,
    };
    let report = SmokeReport::of(&module, options);
    let verdict = verdict(&report, args.min_coverage.unwrap_or(0.0));
    if args.json {
        let errors = verdict.as_ref().err().map_or_else(Vec::new, ErrorReport::all);
        let json = serde_json::to_string_pretty(&JsonReport { report: &report, errors })
            .map_err(|error| Error::new(ErrorKind::Io, format!("{}: {error}", args.module.display())))?;
        output::print(format_args!("{json}\n"))?;
    } else {
        output::print(report.text())?;
    }
    verdict
}

/// What `--json` prints.
#[derive(Serialize)]
struct JsonReport<'a> {
    #[serde(flatten)]
    report: &'a SmokeReport,
    /// What the exit code tells of.
    errors: Vec<ErrorReport>,
}

/// The worst verdict as an error, for the exit code.
fn verdict(report: &SmokeReport, min_coverage: f64) -> Result<()> {
    let worst = report.worst();
    let kind = match worst {
        SmokeVerdict::Ok | SmokeVerdict::OutOfScope => {
            report.entry_points.iter().try_for_each(|entry| deny(&entry.findings))?;
            return covered(report, min_coverage);
        }
        SmokeVerdict::Trap => ErrorKind::Expectation,
        SmokeVerdict::Unsupported | SmokeVerdict::Bug => ErrorKind::UnsupportedModule,
        SmokeVerdict::Invalid => ErrorKind::InvalidModule,
    };
    let entries = &report.entry_points;
    let count = |verdict| entries.iter().filter(|entry| entry.result == verdict).count();
    let verdicts = [
        (SmokeVerdict::Trap, "trapped"),
        (SmokeVerdict::Unsupported, "not supported"),
        (SmokeVerdict::Invalid, "invalid"),
        (SmokeVerdict::Bug, "met a bug in anyhit"),
    ];
    let counts = verdicts.map(|(verdict, word)| (count(verdict), word));
    let parts: Vec<_> = counts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, word)| format!("{count} {word}"))
        .collect();
    Err(Error::new(kind, format!("of {} entry points, {}", entries.len(), parts.join(", "))))
}

/// Whether every entry point entered enough of its blocks.
fn covered(report: &SmokeReport, percent: f64) -> Result<()> {
    let reached = report.entry_points.iter().filter_map(|entry| Some((entry, entry.coverage.as_ref()?)));
    let too_few: Vec<_> = reached.filter(|(_, reached)| !reached.is_at_least(percent)).collect();
    if too_few.is_empty() {
        return Ok(());
    }
    let count = report.entry_points.len();
    let message =
        format!("of {count} entry points, {} reached less than {percent} % of its blocks", too_few.len());
    let error = Error::new(ErrorKind::Expectation, message);
    Err(too_few.iter().fold(error, |error, (entry, reached)| {
        let share = format!("{} of {} blocks", reached.blocks_entered, reached.blocks);
        error.note(format!("{} `{}` reached {share}", entry.stage, entry.name))
    }))
}
