//! `anyhit completions`: scripts that complete command lines in a shell.

use clap::Args;
use clap_complete::{Shell, generate};

use crate::cli::output;
use anyhit_base::error::Result;

/// Print a script that completes the commands and options of anyhit in a shell.
///
/// For bash: `anyhit completions bash > ~/.local/share/bash-completion/completions/anyhit`
#[derive(Args, Clone, Debug)]
pub(super) struct CompletionsArgs {
    /// Shell that runs the script
    shell: Shell,
}

/// Runs the command.
///
/// # Errors
/// `Io` where standard output cannot be written.
pub(super) fn run(args: CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    generate(args.shell, &mut super::command(), "anyhit", &mut script);
    output::print(String::from_utf8_lossy(&script))
}
