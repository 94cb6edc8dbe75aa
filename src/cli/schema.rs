//! `anyhit schema`: the JSON Schema of scenes and tests, for editors.

use std::path::PathBuf;

use clap::Args;

use crate::cli::output;
use crate::cli::scene_schema::scene_schema;
use anyhit_base::atomic_file;
use anyhit_base::error::Result;

/// Print the JSON Schema of `scene.toml` and `*.test.toml`, by which editors complete and check
/// keys.
///
/// For Taplo and Even Better TOML, name the schema in the first line of a TOML file:
/// `#:schema scene.schema.json`.
#[derive(Args, Clone, Debug)]
pub(super) struct SchemaArgs {
    /// File to write [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// `Io` where the file cannot be written.
pub(super) fn run(args: SchemaArgs) -> Result<()> {
    let text = format!("{:#}\n", scene_schema());
    match args.output {
        Some(path) => atomic_file::write(&path, text),
        None => output::print(text),
    }
}
