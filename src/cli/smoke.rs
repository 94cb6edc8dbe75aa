//! `anyhit smoke`: runs every entry point of a module once, on made-up inputs.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;

use crate::cli::{module_file, output};
use crate::error::{Error, ErrorKind, Result};
use crate::harness::smoke::{self, Options, Report, Verdict};

/// Runs every ray-tracing and compute entry point of a module once, on made-up inputs.
///
/// Buffers, images, samplers, push constants, shader records, payloads, device addresses and
/// acceleration structures are made up from what the module declares: integers 0 to 3, floats in
/// [0, 1), identity matrices. Exit codes: 0 all ran to their end, 1 one trapped, 2 one is not
/// supported or the module is invalid.
#[derive(Args, Clone, Debug)]
pub struct SmokeArgs {
    /// A SPIR-V module, or the source of one (GLSL, WGSL, Slang)
    #[arg(value_name = "MODULE")]
    module: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// The seed of all values
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// How many operations an invocation may spend at back edges and calls
    #[arg(long, value_name = "N", default_value_t = Options::default().budget)]
    budget: u64,
}

/// Runs the command.
///
/// # Errors
/// What reading, compiling and loading the module reports; `Expectation` where an entry point
/// traps; `UnsupportedModule` or `InvalidModule` where one does not run.
pub fn run(args: SmokeArgs) -> Result<()> {
    let module = Arc::new(module_file::read_or_compile(&args.module)?);
    let report = smoke::run(&module, Options { seed: args.seed, budget: args.budget });
    if args.json {
        let json = serde_json::to_string_pretty(&report)
            .map_err(|error| Error::new(ErrorKind::Io, format!("{}: {error}", args.module.display())))?;
        output::print(format_args!("{json}\n"))?;
    } else {
        output::print(report.text())?;
    }
    ended(&report)
}

/// The worst verdict as an error, for the exit code.
fn ended(report: &Report) -> Result<()> {
    let worst = report.worst();
    let kind = match worst {
        Verdict::Ok | Verdict::OutOfScope => return Ok(()),
        Verdict::Trap => ErrorKind::Expectation,
        Verdict::Unsupported | Verdict::Bug => ErrorKind::UnsupportedModule,
        Verdict::Invalid => ErrorKind::InvalidModule,
    };
    let entries = &report.entry_points;
    let count = |verdict| entries.iter().filter(|entry| entry.result == verdict).count();
    let verdicts = [
        (Verdict::Trap, "trapped"),
        (Verdict::Unsupported, "not supported"),
        (Verdict::Invalid, "invalid"),
        (Verdict::Bug, "met a bug in anyhit"),
    ];
    let counts = verdicts.map(|(verdict, word)| (count(verdict), word));
    let told: Vec<_> = counts
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, word)| format!("{count} {word}"))
        .collect();
    Err(Error::new(kind, format!("of {} entry points, {}", entries.len(), told.join(", "))))
}
