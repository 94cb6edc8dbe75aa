//! Escapes of text that somebody else wrote: names, paths, values, messages of compilers, what
//! shaders print.
//!
//! [`is_hidden`] says which characters are shown as escapes, `hex` how. Each kind of output has
//! one function on top of them: [`line`](fn@line) for what stands within a line, [`text`] and
//! [`printed`] for several lines, [`path`] for paths, [`markup`] for HTML, SVG and XML, [`uri`] for
//! SARIF, [`workflow_message`], [`workflow_property`] and [`workflow_log`] for GitHub.

use std::borrow::Cow;
use std::collections::hash_map::RandomState;
use std::fmt::{self, Display, Write as _};
use std::hash::BuildHasher as _;
use std::path::Path;

/// Characters beside the controls that show nothing, or change the order or the place of others:
/// the format characters of Unicode (general category Cf, but for visible signs) and its line and
/// paragraph separators.
const FORMAT: [(char, char); 14] = [
    ('\u{ad}', '\u{ad}'),
    ('\u{61c}', '\u{61c}'),
    ('\u{180e}', '\u{180e}'),
    ('\u{200b}', '\u{200f}'),
    ('\u{2028}', '\u{202e}'),
    ('\u{2060}', '\u{206f}'),
    ('\u{feff}', '\u{feff}'),
    ('\u{fff9}', '\u{fffb}'),
    ('\u{13430}', '\u{1343f}'),
    ('\u{1bca0}', '\u{1bca3}'),
    ('\u{1d173}', '\u{1d17a}'),
    ('\u{e0001}', '\u{e0001}'),
    ('\u{e0020}', '\u{e007f}'),
    // The last two of the plane are characters of no text (XML 1.0, section 2.2).
    ('\u{fffe}', '\u{ffff}'),
];

/// What begins a command to the runner of a workflow in its log, whatever blanks stand in front of
/// it: of GitHub Actions, its older form, and of Azure Pipelines.
const COMMANDS: [&str; 3] = ["::", "##[", "##vso["];

/// Whether a character is shown as an escape: controls, and what shows nothing or moves others.
pub fn is_hidden(c: char) -> bool {
    c.is_control() || FORMAT.iter().any(|&(first, last)| (first..=last).contains(&c))
}

/// The escape of a character, as JSON writes it: `\u001b`, and two of them beyond the first plane.
fn hex(c: char) -> String {
    let mut out = String::new();
    for unit in c.encode_utf16(&mut [0; 2]) {
        // Writing to a string does not fail.
        let _ = write!(out, "\\u{unit:04x}");
    }
    out
}

/// Which hidden characters stay.
#[derive(Clone, Copy)]
struct Kept {
    /// Line feeds and tabs.
    lines: bool,
    /// Sequences that select colours and weights.
    styles: bool,
}

fn escaped(text: &str, kept: Kept) -> Cow<'_, str> {
    let is_escaped = |c: char| is_hidden(c) && !(kept.lines && matches!(c, '\n' | '\t'));
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(is_escaped) {
        let (before, found) = rest.split_at(at);
        out.push_str(before);
        rest = match style_of(found).filter(|_| kept.styles) {
            Some(length) => {
                out.push_str(&found[..length]);
                &found[length..]
            }
            None => {
                let mut letters = found.chars();
                out.push_str(&hex(letters.next().unwrap_or_default()));
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

/// Text that stands within a line: every hidden character is an escape, line feeds and tabs among
/// them.
pub fn line(text: &str) -> Cow<'_, str> {
    escaped(text, Kept { lines: false, styles: false })
}

/// Text that stands within a line and whose format characters are part of it, as of a path that is
/// to be opened: controls alone are escapes. What shows it escapes the others.
pub fn controls(text: &str) -> Cow<'_, str> {
    match text.contains(char::is_control) {
        false => Cow::Borrowed(text),
        true => text.chars().map(|c| if c.is_control() { hex(c) } else { c.to_string() }).collect(),
    }
}

/// [`line`](fn@line) of a text that is owned, which is copied only where it changes.
pub fn into_line(text: String) -> String {
    match line(&text) {
        Cow::Borrowed(_) => text,
        Cow::Owned(escaped) => escaped,
    }
}

/// [`line`](fn@line), in which sequences of colours and weights stay: a line that is styled
/// already.
pub fn styled_line(text: &str) -> Cow<'_, str> {
    escaped(text, Kept { lines: false, styles: true })
}

