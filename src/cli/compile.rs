//! `anyhit compile`: compiles shader sources to SPIR-V.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::cli::input::InputLimitArgs;
use crate::cli::output;
use crate::cli::source::SourceArgs;
use anyhit_base::atomic_file;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimits;
use anyhit_base::progress::Work;
use anyhit_compile::{
    CompileOptions, DebugInfoLevel, Optimize, Source, SourceWords, compile_with_warnings, fixtures,
};

/// Compile GLSL, WGSL, Slang or HLSL to SPIR-V.
#[derive(Args, Clone, Debug)]
pub(super) struct CompileArgs {
    /// Shader sources; the extension selects language and stage (.rgen .rint .rahit .rchit .rmiss
    /// .rcall .comp, optionally followed by .glsl; .wgsl .slang .hlsl)
    #[arg(value_name = "SOURCE", required_unless_present = "fixtures", conflicts_with = "fixtures")]
    sources: Vec<PathBuf>,
    /// File for the module, or folder for the modules of several sources [default: SOURCE.spv]
    #[arg(short, long, value_name = "PATH", conflicts_with = "fixtures")]
    output: Option<PathBuf>,
    /// Emit debug information: lines
    #[arg(short = 'g', conflicts_with = "fixtures")]
    lines: bool,
    /// Emit debug information: lines, columns, variables and source text, as glslang's -gVS and
    /// slangc's -g2
    #[arg(short = 'G', conflicts_with = "fixtures")]
    full: bool,
    /// Optimisation level: 0 or 2 [default: the compiler's own]
    #[arg(short = 'O', value_name = "LEVEL", conflicts_with = "fixtures", value_parser = ["0", "2"])]
    optimize: Option<String>,
    #[command(flatten)]
    how: SourceArgs,
    #[command(flatten)]
    limits: InputLimitArgs,
    /// In the current folder, compile the sources in shaders/ whose modules in spirv-fixtures/ are
    /// out of date
    #[arg(
        long,
        conflicts_with_all = ["limit", "language", "stage", "entry", "include_folders", "defines", "flags"]
    )]
    fixtures: bool,
    /// With --fixtures: compile all sources, including unchanged ones
    #[arg(long, requires = "fixtures", conflicts_with = "sources")]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// What the compilers report, all sources in one; with `--fixtures` also
/// [`ErrorKind::UnsupportedTool`] where a stale fixture needs a compiler that is not there.
pub(super) fn run(args: CompileArgs) -> Result<()> {
    if args.fixtures { regenerate(args.force) } else { compile_sources(&args) }
}

fn compile_sources(args: &CompileArgs) -> Result<()> {
    let debug = match (args.full, args.lines) {
        (true, _) => DebugInfoLevel::Full,
        (false, true) => DebugInfoLevel::Lines,
        (false, false) => DebugInfoLevel::Names,
    };
    let optimize = match args.optimize.as_deref() {
        None => Optimize::Default,
        Some("0") => Optimize::Off,
        Some(_) => Optimize::High,
    };
    let options = CompileOptions { debug, optimize, ..CompileOptions::default() };
    let limits = args.limits.limits();
    let words = args.how.words();
    let mut errors = Vec::new();
    for path in &args.sources {
        let mut file = path.file_name().unwrap_or_default().to_owned();
        file.push(".spv");
        let output = match &args.output {
            None => path.with_file_name(file),
            Some(output) if args.sources.len() == 1 && !output.is_dir() => output.clone(),
            Some(folder) => folder.join(file),
        };
        errors.extend(compile_source(path, &output, &words, &options, &limits).err());
    }
    if errors.is_empty() { Ok(()) } else { Err(Error::several(errors)) }
}

fn compile_source(
    path: &Path,
    output: &Path,
    words: &SourceWords,
    options: &CompileOptions,
    limits: &InputLimits,
) -> Result<()> {
    let settings = words.settings(path)?.unwrap_or_default();
    let name = path.to_string_lossy();
    let source = Source::read_as(settings.language(&name)?, Path::new(""), &name, limits)?;
    let source = source.include_folders(&settings.include_folders);
    let work = Work::new("compiling");
    let compiled = compile_with_warnings(&source, &settings.over(options))?;
    drop(work);
    output::warnings(&compiled.warnings);
    atomic_file::write(output, compiled.spirv)
}

fn regenerate(force: bool) -> Result<()> {
    let root = std::env::current_dir().map_err(|error| Error::io(".", error))?;
    if !root.join(fixtures::SOURCES).is_dir() {
        let text = format!("the current folder has no folder {}/", fixtures::SOURCES);
        let note = "help: run the command in the root of the repository";
        return Err(Error::new(ErrorKind::InvalidArgument, text).note(note));
    }
    let work = Work::new("compiling fixtures");
    let report = fixtures::regenerate(&root, force)?;
    drop(work);
    for name in &report.written {
        output::print(format_args!("wrote {}/{name}\n", fixtures::FIXTURES))?;
    }
    for name in &report.removed {
        output::print(format_args!("removed {}/{name}\n", fixtures::FIXTURES))?;
    }
    output::print(format_args!("{} written, {} up to date\n", report.written.len(), report.kept))?;
    // One report for all: each of them lacks a compiler, and most of them the same one.
    let names = report.skipped.iter().map(|(name, _)| format!("stale: {}/{name}", fixtures::FIXTURES));
    let names: Vec<_> = names.collect();
    match report.skipped.into_iter().next() {
        None => Ok(()),
        Some((_, error)) => Err(names.into_iter().fold(error, Error::note)),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: CompileArgs,
    }

    fn parse(line: &str) -> Option<CompileArgs> {
        Command::try_parse_from(line.split(' ')).ok().map(|command| command.args)
    }

    #[test]
    fn the_flags_of_compilers_are_understood() {
        let args = parse("compile -g a.rgen b.rmiss -O0 -o out").unwrap();
        assert!(args.lines && !args.full && args.optimize.is_some());
        assert_eq!(args.sources.len(), 2);
        assert!(parse("compile").is_none(), "neither source nor --fixtures");
        assert!(parse("compile --fixtures a.rgen -g").is_none(), "flags of fixtures stand in the sources");
        assert!(parse("compile --fixtures").is_some());
        assert!(parse("compile --fixtures --limit source-bytes=9").is_none(), "fixtures have the defaults");
        assert!(parse("compile --fixtures -Icommon").is_none(), "sources say their own");
        assert!(parse("compile --fixtures --stage miss").is_none(), "sources say their own");
        assert!(parse("compile a.rgen --force").is_none(), "only fixtures are forced");
    }
}
