//! Standard output, standard error and the names of written files.

use std::borrow::Cow;
use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write, stderr, stdout};
use std::path::PathBuf;

use clap::builder::{PathBufValueParser, TypedValueParser};

use crate::error::{Error, ErrorReport, Result, Warning};
use crate::machine::Printed;
use crate::scene::image::PictureKind;

/// Prints to standard output, control characters as [`visible`] shows them.
///
/// A closed pipe (`anyhit inspect a.spv | head`) is no error: the command continues, and its exit
/// code depends only on the command.
///
/// # Errors
/// `Io` where standard output cannot be written for another reason, a full disk say.
pub(super) fn print(text: impl Display) -> Result<()> {
    write_to(&mut stdout().lock(), text)
}

/// With `--json`, prints an error before which nothing was printed, as `{"errors": [...]}`, and
/// returns it.
pub(super) fn json_error(json: bool, error: Error) -> Error {
    if json {
        let errors = serde_json::json!({ "errors": ErrorReport::all(&error) });
        // The error itself is worth more than that it could not be printed here, too.
        let _ = print(format_args!("{errors:#}\n"));
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
        print(format_args!("{}{end}", line.text))?;
    }
    Ok(!lines.is_empty())
}

/// Prints a hint for the user to standard error.
pub(super) fn hint(text: impl Display) {
    // A hint that cannot be written is no reason to fail.
    let _ = writeln!(stderr().lock(), "{}", visible(&text.to_string(), false));
}

/// Prints notes to standard error, a line each.
pub(super) fn notes(notes: &[String]) {
    notes.iter().for_each(|note| hint(format_args!("note: {note}")));
}

/// Prints what a compiler warned of to standard error, a line each.
pub(super) fn warnings(warnings: &[Warning]) {
    warnings.iter().for_each(|warning| hint(format_args!("warning: {warning}")));
}

/// Notes that the user gave a flag by its old name, which is still accepted.
pub(super) fn renamed_flag(old: &str, new: &str) {
    hint(format_args!("note: `{old}` is now called `{new}`; the old name still works"));
}

/// The file that a picture is written to. Its extension says as what; another one than those that
/// are known is refused, and `.exr` where this build cannot write it.
///
/// # Errors
/// A message, if the extension is not `png`, `exr` or `raw`.
pub(super) fn picture_file(path: PathBuf) -> std::result::Result<PathBuf, String> {
    if PictureKind::of(&path).is_none() {
        let name = path.display();
        return Err(format!("a picture is written as .png, .exr or .raw, and `{name}` says otherwise"));
    }
    Ok(path)
}

/// [`picture_file`] for an argument.
pub(super) fn picture_parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(picture_file)
}

/// Whether the user wants no colours, wherever output goes: `NO_COLOR` is set.
pub(super) fn is_plain() -> bool {
    std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
}

/// Prints an error to standard error, in colour where that is a terminal and `NO_COLOR` is not set.
pub(super) fn report(error: &Error) {
    let styled = !is_plain() && stderr().is_terminal();
    let text = if styled { error.render_coloured() } else { error.render() };
    // There is no other stream to report that standard error cannot be written.
    let _ = stderr().lock().write_all(visible(&text, styled).as_bytes());
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

fn write_to(to: &mut impl Write, text: impl Display) -> Result<()> {
    let text = text.to_string();
    let text = visible(&text, stdout().is_terminal());
    judged(to.write_all(text.as_bytes()).and_then(|()| to.flush()))
}

/// A text of which nothing moves the cursor, renames the window or changes the order of letters:
/// names, sources and what shaders print may be somebody else's. Control characters other than line
/// feeds and tabs, and those that reorder a line, are shown as in `\u001b`, which means the same in
/// JSON; where the text may be styled, sequences of colours and weights stay.
fn visible(text: &str, styled: bool) -> Cow<'_, str> {
    let is_hidden = |c: char| {
        c.is_control() && c != '\n' && c != '\t'
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(is_hidden) {
        let (before, found) = rest.split_at(at);
        out.push_str(before);
        rest = match style_of(found).filter(|_| styled) {
            Some(length) => {
                out.push_str(&found[..length]);
                &found[length..]
            }
            None => {
                let mut letters = found.chars();
                let letter = letters.next().unwrap_or_default();
                out.push_str(&format!("\\u{:04x}", u32::from(letter)));
                letters.as_str()
            }
        };
    }
    if out.is_empty() {
        return Cow::Borrowed(rest);
    }
    out.push_str(rest);
    Cow::Owned(out)
}

/// The length of the sequence that selects a style (`SGR` of ECMA-48) at the start of a text.
fn style_of(text: &str) -> Option<usize> {
    let parameters = text.strip_prefix("\u{1b}[")?;
    let end = parameters.find(|c: char| !c.is_ascii_digit() && c != ';')?;
    parameters[end..].starts_with('m').then_some(2 + end + 1)
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
    fn what_others_wrote_controls_no_terminal() {
        // Colours, a title of the window, a way back to the start of the line, and one to the left.
        let text = "a\u{1b}[1;31mred\u{1b}[0m\tb\n\u{1b}]0;title\u{7}\rc\u{202e}d\u{9b}2J";
        let hidden = r"\u001b]0;title\u0007\u000dc\u202ed\u009b2J";
        assert_eq!(visible(text, true), format!("a\u{1b}[1;31mred\u{1b}[0m\tb\n{hidden}"));
        assert_eq!(visible(text, false), format!("a\\u001b[1;31mred\\u001b[0m\tb\n{hidden}"));
        assert_eq!(visible("\u{1b}[2", true), r"\u001b[2");
        assert!(matches!(visible("plain: ü\n", false), Cow::Borrowed("plain: ü\n")));
    }

    #[test]
    fn a_reader_that_went_away_is_no_error_but_a_full_disk_is() {
        assert!(write_to(&mut Refuses(ErrorKind::BrokenPipe), "text").is_ok());
        let error = write_to(&mut Refuses(ErrorKind::StorageFull), "text").unwrap_err();
        assert!(error.message().starts_with("standard output: "), "{error}");
    }
}