/// A report of several lines: line feeds and tabs stay, and where it may be styled sequences of
/// colours and weights. No line begins with a command to the runner of a workflow: its first letter
/// is an escape.
pub fn text(text: &str, styled: bool) -> Cow<'_, str> {
    let shown = escaped(text, Kept { lines: true, styles: styled });
    if !shown.lines().any(|line| command_in(line).is_some()) {
        return shown;
    }
    let mut out = String::new();
    for line in shown.split_inclusive('\n') {
        match command_in(line) {
            None => out.push_str(line),
            Some(at) => {
                let (before, command) = line.split_at(at);
                let mut letters = command.chars();
                out.push_str(before);
                out.push_str(&hex(letters.next().unwrap_or_default()));
                out.push_str(letters.as_str());
            }
        }
    }
    Cow::Owned(out)
}

/// Text for data and for logs in which commands are stopped: as [`text`], and lines may begin with
/// anything.
pub fn printed(text: &str, styled: bool) -> Cow<'_, str> {
    escaped(text, Kept { lines: true, styles: styled })
}

/// Where in a line a command to the runner of a workflow begins.
fn command_in(line: &str) -> Option<usize> {
    // Styles may stand among the blanks.
    let mut rest = line;
    loop {
        let trimmed = rest.trim_start();
        match style_of(trimmed) {
            Some(length) => rest = &trimmed[length..],
            None => {
                let is_command = COMMANDS.iter().any(|start| trimmed.starts_with(start));
                return is_command.then(|| line.len() - trimmed.len());
            }
        }
    }
}

/// A path as messages show it: within a line, what is no Unicode replaced.
pub fn path(path: &(impl AsRef<Path> + ?Sized)) -> ShownPath<'_> {
    ShownPath(path.as_ref())
}

/// A path that is shown.
#[derive(Clone, Copy, Debug)]
pub struct ShownPath<'a>(&'a Path);

impl Display for ShownPath<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&line(&self.0.to_string_lossy()))
    }
}

/// Text between tags or in an attribute of HTML, SVG or XML, with its lines.
pub fn markup(text: &str) -> String {
    let mut out = String::new();
    for c in printed(text, false).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// A path as a relative reference of a URI (RFC 3986, sections 2.1 and 4.2): what may not stand in
/// one as its bytes, in hexadecimal digits.
pub fn uri(path: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~/!$&'()*+,;=@".contains(&byte);
    let mut out = String::new();
    for byte in path.bytes() {
        match is_plain(byte) {
            true => out.push(char::from(byte)),
            false => {
                let _ = write!(out, "%{byte:02X}");
            }
        }
    }
    out
}

/// Text as the message of a workflow command, which has one line.
pub fn workflow_message(text: &str) -> String {
    let text = printed(text, false);
    text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A")
}

/// Text as a property of a workflow command.
pub fn workflow_property(text: &str) -> String {
    workflow_message(&line(text)).replace(':', "%3A").replace(',', "%2C")
}

/// Text for the log of a workflow on GitHub, as it is: where lines of it could be taken for
/// commands, commands are stopped while it is printed, until a word that the text's author could
/// not know.
pub fn workflow_log(text: &str) -> Cow<'_, str> {
    // A carriage return ends a line there, too.
    if !text.split(['\n', '\r']).any(|line| command_in(line).is_some()) {
        return Cow::Borrowed(text);
    }
    let word = RandomState::new().hash_one(text);
    let end = if text.ends_with('\n') { "" } else { "\n" };
    Cow::Owned(format!("::stop-commands::{word:016x}\n{text}{end}::{word:016x}::\n"))
}

