//! `anyhit test`: runs the test cases of folders and files.

use std::io::stdout;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::cli::input::SceneFileArgs;
use crate::cli::limits::LimitArgs;
use crate::cli::many_seeds::ManySeedsArgs;
use crate::cli::output;
use crate::cli::sanitize::SanitizeArgs;
use crate::cli::share::ShareArgs;
use crate::cli::stability::StabilityArgs;
use crate::cli::suite_report::{
    ReportFormat, SuiteFiles, check_formats, claim_stdout, print_end, print_test, records_of, verdict,
};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::{InputLimit, InputLimits, RootFolder, read_argument};
use anyhit_base::progress::Work;
use anyhit_base::{atomic_file, escape};
use anyhit_cases::init;
use anyhit_cases::shares::{Shard, ShareResults, Timings, fingerprint};
use anyhit_cases::source_tree::SourceTree;
use anyhit_cases::suite::{EXPLAINED_LINES, Suite, SuiteOptions, SuiteResult, SuiteWhole, report};
use anyhit_debugger::shell;
use anyhit_engine::machine::LaunchLimits;
use anyhit_sanitize::formats;
use anyhit_scene::SceneFiles;

/// Run test cases: scenes with `[expect]` and `*.test.toml` files of rays.
///
/// The exit code is that of the most severe failure: from most to least severe 2 (a test could not
/// run), 5 (a limit was exceeded), 4 (not supported), 6 (a denied finding), 3 (a shader trapped),
/// 1 (an expectation failed).
#[derive(Debug, clap::Args)]
#[command(mut_arg("sarif", |_| sarif_arg()))]
pub(super) struct TestArgs {
    /// Scene files, and folders, which are searched for `scene.toml` and `*.test.toml`
    #[arg(value_name = "PATH", default_value = ".")]
    paths: Vec<PathBuf>,
    /// Run the tests whose names contain TEXT; may be repeated to match any of several texts
    #[arg(long, value_name = "TEXT")]
    filter: Vec<String>,
    /// Print the names of the tests without running them; with `--format json` also their files and
    /// lines
    #[arg(long)]
    list: bool,
    /// Update recorded values and renderings; derived values, which have `because`, are kept
    #[arg(long)]
    bless: bool,
    /// Stop after the first test that does not pass
    #[arg(long)]
    fail_fast: bool,
    /// Run N cases in parallel [default: one per processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Balance the run times of --shard, from a file that --write-timings wrote
    #[arg(long, value_name = "FILE")]
    timings: Option<PathBuf>,
    /// Write the rounded run time of each test, for --timings
    #[arg(long, value_name = "FILE")]
    write_timings: Option<PathBuf>,
    /// Run launches with 1, 64 and 128 lanes and compare the results, which must be identical
    #[arg(long)]
    all_widths: bool,
    /// Also run every test without the optimizer; results must be bit-identical
    #[arg(long)]
    check_optimizer: bool,
    /// Format of the printed results
    #[arg(long, value_enum, default_value_t, help_heading = "Reports")]
    format: ReportFormat,
    /// Also write the results as JUnit XML
    #[arg(long, value_name = "FILE", help_heading = "Reports")]
    junit: Option<PathBuf>,
    /// With --junit: omit run times, which differ from run to run
    #[arg(long, requires = "junit", help_heading = "Reports")]
    no_times: bool,
    /// Also write a short report as Markdown, for the page of a workflow
    #[arg(long, value_name = "FILE", help_heading = "Reports")]
    summary: Option<PathBuf>,
    /// Write line and branch coverage of the shaders, and print a summary: an lcov tracefile, or
    /// Cobertura XML if FILE ends in .xml
    #[arg(long, value_name = "FILE", help_heading = "Reports")]
    coverage: Option<PathBuf>,
    #[command(flatten)]
    files: SceneFileArgs,
    /// Folder for pictures that differ [default: a folder in the system's temporary folder]
    #[arg(long, value_name = "DIR", help_heading = "Reports")]
    pictures: Option<PathBuf>,
    /// Omit the explanations of rays and invocations from failures
    #[arg(long, help_heading = "Reports")]
    no_explanation: bool,
    /// In explanations, show at most the last N lines that each any-hit or intersection shader
    /// executed
    #[arg(long, value_name = "N", default_value_t = EXPLAINED_LINES, help_heading = "Reports")]
    explain_lines: usize,
    /// Write a first case for modules: PATH... are the module files, followed by the folder to
    /// create
    #[arg(long, conflicts_with_all = ["filter", "list", "bless", "shard", "result", "junit", "coverage", "summary"])]
    init: bool,

