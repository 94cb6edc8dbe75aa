//! `anyhit test`: runs the test cases of folders and files.

use std::io::{IsTerminal, stdout};
use std::path::PathBuf;

use clap::ValueEnum;

use crate::atomic_file;
use crate::cli::input::SceneFileArgs;
use crate::cli::limits::LimitArgs;
use crate::cli::many_seeds::ManySeedsArgs;
use crate::cli::output;
use crate::cli::sanitize::SanitizeArgs;
use crate::cli::stability::StabilityArgs;
use crate::debug::shell;
use crate::error::{Error, ErrorKind, Result};
use crate::harness::init;
use crate::harness::suite::{Outcome, Shard, Suite, SuiteOptions, SuiteReport, junit, report};
use crate::input::RootFolder;
use crate::machine::LaunchLimits;
use crate::scene::SceneFiles;

/// Runs test cases: scenes with `[expect]` and `*.test.toml` files of rays.
///
/// Exit codes: 0 all pass, 1 an expectation failed, 2 a test could not run or a file that was asked
/// for could not be written.
#[derive(Debug, clap::Args)]
pub struct TestArgs {
    /// Folders (searched for `scene.toml` and `*.test.toml`) and scene files
    #[arg(value_name = "PATH", default_value = ".")]
    paths: Vec<PathBuf>,
    /// Run the tests whose names contain TEXT; if repeated, any of them
    #[arg(long, value_name = "TEXT")]
    filter: Vec<String>,
    /// Print the names of the tests and run none
    #[arg(long)]
    list: bool,
    /// Rewrite recorded values and renderings; values with `because` are derived and stay
    #[arg(long)]
    bless: bool,
    /// Stop after the first test that does not pass
    #[arg(long)]
    fail_fast: bool,
    /// Run N cases in parallel [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Run the Kth of N parts of the tests: all parts together run each test once
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Run launches at 1, 64 and 128 lanes, whose results must be the same
    #[arg(long)]
    all_widths: bool,
    /// Run every test also without the optimizer: results must be the same, bit for bit
    #[arg(long)]
    check_optimizer: bool,
    /// How results are printed
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// Also write the results as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write the coverage of the shaders' lines and branches as an lcov tracefile, and print a
    /// summary
    #[arg(long, value_name = "FILE")]
    coverage: Option<PathBuf>,
    #[command(flatten)]
    files: SceneFileArgs,
    #[command(flatten)]
    stability: StabilityArgs,
    #[command(flatten)]
    sanitize: SanitizeArgs,
    #[command(flatten)]
    many_seeds: ManySeedsArgs,
    #[command(flatten)]
    limits: LimitArgs,
    /// Where pictures that differ are saved [default: a folder among the system's temporary files]
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Leave out the explanations of rays beneath failures
    #[arg(long)]
    no_explanation: bool,
    /// Write a first case for modules: PATH... are their files, and last the folder to make
    #[arg(long, conflicts_with_all = ["filter", "list", "bless", "shard", "junit", "coverage"])]
    init: bool,
}

/// How results are printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Plain text
    #[default]
    Plain,
    /// Text, with an annotation for each failure that GitHub shows at the shader's line
    Github,
    /// One JSON object
    Json,
}

/// Runs the command.
///
/// # Errors
/// `Expectation` where tests fail, another kind where one could not run; their reports are printed
/// before.
pub fn run(args: TestArgs) -> Result<()> {
    if args.init {
        return init_case(&args);
    }
    let root = args.files.root()?;
    let limits = args.files.limits();
    let mut suite = Suite::find_within(&args.paths, &|file, tree| {
        let root = root.clone().map_or_else(|| RootFolder::of_test(file, tree), Ok)?;
        Ok(SceneFiles { limits, root: Some(root) })
    })?;
    let found = suite.tests().len();
    suite.filter(&args.filter);
    if suite.tests().is_empty() {
        return Err(no_tests(&args, found));
    }
    if let Some(shard) = args.shard {
        suite.shard(shard);
    }
    if args.list {
        let names: String = suite.tests().iter().map(|test| format!("{}\n", test.name)).collect();
        return output::print(names);
    }
    let report = execute(&args, &suite)?;
    // A file that cannot be written keeps nobody from the others, and from what is printed.
    let mut unwritten = Vec::new();
    if let Some(path) = &args.junit {
        unwritten.extend(junit(&report).and_then(|text| atomic_file::write(path, text)).err());
    }
    if let Some(path) = &args.coverage {
        unwritten.extend(atomic_file::write(path, report.coverage.lcov()).err());
    }
    match args.format {
        Format::Json => {
            let mut json = report::json(&report, args.coverage.is_some());
            if args.stability.shadow() {
                json["shadow"] = report.shadow.json(None);
            }
            if args.stability.perturbation().is_some() {
                json["perturbed"] = report.perturbed.into();
            }
            if !report.findings.is_empty() {
                json["findings"] = serde_json::to_value(&report.findings).unwrap_or_default();
            }
            output::print(format_args!("{json:#}\n"))?;
        }
        Format::Plain | Format::Github => {
            if args.coverage.is_some() {
                output::print(report::coverage(&report.coverage))?;
            }
            if args.stability.shadow() {
                output::print(format_args!("\n{}\n", report.shadow.text()))?;
            }
            if let Some(perturbation) = args.stability.perturbation() {
                let all = report.finished.len();
                let text = format!(
                    "held to stable outputs: {} of {all} tests, {}",
                    report.perturbed,
                    perturbation.describe()
                );
                output::print(format_args!("\n{text}\n"))?;
            }
            args.sanitize.print_warnings(&report.findings)?;
            output::print(report::summary(&report))?;
        }
    }
    output::notes(&report.notes);
    if unwritten.is_empty() { verdict(&report) } else { Err(Error::several(unwritten)) }
}

