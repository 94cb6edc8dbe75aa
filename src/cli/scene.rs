//! `anyhit scene`: writes a scene file for compiled shaders.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::cli::input::SceneFileArgs;
use crate::cli::limits::LimitArgs;
use crate::cli::output;
use crate::cli::source::SourceArgs;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::input::STANDARD_INPUT;
use anyhit_cases::init;
use anyhit_debugger::shell;
use anyhit_engine::machine::LaunchLimits;

/// Write a complete scene file from the declarations of modules.
#[derive(Args, Clone, Debug)]
pub(super) struct SceneArgs {
    /// Modules or shader sources
    #[arg(long, value_name = "MODULE", num_args = 1.., required = true)]
    init: Vec<PathBuf>,
    /// File to write
    #[arg(short, long, value_name = "FILE", default_value = "scene.toml")]
    output: PathBuf,
    #[command(flatten)]
    how: SourceArgs,
    #[command(flatten)]
    files: SceneFileArgs,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// What modules lack, and a file that is there already.
pub(super) fn run(args: SceneArgs) -> Result<()> {
    if args.output == Path::new(STANDARD_INPUT) {
        let message = "`--output -`: a scene is written to a file, which its paths are relative to";
        return Err(Error::new(ErrorKind::InvalidArgument, message));
    }
    let limits = args.limits.limits(LaunchLimits::TESTS);
    let written = init::scene(&args.init, &args.output, &args.files.files()?, &limits, &args.how.words())?;
    output::warnings(&written.warnings);
    let (path, command) = (escape::path(&written.path), written.command);
    let typed = shell::word(&path.to_string());
    output::print(match written.failure {
        None => format!("{path}: written\nrun it: anyhit {command} {typed}\n"),
        Some(failure) => format!(
            "{path}: written; it does not run yet: {}\n\
             add what the shaders need, then run it: anyhit {command} {typed}\n",
            failure.message()
        ),
    })
}
