//! `anyhit merge`: makes one report of the results of shares.

use std::path::{Path, PathBuf};

#[cfg(feature = "stress")]
use crate::cli::check_math;
use crate::cli::input::InputLimitArgs;
use crate::cli::output;
use crate::cli::sanitize::FindingFormat;
use crate::cli::smoke::modules;
#[cfg(feature = "stress")]
use crate::cli::stress;
use crate::cli::suite_report::{
    ReportFormat, SuiteFiles, check_formats, claim_stdout, print_end, print_test, verdict,
};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::{InputLimit, InputLimits, read_argument};
use anyhit_base::{atomic_file, escape};
#[cfg(feature = "stress")]
use anyhit_cases::shares::check_math::CheckMathResult;
use anyhit_cases::shares::render::RenderResult;
use anyhit_cases::shares::smoke::SmokeResult;
#[cfg(feature = "stress")]
use anyhit_cases::shares::stress::StressResult;
use anyhit_cases::shares::{ShareResult, ShareResults, command_of};
use anyhit_cases::suite::SuiteResult;
use anyhit_scene::image::{PictureKind, PixelEncoding, write_picture};

/// Merge the results that `--result` wrote on several machines into one report.
///
/// Except for times, the report and the exit code are those of an undivided run. The order of the
/// files does not matter, and a merged result (--result) can be merged again.
#[derive(Debug, clap::Args)]
pub(super) struct MergeArgs {
    /// Results of the shards of one `test`, `stress`, `check-math`, `smoke` or `render` run
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Merge although shards are missing, and report which
    #[arg(long)]
    partial: bool,
    /// Format of the printed report
    #[arg(long, value_enum, default_value_t)]
    format: ReportFormat,
    /// For tests: format of the sanitizer's printed findings
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    findings: FindingFormat,
    /// Write the merged result as JSON
    #[arg(long, value_name = "FILE")]
    result: Option<PathBuf>,
    /// For tests: also write failed tests and findings as SARIF 2.1.0
    #[arg(long, value_name = "FILE")]
    sarif: Option<PathBuf>,
    /// For tests: also write the findings as a JSON array
    #[arg(long, value_name = "FILE")]
    findings_json: Option<PathBuf>,
    /// For tests: write the results as JUnit XML, without times
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// For tests: write the coverage as an lcov tracefile, or as Cobertura XML if FILE ends in
    /// .xml, and print a summary
    #[arg(long, value_name = "FILE")]
    coverage: Option<PathBuf>,
    /// For tests: write a short report as Markdown
    #[arg(long, value_name = "FILE")]
    summary: Option<PathBuf>,
    /// For tests: write the rounded run time of each, for `--timings` of `anyhit test`
    #[arg(long, value_name = "FILE")]
    timings: Option<PathBuf>,
    /// For `render`: file to write, .png, .exr (feature `exr`) or .raw [default: out.png]
    #[arg(short, long, value_name = "FILE", value_parser = output::picture_parser())]
    output: Option<PathBuf>,
    /// For `stress`: folder in which wrong cases are saved
    #[arg(long, value_name = "FOLDER", default_value = "tests/stress-regressions")]
    save: PathBuf,
    #[command(flatten)]
    limits: InputLimitArgs,
}

/// Runs the command.
///
/// # Errors
/// `InvalidArgument` where files are no results, or not of one run, or shares are missing; else
/// what the command returns whose results are merged.
pub(super) fn run(args: MergeArgs) -> Result<()> {
    let limits = args.limits.limits();
    let first = &args.files[0];
    let bytes = read(first, &limits)?;
    let command = command_of(first, &bytes)?;
    args.check(&command)?;
    check_formats(args.format, args.findings)?;
    let findings =
        [("--sarif -", args.sarif.as_deref()), ("--findings-json -", args.findings_json.as_deref())];
    output::claim_stdout_for(findings)?;
    if command == SuiteResult::COMMAND {
        claim_stdout(args.format, args.findings, args.junit.as_deref(), args.coverage.as_deref())?;
    }
    let files = FilesToMerge { args: &args, first: &bytes, limits: &limits };
    match command.as_str() {
        SuiteResult::COMMAND => args.print_suite(&files.merged()?),
        SmokeResult::COMMAND => modules::print_merged(&files.merged()?, args.format == ReportFormat::Json),
        RenderResult::COMMAND => args.write_picture(&files.merged()?),
        #[cfg(feature = "stress")]
        StressResult::COMMAND => stress::print_merged(&files.merged()?, &args.save),
        #[cfg(feature = "stress")]
        CheckMathResult::COMMAND => {
            check_math::print_merged(&files.merged()?, args.format == ReportFormat::Json)
        }
        other => {
            let message = format!("a result of `anyhit {other}`, a command that this build lacks");
            Err(Error::new(ErrorKind::UnsupportedTool, message).at(Place::File(first.clone())))
        }
    }
}

fn read(file: &Path, limits: &InputLimits) -> Result<Vec<u8>> {
    read_argument(file, InputLimit::FileBytes, limits)
}