fn execute(args: &TestArgs, suite: &Suite) -> Result<SuiteReport> {
    let colour = !output::is_plain() && args.format == Format::Plain && stdout().is_terminal();
    let options = SuiteOptions {
        jobs: args.jobs.map_or(0, usize::from),
        all_widths: args.all_widths,
        check_optimizer: args.check_optimizer,
        bless: args.bless,
        fail_fast: args.fail_fast,
        coverage: args.coverage.is_some(),
        shadow: args.stability.shadow(),
        perturb: args.stability.perturbation(),
        sanitize: args.sanitize.is_requested().then(|| args.sanitize.given_levels()).transpose()?,
        many_seeds: args.many_seeds.given(&args.sanitize)?,
        no_explanation: args.no_explanation,
        colour,
        limits: args.limits.limits(LaunchLimits::TESTS),
        pictures: args.pictures.clone().unwrap_or_else(|| std::env::temp_dir().join("anyhit-test")),
    };
    // Where the runner of GitHub keeps the repository.
    let repository = std::env::var_os("GITHUB_WORKSPACE").map(PathBuf::from);
    suite.run(&options, &mut |finished| match args.format {
        Format::Json => Ok(()),
        Format::Plain => output::print(report::text(finished, colour)),
        Format::Github => {
            let text = report::text(finished, false);
            output::print(format_args!(
                "{}{}",
                report::github_log(&text),
                report::github(finished, repository.as_deref())
            ))
        }
    })
}

/// The error that becomes the exit code; everything about it is printed already.
fn verdict(report: &SuiteReport) -> Result<()> {
    let mut failed = 0;
    for finished in &report.finished {
        match &finished.outcome {
            Outcome::Broken(error) => {
                let message = "a test could not run";
                return Err(Error::new(error.kind(), message).classed_as(error));
            }
            Outcome::Failed(_) => failed += 1,
            _ => {}
        }
    }
    if failed == 0 {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Expectation, format!("{failed} tests failed")))
}

fn no_tests(args: &TestArgs, found: usize) -> Error {
    let paths: Vec<String> = args.paths.iter().map(|path| path.display().to_string()).collect();
    let message = match found {
        0 => format!("no tests in {}", paths.join(", ")),
        found => format!("none of the {found} tests has \"{}\" in its name", args.filter.join("\" or \"")),
    };
    let error = Error::new(ErrorKind::InvalidArgument, message);
    match found {
        0 => error
            .note("a test is a `scene.toml`, or a ray with `[ray.expect]` in a `*.test.toml`")
            .note("`anyhit test --init MODULE... DIR` writes a first one for compiled shaders"),
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
        [missing, ..] => {
            let error = std::io::Error::from(std::io::ErrorKind::NotFound);
            return Err(Error::io(missing, error));
        }
    };
    let (Some(folder), false) = (folder, modules.is_empty()) else {
        let message = "`--init` needs a module: `anyhit test --init shader.rchit.spv my-case`";
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    };
    let (files, limits) = (args.files.files()?, args.limits.limits(LaunchLimits::TESTS));
    let written = init::case(&modules, &folder, &files, &limits)?;
    let (path, folder) = (written.path.display(), shell::word(&folder.display().to_string()));
    let Some(failure) = written.failure else {
        return output::print(format_args!(
            "{path}: written; it passes, because its values are recorded from a first run\nrun it: anyhit test {folder}\n"
        ));
    };
    let zeros: String = written.zeros.iter().map(|one| format!("  {one}\n")).collect();
    let fill = if zeros.is_empty() { String::new() } else { format!("fill in what is zeros:\n{zeros}") };
    output::print(format_args!(
        "{path}: written; it does not pass yet: {}\n{fill}then run it: anyhit test {folder}\n",
        failure.message()
    ))
}