    #[command(flatten)]
    stability: StabilityArgs,

    #[command(flatten)]
    sanitize: SanitizeArgs,

    #[command(flatten)]
    many_seeds: ManySeedsArgs,

    #[command(flatten)]
    share: ShareArgs,

    #[command(flatten)]
    limits: LimitArgs,
}

/// `--sarif`, which needs no sanitizer here: failed tests are results, too.
fn sarif_arg() -> clap::Arg {
    clap::Arg::new("sarif")
        .long("sarif")
        .value_name("FILE")
        .value_parser(clap::value_parser!(PathBuf))
        .help("Also write failed tests and findings to this file (`-` for standard output) as SARIF 2.1.0")
}

/// Runs the command.
///
/// # Errors
/// `Expectation` where tests fail, another kind where one could not run; their reports are printed
/// before.
pub(super) fn run(args: TestArgs) -> Result<()> {
    if args.init {
        return init_case(&args);
    }
    check_formats(args.format, args.sanitize.format())?;
    args.sanitize.claim_stdout_for_files()?;
    claim_stdout(args.format, args.sanitize.format(), args.junit.as_deref(), args.coverage.as_deref())?;
    let root = args.files.root()?;
    let (limits, strict, read_all) = (args.files.limits(), args.files.strict(), args.files.read_all());
    let shard = args.shard()?;
    let timings = args.timings.as_deref().map(|path| read_timings(path, &limits)).transpose()?;
    let mut suite = Suite::find_within(&args.paths, &|file, tree| {
        let root = root.clone().map_or_else(|| RootFolder::of_test(file, tree), Ok)?;
        Ok(SceneFiles { limits, root: Some(root), strict, read_all })
    })?;
    let found = suite.tests().len();
    suite.filter(&args.filter);
    if suite.tests().is_empty() {
        return Err(no_tests(&args, found));
    }
    let known = args.sanitize.known()?;
    let whole = whole(&args, &suite, timings.as_ref(), known.as_deref())?;
    if let Some(shard) = shard {
        suite.shard(shard, timings.as_ref());
    }
    if args.list {
        return list(&suite, args.format);
    }
    let result = execute(&args, &suite, known)?;
    let results = ShareResults::new(whole, shard.unwrap_or(Shard::WHOLE), result);
    let files = SuiteFiles {
        junit: args.junit.as_deref(),
        coverage: args.coverage.as_deref(),
        sarif: args.sanitize.sarif(),
        findings_json: args.sanitize.findings_json(),
        summary: args.summary.as_deref(),
        timings: args.write_timings.as_deref(),
        with_times: !args.no_times,
    };
    let result = SuiteResult::of_shares(&results);
    // A file that cannot be written keeps nobody from the others, and from what is printed.
    let mut unwritten = files.write(&result);
    unwritten.extend(args.share.write(&results).err());
    if let Some(path) = args.sanitize.baseline_to_write() {
        let baseline = formats::baseline(&records_of(&result.findings()));
        unwritten.extend(atomic_file::write(path, baseline).err());
    }
    print_end(results.whole(), &result, args.format, args.sanitize.format())?;
    if unwritten.is_empty() { verdict(&result) } else { Err(Error::several(unwritten)) }
}

/// Prints the tests of a suite.
fn list(suite: &Suite, format: ReportFormat) -> Result<()> {
    if format != ReportFormat::Json {
        let names: String = suite.tests().iter().map(|test| format!("{}\n", test.name)).collect();
        return output::print(names);
    }
    let tests = suite.tests().iter().map(|test| {
        let (file, line) = suite.place_of(test);
        json!({ "name": test.name, "file": escape::path(&file).to_string(), "line": line })
    });
    let tests: Vec<Value> = tests.collect();
    output::print_data(format_args!("{:#}\n", json!({ "version": report::VERSION, "tests": tests })))
}

