//! `anyhit check-math`: compares the elementary functions with their correctly rounded results.

use indicatif::{ProgressBar, ProgressStyle};

use crate::check_math::float_width::FloatWidth;
use crate::check_math::function::{CheckedFunction, FUNCTIONS};
use crate::check_math::{self, CheckMathReport, CheckMathSettings};
use crate::cli::output;
use crate::error::{Error, ErrorKind, Result};

/// Compares every elementary function with its correctly rounded result, over all f16 and f32
/// inputs.
///
/// The platform's functions in f64 decide nearly all inputs; arbitrary precision decides those near
/// a rounding boundary. Functions of two f32 are checked on pairs, many of them near the edges of
/// their domains. Functions of f64 are checked on a sample in arbitrary precision. The whole
/// comparison takes more than an hour of one core.
#[derive(Debug, clap::Args)]
pub struct CheckMathArgs {
    /// Check only this function, by its name in the specification, such as `Sin`; may be repeated.
    #[arg(long, value_name = "NAME", value_parser = function)]
    function: Vec<&'static str>,

    /// Check only floats of this many bits; may be repeated.
    #[arg(long, value_name = "BITS", value_parser = clap::builder::PossibleValuesParser::new(["16", "32", "64"]))]
    width: Vec<String>,

    /// Check every Nth f32, and every Nth pair of f16, instead of all.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    stride: u64,

    /// The number of pairs of f32.
    #[arg(long, value_name = "N", default_value_t = 1 << 28, value_parser = clap::value_parser!(u64).range(1..))]
    pairs: u64,

    /// The number of f64, or of pairs of them.
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u64).range(1..))]
    samples: u64,

    /// The seed that draws the pairs, the f64 and the start of a stride.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// `Expectation` where a result was wrong.
pub fn run(args: CheckMathArgs) -> Result<()> {
    let settings =
        CheckMathSettings { stride: args.stride, pairs: args.pairs, samples: args.samples, seed: args.seed };
    let mut reports = Vec::new();
    if !args.json {
        output::print(format_args!("{}\n", heading()))?;
    }
    for format in FloatWidth::ALL {
        let wanted = args.width.is_empty() || args.width.contains(&format.width().to_string());
        let named = |function: &&CheckedFunction| {
            args.function.is_empty() || args.function.contains(&function.instruction())
        };
        for function in FUNCTIONS.iter().filter(named).filter(|one| wanted && one.exists(format)) {
            let style = ProgressStyle::with_template("{msg} {wide_bar} {percent}% {eta}");
            let bar = ProgressBar::new(0).with_message(function.name);
            let bar = style.map_or_else(|_| bar.clone(), |style| bar.clone().with_style(style));
            let report = check_math::run(function, format, &settings, |count, total| {
                bar.set_length(total);
                bar.inc(count);
            });
            bar.finish_and_clear();
            if !args.json {
                output::print(format_args!("{}\n", line(&report)))?;
            }
            reports.push(report);
        }
    }
    let wrong: u64 = reports.iter().map(|report| report.wrong).sum();
    if args.json {
        let json = serde_json::to_string_pretty(&serde_json::json!({ "functions": reports, "wrong": wrong }))
            .map_err(|error| Error::io("standard output", error.into()))?;
        output::print(format_args!("{json}\n"))?;
    } else {
        let inputs: u64 = reports.iter().map(|report| report.inputs).sum();
        output::print(format_args!("\n{inputs} results: {wrong} wrong\n"))?;
    }
    if wrong == 0 {
        Ok(())
    } else {
        Err(Error::new(ErrorKind::Expectation, format!("{wrong} wrong results")))
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

fn heading() -> String {
    format!(
        "{:<14} {:>5} {:>12} {:>10} {:>8} {:>9}  inputs",
        "function", "width", "inputs", "precise", "wrong", "s"
    )
}

fn line(report: &CheckMathReport) -> String {
    let mut out = format!(
        "{:<14} {:>5} {:>12} {:>10} {:>8} {:>9.1}  {}",
        report.function,
        report.width,
        report.inputs,
        report.precise,
        report.wrong,
        report.time.as_secs_f64(),
        report.which
    );
    if let Some(error) = report.greatest_error {
        out += &format!(", at most {error:.3} ulp");
    }
    for wrong in &report.examples {
        out += &format!("\n  of {:#x?} {:#x}, right is {}", wrong.operands, wrong.found, wrong.right);
    }
    out
}
