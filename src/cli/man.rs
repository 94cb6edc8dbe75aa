//! `anyhit man`: the help of all commands as manual pages.

use std::path::PathBuf;

use clap::Args;
use clap_mangen::Man;

use anyhit_base::atomic_file;
use anyhit_base::error::{Error, Result};

/// Write manual pages to a folder: anyhit.1, and a page for each command, such as anyhit-test.1.
///
/// To read one: `man -l DIR/anyhit-test.1`
#[derive(Args, Clone, Debug)]
pub(super) struct ManArgs {
    /// Folder to write to, which is created
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// `Io` where the folder or a page cannot be written.
pub(super) fn run(args: ManArgs) -> Result<()> {
    let failed = |error| Error::io(&args.folder, error);
    std::fs::create_dir_all(&args.folder).map_err(failed)?;
    let mut program = super::command();
    program.build();
    for command in std::iter::once(&program).chain(program.get_subcommands()) {
        let page = Man::new(command.clone());
        let mut text = Vec::new();
        page.render(&mut text).map_err(failed)?;
        atomic_file::write(&args.folder.join(page.get_filename()), text)?;
    }
    Ok(())
}