impl TestArgs {
    /// The share that is wanted: by the flag, or else by the variables of Bazel.
    fn shard(&self) -> Result<Option<Shard>> {
        match self.share.shard() {
            Some(shard) => Ok(Some(shard)),
            None => bazel_shard(),
        }
    }
}

/// The share that the variables of Bazel want. The file that they name is written, which says
/// that they were heeded.
fn bazel_shard() -> Result<Option<Shard>> {
    let Some(of) = std::env::var_os("TEST_TOTAL_SHARDS") else { return Ok(None) };
    let index = std::env::var_os("TEST_SHARD_INDEX").unwrap_or_default();
    let number = |text: &std::ffi::OsStr| text.to_str().and_then(|text| text.parse::<usize>().ok());
    let shard = match (number(&index), number(&of)) {
        (Some(index), Some(of)) if index < of && of <= Shard::MOST => Shard { number: index + 1, of },
        _ => {
            let message = format!(
                "TEST_SHARD_INDEX is `{}` and TEST_TOTAL_SHARDS is `{}`: expected an index below the total",
                escape::path(&index),
                escape::path(&of)
            );
            return Err(Error::new(ErrorKind::InvalidArgument, message));
        }
    };
    if let Some(file) = std::env::var_os("TEST_SHARD_STATUS_FILE").filter(|file| !file.is_empty()) {
        atomic_file::write(Path::new(&file), "")?;
    }
    Ok(Some(shard))
}

fn read_timings(path: &Path, limits: &InputLimits) -> Result<Timings> {
    Timings::read(path, &read_argument(path, InputLimit::FileBytes, limits)?)
}

/// What shares of the suite have in common.
fn whole(
    args: &TestArgs,
    suite: &Suite,
    timings: Option<&Timings>,
    known: Option<&str>,
) -> Result<SuiteWhole> {
    let given = [
        (args.all_widths, "--all-widths"),
        (args.check_optimizer, "--check-optimizer"),
        (args.bless, "--bless"),
        (args.fail_fast, "--fail-fast"),
        (args.no_explanation, "--no-explanation"),
    ];
    let mut options: Vec<String> =
        given.iter().filter(|(given, _)| *given).map(|(_, flag)| (*flag).to_owned()).collect();
    let perturbation = args.stability.perturbation(args.many_seeds.perturbed_runs())?;
    if let Some(perturbation) = &perturbation {
        options.push(format!("--tolerance {}", perturbation.tolerance));
    }
    if args.explain_lines != EXPLAINED_LINES {
        options.push(format!("--explain-lines {}", args.explain_lines));
    }
    let limits = format!("{:?}", args.limits.limits(LaunchLimits::TESTS));
    options.push(format!("limits {}", fingerprint([limits.as_str()].into_iter())));
    if let Some(known) = known {
        options.push(format!("--baseline {}", fingerprint([known].into_iter())));
    }
    let many_seeds = args.many_seeds.given(&args.sanitize, &args.stability)?;
    Ok(SuiteWhole {
        tests: suite.tests().len(),
        names: fingerprint(suite.tests().iter().map(|test| test.name.as_str())),
        coverage: args.coverage.is_some(),
        shadow: args.stability.shadow(),
        perturbed: perturbation.map(|perturbation| perturbation.describe()),
        sanitize: (args.sanitize.is_requested() || many_seeds.is_some()).then(|| {
            let runs = if args.sanitize.is_requested() { "--sanitize" } else { "" };
            format!("{runs} {}", args.sanitize.level_flags()).trim().to_owned()
        }),
        many_seeds: many_seeds.map(|drawn| {
            let Range { start, end } = drawn.seeds;
            format!("{start}..{end}, {:?}", drawn.floats)
        }),
        options,
        timings: timings.map(|timings| fingerprint([timings.to_json().as_str()].into_iter())),
    })
}

