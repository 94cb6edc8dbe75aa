//! `anyhit check-math`: compares the elementary functions with their correctly rounded results.

use serde_json::Value;

use crate::cli::output;
use crate::cli::share::ShareArgs;
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_cases::shares::ShareResults;
use anyhit_cases::shares::check_math::{CheckMathResult, CheckMathWhole};
use anyhit_stress::check_math::float_width::FloatWidth;
use anyhit_stress::check_math::function::{CheckedFunction, FUNCTIONS};
use anyhit_stress::check_math::{self, CheckMathReport, CheckMathSettings};

/// Compare every elementary function with its correctly rounded result, over all f16 and f32
/// inputs.
///
/// The platform's f64 functions decide nearly all inputs; arbitrary precision decides those near a
/// rounding boundary. Functions of two f32 are checked on pairs, many of them near the edges of
/// their domains. Functions of f64 are checked on a sample in arbitrary precision. The whole
/// comparison takes more than an hour on one core.
#[derive(Debug, clap::Args)]
pub(super) struct CheckMathArgs {
    /// Check only this function, by its name in the specification, such as `Sin`; may be repeated
    #[arg(long, value_name = "NAME", value_parser = function)]
    function: Vec<&'static str>,

    /// Check only floats of this many bits; may be repeated
    #[arg(long, value_name = "BITS", value_parser = clap::builder::PossibleValuesParser::new(["16", "32", "64"]))]
    width: Vec<String>,

    /// Check every Nth f32, and every Nth pair of f16, instead of all
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    stride: u64,

    /// Number of pairs of f32
    #[arg(long, value_name = "N", default_value_t = 1 << 28, value_parser = clap::value_parser!(u64).range(1..))]
    pairs: u64,

    /// Number of f64, or of pairs of f64
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u64).range(1..))]
    samples: u64,

    /// Seed of the pairs, the f64 and the start of a stride
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,

    /// Print no times, so that the output is the same in every run
    #[arg(long)]
    no_times: bool,

    #[command(flatten)]
    share: ShareArgs,
}

/// Runs the command.
///
/// # Errors
/// `Expectation` where a result was wrong.
pub(super) fn run(args: CheckMathArgs) -> Result<()> {
    let settings =
        CheckMathSettings { stride: args.stride, pairs: args.pairs, samples: args.samples, seed: args.seed };
    let form = ReportForm { json: args.json, with_times: !args.no_times };
    let named = |function: &&'static CheckedFunction| {
        args.function.is_empty() || args.function.contains(&function.instruction())
    };
    let is_wanted =
        |format: &FloatWidth| args.width.is_empty() || args.width.contains(&format.width().to_string());
    let formats = FloatWidth::ALL.into_iter().filter(is_wanted);
    let all: Vec<(FloatWidth, &'static CheckedFunction)> = formats
        .flat_map(|format| {
            let functions = FUNCTIONS.iter().filter(named);
            functions.filter(move |one| one.exists(format)).map(move |one| (format, one))
        })
        .collect();
    let whole = CheckMathWhole {
        stride: settings.stride,
        pairs: settings.pairs,
        samples: settings.samples,
        seed: settings.seed,
        functions: all.iter().map(|(format, one)| format!("{} {}", one.name, format.width())).collect(),
    };
    let shard = args.share.shard_or_whole();
    form.print_heading()?;
    let mut result = CheckMathResult::default();
    for (place, (format, function)) in all.into_iter().enumerate().filter(|(place, _)| shard.holds(*place)) {
        let report = check_math::run(function, format, &settings);
        form.print_line(&report)?;
        result.functions.push((place, report));
    }
    let results = ShareResults::new(whole, shard, result);
    args.share.write(&results)?;
    form.print_end(&CheckMathResult::of_shares(&results))
}

/// The report of merged shares, but for times.
///
/// # Errors
/// As [`run`].
pub(super) fn print_merged(results: &ShareResults<CheckMathResult>, json: bool) -> Result<()> {
    let form = ReportForm { json, with_times: false };
    let result = CheckMathResult::of_shares(results);
    form.print_heading()?;
    result.reports().try_for_each(|report| form.print_line(report))?;
    form.print_end(&result)
}

/// How reports are printed.
#[derive(Clone, Copy)]
struct ReportForm {
    json: bool,
    with_times: bool,
}

impl ReportForm {
    fn print_heading(self) -> Result<()> {
        if self.json {
            return Ok(());
        }
        let time = if self.with_times { format!(" {:>9}", "s") } else { String::new() };
        let [function, width, inputs, precise, wrong] = ["function", "width", "inputs", "precise", "wrong"];
        output::print(format_args!(
            "{function:<14} {width:>5} {inputs:>13} {precise:>13} {wrong:>8}{time}  inputs\n"
        ))
    }

    fn print_line(self, report: &CheckMathReport) -> Result<()> {
        if self.json {
            return Ok(());
        }
        let CheckMathReport { function, width, inputs, precise, wrong, which, .. } = report;
        let [inputs, precise, wrong] = [inputs, precise, wrong].map(grouped);
        let time = match self.with_times {
            true => format!(" {:>9.1}", report.time.as_secs_f64()),
            false => String::new(),
        };
        let mut out =
            format!("{function:<14} {width:>5} {inputs:>13} {precise:>13} {wrong:>8}{time}  {which}");
        if let Some(error) = report.greatest_error {
            out += &format!(", at most {error:.3} ulp");
        }
        for wrong in &report.examples {
            out += &format!("\n  of {:#x?} {:#x}, expected {}", wrong.operands, wrong.found, wrong.right);
        }
        output::print(format_args!("{out}\n"))
    }

    /// Prints the sums, or all as JSON.
    fn print_end(self, result: &CheckMathResult) -> Result<()> {
        let sum =
            |count: fn(&CheckMathReport) -> u64| result.reports().map(count).fold(0, u64::saturating_add);
        let wrong = sum(|report| report.wrong);
        if self.json {
            let failed = |error: serde_json::Error| Error::io("standard output", error.into());
            let mut functions: Vec<Value> =
                result.reports().map(serde_json::to_value).collect::<Result<_, _>>().map_err(failed)?;
            for function in functions.iter_mut().filter_map(Value::as_object_mut) {
                if !self.with_times {
                    function.remove("time");
                }
            }
            let json = serde_json::json!({ "functions": functions, "wrong": wrong });
            output::print(format_args!("{json:#}\n"))?;
        } else {
            let inputs = sum(|report| report.inputs);
            output::print(format_args!("\n{} results: {} wrong\n", grouped(inputs), grouped(wrong)))?;
        }
        if wrong == 0 {
            Ok(())
        } else {
            Err(Error::new(ErrorKind::Expectation, format!("{} wrong results", grouped(wrong))))
        }
    }
}

fn function(name: &str) -> std::result::Result<&'static str, String> {
    let found = FUNCTIONS.iter().map(CheckedFunction::instruction).find(|one| one.eq_ignore_ascii_case(name));
    found.ok_or_else(|| {
        let mut names: Vec<_> = FUNCTIONS.iter().map(CheckedFunction::instruction).collect();
        names.dedup();
        format!("the functions are {}", names.join(", "))
    })
}