impl MergeArgs {
    /// Refuses flags that say nothing of a command's results.
    fn check(&self, command: &str) -> Result<()> {
        let of_tests = [
            (self.junit.is_some(), "--junit"),
            (self.coverage.is_some(), "--coverage"),
            (self.summary.is_some(), "--summary"),
            (self.timings.is_some(), "--timings"),
            (self.sarif.is_some(), "--sarif"),
            (self.findings_json.is_some(), "--findings-json"),
            (self.findings != FindingFormat::Text, "--findings"),
        ];
        let of_pictures = [(self.output.is_some(), "--output")];
        let wrong = |flags: &[(bool, &'static str)], of: &str| {
            let given = flags.iter().find(|(given, _)| *given && command != of);
            given.map(|(_, flag)| {
                format!(
                    "`{flag}` applies to results of `anyhit {of}`; these are results of `anyhit {command}`"
                )
            })
        };
        let of_format = [
            (self.format == ReportFormat::Github, "--format github"),
            (self.format == ReportFormat::Gitlab, "--format gitlab"),
        ];
        let without_json = [RenderResult::COMMAND, "stress"].contains(&command);
        let json = (self.format == ReportFormat::Json && without_json)
            .then(|| format!("`anyhit {command}` has no JSON report"));
        let mistake = wrong(&of_tests, SuiteResult::COMMAND)
            .or_else(|| wrong(&of_pictures, RenderResult::COMMAND))
            .or_else(|| wrong(&of_format, SuiteResult::COMMAND))
            .or(json);
        mistake.map_or(Ok(()), |message| Err(Error::new(ErrorKind::InvalidArgument, message)))
    }

    /// The reports of a suite.
    fn print_suite(&self, results: &ShareResults<SuiteResult>) -> Result<()> {
        if self.coverage.is_some() && !results.whole().coverage {
            let message = "the shards recorded no coverage";
            return Err(Error::new(ErrorKind::InvalidArgument, message)
                .note("help: run the shards with `--coverage`, too"));
        }
        SuiteResult::check_shares(results)?;
        let result = SuiteResult::of_shares(results);
        let files = SuiteFiles {
            junit: self.junit.as_deref(),
            coverage: self.coverage.as_deref(),
            sarif: self.sarif.as_deref(),
            findings_json: self.findings_json.as_deref(),
            summary: self.summary.as_deref(),
            timings: self.timings.as_deref(),
            with_times: false,
        };
        let unwritten = files.write(&result);
        result.tests.iter().try_for_each(|test| print_test(test, self.format))?;
        print_end(results.whole(), &result, self.format, self.findings)?;
        if unwritten.is_empty() { verdict(&result) } else { Err(Error::several(unwritten)) }
    }

    /// The picture of all shards.
    fn write_picture(&self, results: &ShareResults<RenderResult>) -> Result<()> {
        if self.output.is_none() && self.result.is_some() {
            return Ok(());
        }
        let file = self.output.clone().unwrap_or_else(|| PathBuf::from("out.png"));
        PictureKind::of(&file).map_or(Ok(()), PictureKind::check)?;
        let picture = RenderResult::picture(results)?;
        let whole = results.whole();
        let encoding = PixelEncoding { to_srgb: whole.to_srgb, keep_alpha: whole.keep_alpha };
        write_picture(&file, &picture, encoding)?;
        if self.output.is_none() {
            output::hint(format_args!("the picture is in {}", escape::path(&file)));
        }
        Ok(())
    }
}

/// The files of the command line, of which the first is read already.
struct FilesToMerge<'a> {
    args: &'a MergeArgs,
    first: &'a [u8],
    limits: &'a InputLimits,
}

impl FilesToMerge<'_> {
    /// The results of all files, and writes them where that is asked for.
    fn merged<R: ShareResult>(&self) -> Result<ShareResults<R>> {
        let args = self.args;
        let mut merged = ShareResults::read(&args.files[0], self.first)?;
        for file in &args.files[1..] {
            merged = merged.merge(ShareResults::read(file, &read(file, self.limits)?)?)?;
        }
        let missing = merged.missing();
        if !missing.is_empty() {
            let text = missing_shares(&missing, merged.of());
            if !args.partial {
                let note = "help: pass `--partial` to merge the others";
                return Err(Error::new(ErrorKind::InvalidArgument, text).note(note));
            }
            output::hint(format_args!("note: {text}: the report covers only the others"));
        }
        if let Some(path) = &args.result {
            atomic_file::write(path, merged.to_json()?)?;
        }
        Ok(merged)
    }
}

/// `shards 2, 5 to 8 and 11 of 12 are missing`
fn missing_shares(missing: &[usize], of: usize) -> String {
    if let [one] = missing {
        return format!("shard {one} of {of} is missing");
    }
    let runs = missing.chunk_by(|one, next| one + 1 == *next).map(|run| match run {
        [one] => one.to_string(),
        [first, .., last] => format!("{first} to {last}"),
        [] => String::new(),
    });
    let runs: Vec<String> = runs.collect();
    let list = match &runs[..] {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        runs => runs.concat(),
    };
    format!("shards {list} of {of} are missing")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_shares_are_listed() {
        for (missing, told) in [
            (&[2][..], "shard 2 of 12 is missing"),
            (&[2, 4], "shards 2 and 4 of 12 are missing"),
            (&[3, 4], "shards 3 to 4 of 12 are missing"),
            (&[2, 5, 6, 7, 8, 11], "shards 2, 5 to 8 and 11 of 12 are missing"),
        ] {
            assert_eq!(missing_shares(missing, 12), told);
        }
    }
}
