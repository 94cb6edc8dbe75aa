//! Standard output, standard error and the names of written files.

use std::ffi::OsString;
use std::fmt::Display;
use std::io::{ErrorKind, Write, stderr, stdout};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use anstream::stream::RawStream;
use anstream::{AutoStream, ColorChoice};
use clap::ValueEnum;
use clap::builder::{PathBufValueParser, TypedValueParser};

use crate::cli::progress;
use anyhit_base::error::{Error, ErrorReport, Result, Warning};
use anyhit_base::{atomic_file, escape};
use anyhit_engine::machine::Printed;
use anyhit_scene::image::PictureKind;

/// Prints a report to standard output, hidden characters as [`escape::text`] shows them.
///
/// A closed pipe (`anyhit inspect a.spv | head`) is no error: the command continues, and its exit
/// code depends only on the command.
///
/// # Errors
/// `Io` where standard output cannot be written for another reason, a full disk say.
pub(super) fn print(text: impl Display) -> Result<()> {
    let styled = if is_claimed() { is_coloured(&stderr()) } else { is_coloured(&stdout()) };
    write_report(&escape::text(&text.to_string(), styled))
}

/// The flag with whose data standard output is kept.
static CLAIMED: OnceLock<&str> = OnceLock::new();

/// Keeps standard output for the data of a flag, which another program reads and [`print_data`]
/// prints: all other text goes to standard error from here on.
///
/// # Errors
/// `InvalidArgument` where the data of another flag goes there.
pub(super) fn claim_stdout(flag: &'static str) -> Result<()> {
    let first = *CLAIMED.get_or_init(|| flag);
    if first == flag {
        return Ok(());
    }
    let message = format!("`{first}` and `{flag}` cannot both print to standard output");
    Err(Error::new(anyhit_base::error::ErrorKind::InvalidArgument, message)
        .note("help: write one of them to a file"))
}

fn is_claimed() -> bool {
    CLAIMED.get().is_some()
}

/// Prints data that another program reads to standard output.
///
/// # Errors
/// As [`print`].
pub(super) fn print_data(text: impl Display) -> Result<()> {
    write_to(&mut stdout().lock(), &escape::printed(&text.to_string(), false))
}

/// Whether a path is standard output: `-`, or a name of its descriptor.
fn is_stdout(path: &Path) -> bool {
    let names = ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];
    names.iter().any(|name| path == Path::new(name))
}

/// Keeps standard output for data where it is one of the files that flags ask for.
///
/// # Errors
/// As [`claim_stdout`].
pub(super) fn claim_stdout_for<'a>(
    files: impl IntoIterator<Item = (&'static str, Option<&'a Path>)>,
) -> Result<()> {
    let mut claims = files.into_iter().filter(|(_, file)| file.is_some_and(is_stdout));
    claims.try_for_each(|(flag, _)| claim_stdout(flag))
}

/// Writes data to a file, or to standard output where the path is `-`.
///
/// # Errors
/// `Io`.
pub(super) fn write_data(path: &Path, text: &str) -> Result<()> {
    match path == Path::new("-") {
        true => print_data(text),
        false => atomic_file::write(path, text),
    }
}

/// Prints to standard output what may be commands to the runner of a workflow: those that this
/// program gives it, and other text that was made safe.
///
/// # Errors
/// As [`print`].
pub(super) fn print_commands(text: impl Display) -> Result<()> {
    write_report(&escape::printed(&text.to_string(), false))
}

/// With `--json`, prints an error before which nothing was printed, as `{"errors": [...]}`, and
/// returns it.
pub(super) fn json_error(json: bool, error: Error) -> Error {
    if json {
        let errors = serde_json::json!({ "errors": ErrorReport::all(&error) });
        // The error itself is worth more than that it could not be printed here, too.
        let _ = print_data(format_args!("{errors:#}\n"));
    }
    error
}

/// Prints what shaders printed (`NonSemantic.DebugPrintf`), each text on a line of its own. Returns
/// whether there was any.
///
/// # Errors
/// As [`print`].
pub(super) fn printed(printed: &Printed) -> Result<bool> {
    let lines = printed.take();
    for line in &lines {
        let end = if line.text.ends_with('\n') { "" } else { "\n" };
        let text = format!("{}{end}", line.text);
        write_report(&escape::text(&text, !is_claimed() && is_coloured(&stdout())))?;
    }
    Ok(!lines.is_empty())
}

/// Prints a hint for the user to standard error.
pub(super) fn hint(text: impl Display) {
    // A hint that cannot be written is no reason to fail.
    let text = escape::text(&text.to_string(), false).into_owned();
    let _ = progress::hidden(|| writeln!(stderr().lock(), "{text}"));
}