/// An annotation that a result has, for the log: a command to show an error or a warning, in one
/// line. Nothing where it is anything else.
pub fn workflow_annotation(annotation: &str) -> String {
    let command = annotation.trim_end_matches('\n');
    let is_known = ["::error ", "::warning "].iter().any(|start| command.starts_with(start));
    if is_known { format!("{}\n", line(command)) } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colours, a title of the window, a way back to the start of the line, and one to the left.
    const NASTY: &str = "a\u{1b}[1;31mred\u{1b}[0m\tb\n\u{1b}]0;title\u{7}\rc\u{202e}d\u{9b}2J";

    #[test]
    fn hidden_characters_are_escapes() {
        let hidden = r"\u001b]0;title\u0007\u000dc\u202ed\u009b2J";
        assert_eq!(printed(NASTY, true), format!("a\u{1b}[1;31mred\u{1b}[0m\tb\n{hidden}"));
        assert_eq!(printed(NASTY, false), format!("a\\u001b[1;31mred\\u001b[0m\tb\n{hidden}"));
        assert_eq!(line(NASTY), format!("a\\u001b[1;31mred\\u001b[0m\\u0009b\\u000a{hidden}"));
        assert_eq!(styled_line("\u{1b}[1ma\n"), "\u{1b}[1ma\\u000a");
        assert_eq!(printed("\u{1b}[2", true), r"\u001b[2");
        assert!(matches!(text("plain: ü\n", false), Cow::Borrowed("plain: ü\n")));
        // The tag E0041, whose UTF-16 is DB40 DC41.
        assert_eq!(line("\u{e0041}"), r"\udb40\udc41");
        for c in
            "\u{0}\u{7f}\u{80}\u{85}\u{9f}\u{200b}\u{200f}\u{2028}\u{2029}\u{2066}\u{feff}\u{ffff}".chars()
        {
            assert!(is_hidden(c), "{:x}", u32::from(c));
        }
        for c in "a é€中א\u{301}\u{1f600} ".chars() {
            assert!(!is_hidden(c), "{c}");
        }
    }

    #[test]
    fn no_line_begins_with_a_command() {
        let log = "a ::b\n  ::error::x\n##[group]\n\u{1b}[1m ##vso[task]\n::";
        let shown = "a ::b\n  \\u003a:error::x\n\\u0023#[group]\n\u{1b}[1m \\u0023#vso[task]\n\\u003a:";
        assert_eq!(text(log, true), shown);
        assert_eq!(printed("::error::x", false), "::error::x");
        let wrapped = workflow_log(log);
        assert!(wrapped.starts_with("::stop-commands::") && wrapped.contains(log), "{wrapped}");
        assert!(matches!(workflow_log("a ::b\n"), Cow::Borrowed(_)));
        assert_eq!(
            workflow_annotation("::error file=a::b\n::set-env::c\n"),
            "::error file=a::b\\u000a::set-env::c\n"
        );
        assert_eq!(workflow_annotation("::add-mask::e\n"), "");
    }

    #[test]
    fn each_output_has_its_own_escapes() {
        assert_eq!(markup("<b a='\"'>&\u{1b}"), "&lt;b a=&#39;&quot;&#39;&gt;&amp;\\u001b");
        assert_eq!(uri("a b/ü#%?[1]:\n.toml"), "a%20b/%C3%BC%23%25%3F%5B1%5D%3A%0A.toml");
        assert_eq!(workflow_message("100 %\n::x::"), "100 %25%0A::x::");
        assert_eq!(workflow_property("a,b:c\nd"), "a%2Cb%3Ac\\u000ad");
        assert_eq!(path("a\n::error::b").to_string(), r"a\u000a::error::b");
        assert_eq!(into_line("a\tb".to_owned()), r"a\u0009b");
        assert_eq!(controls("a\u{200d}b\n\u{9b}"), "a\u{200d}b\\u000a\\u009b");
    }
}