fn execute(args: &TestArgs, suite: &Suite, known: Option<String>) -> Result<SuiteResult> {
    let colour = args.format == ReportFormat::Plain && output::is_coloured(&stdout());
    let options = SuiteOptions {
        jobs: args.jobs.map_or(0, usize::from),
        all_widths: args.all_widths,
        check_optimizer: args.check_optimizer,
        bless: args.bless,
        fail_fast: args.fail_fast,
        coverage: args.coverage.is_some(),
        shadow: args.stability.shadow(),
        perturb: args.stability.perturbation(args.many_seeds.perturbed_runs())?,
        sanitize: args.sanitize.is_requested().then(|| args.sanitize.given_levels()).transpose()?,
        many_seeds: args.many_seeds.given(&args.sanitize, &args.stability)?,
        known,
        becomes_baseline: args.sanitize.baseline_to_write().is_some(),
        no_explanation: args.no_explanation,
        explained_lines: args.explain_lines,
        colour,
        limits: args.limits.limits(LaunchLimits::TESTS),
        pictures: args.pictures.clone().unwrap_or_else(|| std::env::temp_dir().join("anyhit-test")),
        repository: SourceTree::of_repository(),
    };
    let work = Work::counted("testing", suite.tests().len() as u64);
    suite.run(&options, &mut |finished, test| {
        work.advance(1);
        match colour {
            true => output::print(report::text(finished, true)),
            false => print_test(test, args.format),
        }
    })
}

fn no_tests(args: &TestArgs, found: usize) -> Error {
    let paths: Vec<String> = args.paths.iter().map(|path| escape::path(&path).to_string()).collect();
    let message = match found {
        0 => format!("no tests in {}", paths.join(", ")),
        found => format!("no name of the {found} tests contains \"{}\"", args.filter.join("\" or \"")),
    };
    let error = Error::new(ErrorKind::InvalidArgument, message);
    match found {
        0 => error
            .note("a test is a `scene.toml`, or a ray with `[ray.expect]` in a `*.test.toml`")
            .note("`anyhit test --init MODULE... DIR` writes a first test for compiled shaders"),
        _ => error.note("`anyhit test --list` prints all names"),
    }
}

/// `--init`
fn init_case(args: &TestArgs) -> Result<()> {
    let paths = &args.paths[..];
    let is_module = |path: &&PathBuf| path.is_file();
    let modules: Vec<PathBuf> = paths.iter().take_while(is_module).cloned().collect();
    let folder = match &paths[modules.len()..] {
        [] => modules.first().and_then(|module| module.parent()).map(|parent| parent.join("case")),
        [folder] => Some(folder.clone()),
        // The folder stands before a module.
        [folder, rest @ ..] if rest.iter().any(|path| path.is_file()) => {
            let files = modules.iter().chain(rest.iter().filter(|path| path.is_file()));
            let words = files.chain([folder]).map(|path| shell::word(&path.to_string_lossy()));
            let message = format!("`{}` is not a module", escape::path(folder));
            let command = format!("anyhit test --init {}", words.collect::<Vec<_>>().join(" "));
            return Err(Error::new(ErrorKind::InvalidArgument, message)
                .note(format!("the last argument is the folder to create; did you mean `{command}`?")));
        }
        [missing, ..] => {
            let error = std::io::Error::from(std::io::ErrorKind::NotFound);
            return Err(Error::io(missing, error));
        }
    };
    let (Some(folder), false) = (folder, modules.is_empty()) else {
        let message = "`--init` requires a module: `anyhit test --init shader.rchit.spv my-case`";
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    };
    let (files, limits) = (args.files.files()?, args.limits.limits(LaunchLimits::TESTS));
    let written = init::case(&modules, &folder, &files, &limits)?;
    let (path, folder) = (escape::path(&written.path), shell::word(&folder.to_string_lossy()));
    let Some(failure) = written.failure else {
        return output::print(format_args!(
            "{path}: written; its values are recorded from a first run, so it passes\nrun it: anyhit test {folder}\n"
        ));
    };
    let zeros: String = written.zeros.iter().map(|one| format!("  {one}\n")).collect();
    let fill = if zeros.is_empty() { String::new() } else { format!("replace the zeros in:\n{zeros}") };
    output::print(format_args!(
        "{path}: written; it does not pass yet: {}\n{fill}then run it: anyhit test {folder}\n",
        failure.message()
    ))
}