/// Prints notes to standard error, a line each; a warning among them says so.
pub(super) fn notes(notes: &[String]) {
    for note in notes {
        let note = escape::line(note);
        match note.starts_with("warning: ") {
            true => hint(note),
            false => hint(format_args!("note: {note}")),
        }
    }
}

/// Prints what a compiler warned of to standard error, a line each.
pub(super) fn warnings(warnings: &[Warning]) {
    warnings.iter().for_each(|warning| hint(format_args!("warning: {warning}")));
}

/// The file that a picture is written to. Its extension says as what; another one than those that
/// are known is refused, and `.exr` where this build cannot write it.
///
/// # Errors
/// A message, if the extension is not `png`, `exr` or `raw`.
pub(super) fn picture_file(path: PathBuf) -> std::result::Result<PathBuf, String> {
    if PictureKind::of(&path).is_none() {
        let name = escape::path(&path);
        return Err(format!("`{name}` does not end in .png, .exr or .raw"));
    }
    Ok(path)
}

/// [`picture_file`] for an argument.
pub(super) fn picture_parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(picture_file)
}

/// When output is coloured.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(super) enum ColorArg {
    /// On terminals, except where `NO_COLOR`, `CLICOLOR` or `TERM` say otherwise.
    Auto,
    /// Everywhere, also in files and pipes.
    Always,
    /// On no stream.
    Never,
}

/// Sets when output is coloured, for all streams and for clap's answers, as the last `--color` of a
/// command line asks. It comes before clap parses the line, which may answer with colours itself.
pub(super) fn choose_colours(arguments: impl Iterator<Item = OsString>) {
    let mut choice = ColorChoice::Auto;
    let mut is_value = false;
    for argument in arguments {
        let argument = argument.to_string_lossy();
        let value = if is_value { Some(&*argument) } else { argument.strip_prefix("--color=") };
        match value.and_then(|value| ColorArg::from_str(value, false).ok()) {
            Some(ColorArg::Auto) => choice = ColorChoice::Auto,
            Some(ColorArg::Always) => choice = ColorChoice::Always,
            Some(ColorArg::Never) => choice = ColorChoice::Never,
            None if argument == "--" => break,
            None => {}
        }
        is_value = !is_value && argument == "--color";
    }
    choice.write_global();
}

/// Returns whether output to a stream is coloured: as `--color` asks, else on terminals, following
/// `NO_COLOR`, `CLICOLOR`, `CLICOLOR_FORCE` and `TERM` (<https://bixense.com/clicolors>).
pub(super) fn is_coloured(stream: &impl RawStream) -> bool {
    AutoStream::choice(stream) != ColorChoice::Never
}

/// Prints an error to standard error, in colour where [`is_coloured`] says so.
pub(super) fn report(error: &Error) {
    let is_helped = error.notes().iter().any(|note| note.starts_with("help: "));
    let error = match error.kind() {
        anyhit_base::error::ErrorKind::InvalidArgument if !is_helped => {
            &error.clone().note("help: run `anyhit help COMMAND` for its arguments")
        }
        _ => error,
    };
    let styled = is_coloured(&stderr());
    let text = if styled { error.render_coloured() } else { error.render() };
    // There is no other stream to report that standard error cannot be written.
    let _ = stderr().lock().write_all(text.as_bytes());
}

/// Prints what clap answers: the help and the version to standard output, mistakes to standard
/// error.
///
/// # Errors
/// As [`print`].
pub(super) fn command_line(answer: &clap::Error) -> Result<()> {
    let printed = answer.print().and_then(|()| stdout().flush());
    // There is no other stream to report that standard error cannot be written.
    if answer.use_stderr() { Ok(()) } else { judged(printed) }
}

fn write_report(text: &str) -> Result<()> {
    match is_claimed() {
        true => write_to(&mut stderr().lock(), text),
        false => write_to(&mut stdout().lock(), text),
    }
}

fn write_to(to: &mut impl Write, text: &str) -> Result<()> {
    judged(progress::hidden(|| to.write_all(text.as_bytes()).and_then(|()| to.flush())))
}

fn judged(printed: std::io::Result<()>) -> Result<()> {
    match printed {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::io("standard output", error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    struct Refuses(ErrorKind);

    impl Write for Refuses {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Err(self.0.into())
        }
    }

    #[test]
    fn a_reader_that_went_away_is_no_error_but_a_full_disk_is() {
        assert!(write_to(&mut Refuses(ErrorKind::BrokenPipe), "text").is_ok());
        let error = write_to(&mut Refuses(ErrorKind::StorageFull), "text").unwrap_err();
        assert!(error.message().starts_with("standard output: "), "{error}");
    }
}
