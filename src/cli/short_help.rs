//! `-h`: a line for each option, no longer than the terminal is wide. `--help` has all of it.

use std::io::stdout;

use clap::error::ErrorKind;
use clap::{Arg, Command};

use crate::cli::output;
use anyhit_base::error::Result;

/// The width that no terminal has.
const UNLIMITED: usize = usize::MAX;

/// Returns true if a command line requests the short help.
pub(super) fn is_asked(answer: &clap::Error, mut arguments: impl Iterator<Item = String>) -> bool {
    answer.kind() == ErrorKind::DisplayHelp && arguments.any(|argument| argument == "-h")
}

/// Prints the short help that a command line asks for.
///
/// # Errors
/// As [`output::print`].
pub(super) fn print(program: Command, arguments: impl Iterator<Item = String>) -> Result<()> {
    let Err(answer) = shortened(program).term_width(0).try_get_matches_from(arguments) else { return Ok(()) };
    let help = answer.render();
    let width = terminal_size::terminal_size_of(stdout()).map_or(UNLIMITED, |(width, _)| width.0.into());
    let text = match output::is_coloured(&stdout()) {
        true => help.ansi().to_string(),
        false => help.to_string(),
    };
    output::print(fitted(&text, width))
}

/// A command whose options say the first thing about themselves.
fn shortened(command: Command) -> Command {
    let first = |arg: Arg| match arg.get_help().map(ToString::to_string) {
        Some(help) => arg.help(first_part(&help)),
        None => arg,
    };
    command.mut_args(first).mut_subcommands(shortened)
}

/// The first part of a sentence, with a condition before it and a default value behind it:
/// `With --heat: name the file; a second remark [default: heat.png]`.
fn first_part(help: &str) -> String {
    let (said, default) = help.split_at(help.find(" [").unwrap_or(help.len()));
    let condition = if said.starts_with("With ") { said.find(": ").map_or(0, |at| at + 2) } else { 0 };
    let ends = [": ", "; "].into_iter().filter_map(|sign| said[condition..].find(sign));
    let end = ends.min().map_or(said.len(), |at| condition + at);
    format!("{}{default}", &said[..end])
}

/// A text for a width: what is indented is cut, all else is broken between words.
fn fitted(text: &str, width: usize) -> String {
    let mut out = String::new();
    for line in text.lines() {
        if line.starts_with(' ') {
            out += &cut(line, width);
        } else {
            let mut column = 0;
            for word in line.split(' ') {
                let length = visible(word);
                if column > 0 && column + 1 + length > width {
                    out.push('\n');
                    column = 0;
                } else if column > 0 {
                    out.push(' ');
                    column += 1;
                }
                out += word;
                column += length;
            }
        }
        out.push('\n');
    }
    out
}

/// The number of characters that a terminal shows.
fn visible(text: &str) -> usize {
    characters(text).filter(|(_, is_shown)| *is_shown).count()
}

/// The characters of a text, each with whether it is shown: escape sequences of styles are not.
fn characters(text: &str) -> impl Iterator<Item = (char, bool)> {
    let mut is_escape = false;
    text.chars().map(move |c| {
        is_escape |= c == '\u{1b}';
        let is_shown = !is_escape;
        is_escape &= c != 'm';
        (c, is_shown)
    })
}

/// A line that is no wider than a terminal. An ellipsis stands for words that were cut off.
fn cut(line: &str, width: usize) -> String {
    if visible(line) <= width {
        return line.to_owned();
    }
    let (mut kept, mut column) = (String::new(), 0);
    // All of what is not shown stays, so that styles end.
    for (c, is_shown) in characters(line) {
        if !is_shown || column + 1 < width {
            kept.push(c);
        }
        column += usize::from(is_shown);
    }
    let end = kept.rfind(' ').filter(|&at| !kept[..at].trim().is_empty()).unwrap_or(kept.len());
    format!("{}\u{2026}", kept[..end].trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_between_words_and_text_is_broken() {
        assert_eq!(cut("  --size <WxH>  Width and height", 32), "  --size <WxH>  Width and height");
        assert_eq!(cut("  --size <WxH>  Width and height", 31), "  --size <WxH>  Width and\u{2026}");
        assert_eq!(fitted("one two three\n\n  four five six", 9), "one two\nthree\n\n  four\u{2026}\n");
        let styled = "  \u{1b}[1m--size\u{1b}[0m  Width and height";
        assert_eq!(visible(styled), 26);
        assert_eq!(cut(styled, 26), styled);
        assert_eq!(cut(styled, 25), "  \u{1b}[1m--size\u{1b}[0m  Width and\u{2026}");
    }

    #[test]
    fn a_short_help_is_the_first_thing_said() {
        let command = Command::new("a").arg(Arg::new("b").long("b").help("Run it; exit with 1: never"));
        let help = shortened(command).render_help().to_string();
        assert!(help.contains("Run it\n") && !help.contains("exit"), "{help}");
        assert_eq!(first_part("With --b: run it: now [default: 1]"), "With --b: run it [default: 1]");
        assert_eq!(first_part("Number of lanes"), "Number of lanes");
    }
}
