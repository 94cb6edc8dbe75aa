//! `anyhit smoke`: runs every entry point of modules on made-up inputs.

pub(super) mod modules;
mod verdict;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;

use crate::cli::input::{InputLimitArgs, StrictArgs};
use crate::cli::limits::LaunchLimitArgs;
use crate::cli::sanitize::write_json;
use crate::cli::share::ShareArgs;
use crate::cli::smoke::modules::ModulesToRun;
use crate::cli::smoke::verdict::{JsonReport, verdict};
use crate::cli::source::SourceArgs;
use crate::cli::{module_file, numbers, output};
use anyhit_base::error::{Error, ErrorKind, ErrorReport, Result};
use anyhit_base::escape;
use anyhit_base::progress::Work;
use anyhit_cases::smoke::{SmokeOptions, SmokeReport};
use anyhit_cases::source_tree::SourceTree;
use anyhit_cases::suite::findings_sarif;
use anyhit_engine::machine::LaunchLimits;
use anyhit_sanitize::FindingRecord;

/// Run every ray-tracing and compute entry point of a module on synthetic inputs.
///
/// Buffers, images, samplers, push constants, shader records, payloads, device addresses and
/// acceleration structures are generated from the module's declarations: integers 0 to 3, floats in
/// [0, 1), identity matrices. New sets of values are generated until every basic block was entered
/// or new sets enter no further block. A trap, or coverage below --min-coverage, counts as a failed
/// expectation. With several modules, the exit code is the worst of them.
#[derive(Args, Clone, Debug)]
pub(super) struct SmokeArgs {
    /// SPIR-V module or shader source (GLSL, WGSL, Slang, HLSL), or `-` for standard input; of
    /// several modules, and of folders, which are searched for `.spv`, one line each is printed
    #[arg(value_name = "MODULE", required = true)]
    modules: Vec<PathBuf>,
    #[command(flatten)]
    how: SourceArgs,
    #[command(flatten)]
    limits: InputLimitArgs,
    #[command(flatten)]
    strict: StrictArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Seed of all synthetic values
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Maximum number of instructions per invocation, checked at back edges, calls and stops
    #[arg(long, value_name = "N", default_value_t = SmokeOptions::default().fuel, value_parser = numbers::from_one)]
    fuel: u64,
    /// Operations, counted once per batch, that all runs of an entry point may execute before no
    /// further set of values is generated
    #[arg(long, value_name = "N", default_value_t = SmokeOptions::default().total_fuel, value_parser = numbers::from_one)]
    total_fuel: u64,
    /// Seconds after which no further set of values is generated; the report then depends on the
    /// machine
    #[arg(long, value_name = "SECONDS", value_parser = numbers::seconds)]
    seconds: Option<Duration>,
    /// Also run every set of values under the sanitizer: a finding that depends on a synthetic
    /// input is a warning, any other is denied
    #[arg(long)]
    sanitize: bool,
    /// With --sanitize: also write the findings to this file (`-` for standard output) as SARIF
    /// 2.1.0, for code scanning
    #[arg(long, value_name = "FILE", requires = "sanitize")]
    sarif: Option<PathBuf>,
    /// With --sanitize: also write the findings to this file (`-` for standard output) as a JSON
    /// array
    #[arg(long, value_name = "FILE", requires = "sanitize")]
    findings_json: Option<PathBuf>,
    /// Fail if an entry point enters less than this percentage of its basic blocks
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    min_coverage: Option<f64>,
    /// With several modules: run N in parallel [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,

    #[command(flatten)]
    share: ShareArgs,

    #[command(flatten)]
    launch_limits: LaunchLimitArgs,
}

fn percent(text: &str) -> std::result::Result<f64, String> {
    let number = text.trim_end_matches('%').parse().ok();
    number
        .filter(|number| (0.0..=100.0).contains(number))
        .ok_or_else(|| "expected a number from 0 to 100".to_owned())
}

/// Runs the command.
///
/// # Errors
/// What reading, compiling and loading the module reports; `Expectation` where an entry point
/// traps; `UnsupportedModule` or `InvalidModule` where one does not run; `Finding` where the
/// sanitizer denies what is in the module. Of several modules the worst.
pub(super) fn run(args: SmokeArgs) -> Result<()> {
    if args.json {
        output::claim_stdout("--json")?;
    }
    let files = FindingFiles { sarif: args.sarif.clone(), json: args.findings_json.clone() };
    files.claim_stdout()?;
    let options = SmokeOptions {
        seed: args.seed,
        fuel: args.fuel,
        total_fuel: args.total_fuel,
        launch_limits: args.launch_limits.limits(LaunchLimits::SMOKE),
        time_limit: args.seconds,
        sanitize: args.sanitize,
    };
    let (limits, words, min_coverage) =
        (args.limits.limits(), args.how.words(), args.min_coverage.unwrap_or(0.0));
    let strict = args.strict.is_set();
    let several = match &args.modules[..] {
        [path] => args.share.is_requested() || path.is_dir(),
        _ => true,
    };
    if several {
        let many = ModulesToRun {
            limits,
            words,
            options,
            min_coverage,
            jobs: args.jobs.map_or(0, usize::from),
            files,
            strict,
        };
        return many.run(&args.modules, &args.share, args.json);
    }
    let path = &args.modules[0];
    let module = module_file::read_or_compile(path, &limits, &words)
        .and_then(|module| module_file::check_declarations(path, module, strict));
    let module = Arc::new(module.map_err(|error| output::json_error(args.json, error))?);
    let work = Work::new("running entry points");
    let report = SmokeReport::of(&module, options);
    drop(work);
    let verdict = verdict(&report, min_coverage);
    files.write(&findings_of(&report, path))?;
    if args.json {
        let errors = verdict.as_ref().err().map_or_else(Vec::new, ErrorReport::all);
        let json = serde_json::to_string_pretty(&JsonReport { report: &report, errors })
            .map_err(|error| Error::new(ErrorKind::Io, format!("{}: {error}", escape::path(&path))))?;
        output::print_data(format_args!("{json}\n"))?;
    } else {
        output::print(report.text())?;
    }
    verdict
}

/// The findings of all entry points of a module.
fn findings_of(report: &SmokeReport, module: &Path) -> Vec<FindingRecord> {
    let name = escape::path(&module).to_string();
    let found = report.entry_points.iter().flat_map(|entry| entry.findings.records());
    let found = found.map(|finding| FindingRecord { module: Some(name.clone()), ..finding });
    SourceTree::of_repository().place(found.collect(), module)
}

/// The files that findings are written to.
struct FindingFiles {
    sarif: Option<PathBuf>,
    json: Option<PathBuf>,
}

impl FindingFiles {
    /// Keeps standard output for the file that is written there.
    fn claim_stdout(&self) -> Result<()> {
        let files = [("--sarif -", &self.sarif), ("--findings-json -", &self.json)];
        output::claim_stdout_for(files.map(|(flag, file)| (flag, file.as_deref())))
    }

    fn write(&self, findings: &[FindingRecord]) -> Result<()> {
        if let Some(file) = &self.sarif {
            output::write_data(file, &findings_sarif(findings))?;
        }
        self.json.as_ref().map_or(Ok(()), |file| write_json(file, findings))
    }
}
