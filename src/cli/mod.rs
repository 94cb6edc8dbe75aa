//! One file per command.

pub mod compile;

use std::process::ExitCode;

/// Parses the command line, runs the command and reports its error.
pub fn main() -> ExitCode {
    ExitCode::SUCCESS
}
