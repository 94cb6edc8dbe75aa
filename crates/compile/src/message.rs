//! Parses the messages of external compilers into errors with places.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use super::Source;
use anyhit_base::error::{Error, ErrorKind, Place, Warning};

/// Which messages of a compiler are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Severity {
    /// Those of a compilation that failed.
    Error,
    /// Those of one that did not.
    Warning,
}

impl Severity {
    /// The word that slangc and glslc print, the other one, and what glslang begins a line with.
    fn words(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Error => ("error", "warning", "ERROR: "),
            Self::Warning => ("warning", "error", "WARNING: "),
        }
    }
}

/// One message of a compiler.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct CompilerDiagnostic {
    /// The file's name as the compiler gave it; empty for the source itself.
    pub(super) file: String,
    /// The line, from 1; 0 if the compiler named none.
    pub(super) line: usize,
    /// The column, from 1; 0 if the compiler named none.
    pub(super) column: usize,
    /// The number of characters that the message points at; 0 if unknown.
    pub(super) width: usize,
    /// The message.
    pub(super) text: String,
    /// What the compiler notes about it, each with its place.
    pub(super) notes: Vec<String>,
}

impl CompilerDiagnostic {
    /// A message at a line, without a column.
    fn at_line(file: impl Into<String>, line: usize, text: String) -> Self {
        Self { file: file.into(), line, column: 0, width: 0, text, notes: Vec::new() }
    }
}

/// Makes one error of diagnostics, each at its place in the text. The compiler read the source at
/// `path`. If there are no diagnostics, the whole output is the message.
pub(super) fn error(
    source: &Source,
    path: &Path,
    diagnostics: Vec<CompilerDiagnostic>,
    output: &str,
) -> Error {
    if diagnostics.is_empty() {
        let message = output.trim().lines().next().unwrap_or("the compiler failed and printed nothing");
        let rest = output.trim().lines().skip(1).collect::<Vec<_>>().join("\n");
        let error = Error::new(ErrorKind::InvalidSource, format!("{}: {message}", source.name()));
        return if rest.is_empty() { error } else { error.note_lines(rest) };
    }
    let files = source.closure();
    let errors = diagnostics.into_iter().map(|diagnostic| {
        let error = Error::new(ErrorKind::InvalidSource, diagnostic.text);
        let error = diagnostic.notes.into_iter().fold(error, Error::note);
        let name = named_file(source, path, &diagnostic.file);
        let text = if name == source.name() { Some(source.text()) } else { files.get(name) };
        match text {
            _ if diagnostic.line == 0 => error.at(Place::File(name.into())),
            Some(text) => error.at(Place::Text {
                file: name.to_owned(),
                text: text.clone(),
                span: span(text, diagnostic.line, diagnostic.column, diagnostic.width),
            }),
            None => error.at(Place::Line {
                file: name.to_owned(),
                line: u32::try_from(diagnostic.line).unwrap_or(u32::MAX),
                column: u32::try_from(diagnostic.column).unwrap_or(0),
            }),
        }
    });
    Error::several(errors.collect())
}

/// Makes warnings of diagnostics; a compiler may say one twice. It read the source at `path`.
pub(super) fn warnings(source: &Source, path: &Path, diagnostics: Vec<CompilerDiagnostic>) -> Vec<Warning> {
    let mut warnings: Vec<Warning> = Vec::new();
    for diagnostic in diagnostics {
        let file = named_file(source, path, &diagnostic.file).to_owned();
        let number = |number| u32::try_from(number).unwrap_or(u32::MAX);
        let (line, column) = (number(diagnostic.line), number(diagnostic.column));
        let notes = diagnostic.notes.into_iter().map(|note| format!("; {note}"));
        let message = std::iter::once(diagnostic.text).chain(notes).collect();
        let warning = Warning { file, line, column, message };
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }
    warnings
}

/// The name of the file that a compiler names: the source at `path`, or a file that it includes.
fn named_file<'a>(source: &'a Source, path: &Path, file: &'a str) -> &'a str {
    let is_source = file.is_empty() || Path::new(file) == path;
    if is_source { source.name() } else { file }
}

/// Parses a log of glslang: `ERROR: FILE:LINE: TEXT`, where `0` is the source itself. A list, for
/// example of required extensions, follows on separate lines.
pub(super) fn glslang(log: &str, wanted: Severity) -> Vec<CompilerDiagnostic> {
    let (.., begin) = wanted.words();
    let mut diagnostics: Vec<CompilerDiagnostic> = Vec::new();
    let mut list_follows = false;
    for line in log.lines().map(str::trim) {
        if let Some(text) = line.strip_prefix(begin) {
            let diagnostic = glslang_message(text);
            list_follows = diagnostic.as_ref().is_some_and(|diagnostic| diagnostic.text.ends_with(':'));
            diagnostics.extend(diagnostic);
        } else if let Some(last) = diagnostics.last_mut().filter(|_| list_follows && !line.is_empty()) {
            let between = if last.text.ends_with(':') { " " } else { ", " };
            last.text = [&last.text, line].join(between);
        } else {
            list_follows = false;
        }
    }
    diagnostics
}

/// Parses a line of the log, after `ERROR: ` or `WARNING: `.
fn glslang_message(line: &str) -> Option<CompilerDiagnostic> {
    let (place, text) = line.split_once(": ")?;
    // With a column the format is FILE:LINE:COLUMN. It is split from the right, because a file's
    // name may contain colons.
    let mut parts = place.rsplitn(3, ':').collect::<Vec<_>>();
    parts.reverse();
    let number = |text: &str| text.parse::<usize>().ok();
    let (file, line, column) = match parts[..] {
        [file, line, column] if number(line).is_some() => (file.to_owned(), number(line)?, number(column)?),
        [head, file, line] => (format!("{head}:{file}"), number(line)?, 0),
        [file, line] => (file.to_owned(), number(line)?, 0),
        _ => return None,
    };
    // This follows the last error of a file and is no error itself.
    if normalize_text(text) == "compilation terminated" {
        return None;
    }
    let file = if file == "0" { String::new() } else { file.trim_start_matches("./").to_owned() };
    Some(CompilerDiagnostic { column, ..CompilerDiagnostic::at_line(file, line, normalize_text(text)) })
}

/// Parses the output of `glslc`: `FILE:LINE: error: TEXT`.
pub(super) fn glslc(output: &str, wanted: Severity) -> Vec<CompilerDiagnostic> {
    let word = format!(": {}: ", wanted.words().0);
    let diagnostics = output.lines().filter_map(|line| {
        let (place, text) = line.split_once(&word)?;
        let (file, line) = place.rsplit_once(':').unwrap_or((place, "0"));
        let line = line.parse().unwrap_or(0);
        Some(CompilerDiagnostic::at_line(file, line, normalize_text(text)))
    });
    diagnostics.collect()
}

/// Parses the output of `slangc`: `error[E1]: TITLE`, then ` --> FILE:LINE:COLUMN` and carets below
/// the line; older versions print `FILE(LINE): error 1: TEXT`. Warnings keep their number, by which
/// `-Wno-NUMBER` silences them. A `note` belongs to the message before it.
pub(super) fn slangc(output: &str, wanted: Severity) -> Vec<CompilerDiagnostic> {
    let (word, other, _) = wanted.words();
    let (old, other_old) = (format!("): {word} "), format!("): {other} "));
    // Whether the line before began a note, whose place follows.
    let mut continues_note = false;
    let mut diagnostics: Vec<CompilerDiagnostic> = Vec::new();
    let mut title = None;
    // Whether carets belong to the last of the wanted messages, and whether notes do.
    let (mut is_of_last, mut notes_belong) = (false, false);
    for line in output.lines() {
        if let Some(text) = line.strip_prefix(word) {
            notes_belong = true;
            title = text.split_once(": ").map(|(number, text)| match wanted {
                Severity::Error => text.to_owned(),
                Severity::Warning => format!("{number} {text}").trim_start().to_owned(),
            });
        } else if let Some(text) = line.strip_prefix("note").filter(|_| notes_belong) {
            (is_of_last, title) = (false, None);
            let text = text.split_once(": ").map_or(text, |(_, text)| text);
            if let Some(last) = diagnostics.last_mut() {
                last.notes.push(text.trim().to_owned());
            }
            continues_note = true;
            continue;
        } else if let Some(place) = line.trim_start().strip_prefix("--> ")
            && continues_note
        {
            let notes = diagnostics.last_mut().map(|last| &mut last.notes);
            if let Some(note) = notes.and_then(|notes| notes.last_mut()) {
                *note = format!("{}: {note}", place.trim());
            }
        } else if line.starts_with(other) || line.starts_with("note") {
            (is_of_last, notes_belong, title) = (false, false, None);
        } else if let Some(place) = line.trim_start().strip_prefix("--> ")
            && let Some(text) = title.take()
        {
            let mut parts = place.trim().rsplitn(3, ':');
            let column = parts.next().and_then(|part| part.parse().ok()).unwrap_or(0);
            let line = parts.next().and_then(|part| part.parse().ok()).unwrap_or(0);
            let file = parts.next().unwrap_or(place).to_owned();
            diagnostics.push(CompilerDiagnostic { column, ..CompilerDiagnostic::at_line(file, line, text) });
            is_of_last = true;
        } else if let Some((_, carets)) = line.split_once("| ")
            && let Some(last) = diagnostics.last_mut()
            && is_of_last
            && last.width == 0
            && carets.trim_start().starts_with('^')
        {
            let carets = carets.trim_start();
            let detail = carets.trim_start_matches('^');
            last.width = carets.len() - detail.len();
            let detail = detail.trim();
            // Of many messages the detail says the title again, with a name.
            let (number, title) = match last.text.split_once("] ") {
                Some((number, title)) if number.starts_with('[') => (format!("{number}] "), title),
                _ => (String::new(), last.text.as_str()),
            };
            if detail.starts_with(title) {
                last.text = format!("{number}{detail}");
            } else if !detail.is_empty() {
                last.text = format!("{}: {detail}", last.text);
            }
        } else if let Some((place, text)) = line.split_once(&old) {
            let (file, number) = place.rsplit_once('(').unwrap_or((place, "0"));
            let text = text.split_once(": ").map_or(text, |(_, text)| text).to_owned();
            let line = number.parse().unwrap_or(0);
            diagnostics.push(CompilerDiagnostic::at_line(file, line, text));
            notes_belong = true;
        } else if let Some((place, text)) = line.split_once("): note")
            && let Some((file, number)) = place.rsplit_once('(')
            && let Some(last) = diagnostics.last_mut().filter(|_| notes_belong)
        {
            let text = text.split_once(": ").map_or(text, |(_, text)| text);
            last.notes.push(format!("{file}:{number}: {}", text.trim()));
        } else if line.contains(&other_old) {
            notes_belong = false;
        }
        continues_note = false;
    }
    diagnostics
}

/// Removes the extra spaces and empty parts of glslang's messages, `'name' :  what is wrong`.
fn normalize_text(text: &str) -> String {
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    words.trim_start_matches("'' : ").replace(" : ", ": ")
}

/// The bytes of a line from a column on; the whole line without its indentation where the column
/// is unknown (0).
fn span(text: &Arc<str>, line: usize, column: usize, width: usize) -> Range<usize> {
    let mut start = 0;
    for (number, content) in text.split_inclusive('\n').enumerate() {
        if number + 1 == line {
            let content = content.trim_end();
            let indent = content.len() - content.trim_start().len();
            if column == 0 {
                return start + indent..start + content.len();
            }
            let at = |characters: usize| {
                content.char_indices().nth(characters).map_or(content.len(), |(offset, _)| offset)
            };
            return start + at(column - 1)..start + at(column - 1 + width.max(1));
        }
        start += content.len();
    }
    text.len()..text.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glslang_logs() {
        let log = "ERROR: 0:12: 'x' :  undeclared identifier \n\
                   ERROR: a/b.glsl:3: '' :  syntax error, unexpected SEMICOLON\n\
                   ERROR: 0:7:5: 'y' : redefinition\n\
                   ERROR: 0:7:9: '' : compilation terminated \n\
                   ERROR: 2 compilation errors.  No code generated.\n";
        let diagnostics = glslang(log, Severity::Error);
        let short: Vec<_> =
            diagnostics.iter().map(|c| (c.file.as_str(), c.line, c.column, c.text.as_str())).collect();
        assert_eq!(
            short,
            [
                ("", 12, 0, "'x': undeclared identifier"),
                ("a/b.glsl", 3, 0, "syntax error, unexpected SEMICOLON"),
                ("", 7, 5, "'y': redefinition"),
            ]
        );
    }

    #[test]
    fn a_list_belongs_to_the_error_before_it() {
        let log = "ERROR: 0:2:2: '#include' : required extension not requested: Possible extensions include:\n\
                   GL_GOOGLE_include_directive\nGL_ARB_shading_language_include\n\
                   ERROR: 0:2:2: '#include' : must be followed by a header name\nno list\n\
                   ERROR: 2 compilation errors.  No code generated.\n\nSPIR-V is not generated\n";
        let texts: Vec<_> =
            glslang(log, Severity::Error).into_iter().map(|diagnostic| diagnostic.text).collect();
        let extensions = "GL_GOOGLE_include_directive, GL_ARB_shading_language_include";
        let first = format!(
            "'#include': required extension not requested: Possible extensions include: {extensions}"
        );
        assert_eq!(texts, [first.as_str(), "'#include': must be followed by a header name"]);
    }

    #[test]
    fn glslc_output() {
        let output = "a.rmiss:4: error: 'blue' : undeclared identifier\na.rmiss:9: warning: odd\n\
                      1 error generated.\nglslc: error: 'b.frag': failed to read\n";
        let diagnostics = glslc(output, Severity::Error);
        assert_eq!(diagnostics.len(), 2);
        assert_eq!((diagnostics[0].file.as_str(), diagnostics[0].line), ("a.rmiss", 4));
        assert_eq!(diagnostics[0].text, "'blue': undeclared identifier");
        assert_eq!(diagnostics[1].line, 0);
    }

    #[test]
    fn slangc_output_new_and_old() {
        let output = "warning[E1]: odd\n --> a.slang:1:1\n  |\n1 | x\n  | ^ odd\n\
                      error[E30027]: member not found\n --> e.slang:3:56\n  |\n3 | a b\n  |   ^^ 'd' is not a member.\n--'\n";
        let diagnostic = &slangc(output, Severity::Error)[0];
        assert_eq!(slangc(output, Severity::Error).len(), 1);
        assert_eq!((diagnostic.file.as_str(), diagnostic.line, diagnostic.column), ("e.slang", 3, 56));
        assert_eq!(
            (diagnostic.width, diagnostic.text.as_str()),
            (2, "member not found: 'd' is not a member.")
        );
        let old = &slangc("e.slang(3): error 30027: 'd' is not a member of 'P'.\n", Severity::Error)[0];
        assert_eq!(
            (old.file.as_str(), old.line, old.text.as_str()),
            ("e.slang", 3, "'d' is not a member of 'P'.")
        );
    }

    #[test]
    fn notes_of_slangc_belong_to_the_message_before_them() {
        let output = "warning[E1]: odd\n --> a.slang:1:1\n  |\n1 | x\n  | ^ odd\n\
                      note: of the warning\n --> a.slang:7:1\n--'\n\
                      error[E36107]: unavailable features\n --> a.slang:4:45\n  |\n4 | x\n  | ^ entry point 'main'\n--'\n\
                      note: see using of 'discard'\n --> a.slang:4:54\n  |\n4 | x\n  | ^^^^^^^\n--'\n\
                      note[E2]: see definition of 'discard'\n--> hlsl.meta.slang:19968:6\n-'\n\
                      error[E3]: wrong\n --> b.slang:3:5\n";
        let found = slangc(output, Severity::Error);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].text.as_str(), found[0].width), ("unavailable features: entry point 'main'", 1));
        assert_eq!(
            found[0].notes,
            ["a.slang:4:54: see using of 'discard'", "hlsl.meta.slang:19968:6: see definition of 'discard'"]
        );
        assert!(found[1].notes.is_empty());
        let old = "e.slang(3): error 30027: 'd' is not a member of 'P'.\ne.slang(1): note 2: see declaration of 'P'\n\
                   e.slang(9): warning 1: odd\ne.slang(8): note 3: of the warning\n";
        assert_eq!(slangc(old, Severity::Error)[0].notes, ["e.slang:1: see declaration of 'P'"]);
        assert_eq!(slangc(old, Severity::Warning)[0].notes, ["e.slang:8: of the warning"]);
        // They are shown with their message.
        let source = Source::from_text("a.slang", "").unwrap();
        let shown =
            error(&source, Path::new(source.name()), slangc(output, Severity::Error), output).render();
        assert!(shown.contains("= a.slang:4:54: see using of 'discard'"), "{shown}");
        let told =
            warnings(&source, Path::new(source.name()), slangc(output, Severity::Warning))[0].to_string();
        assert_eq!(told, "a.slang:1:1: [E1] odd; a.slang:7:1: of the warning");
    }

    #[test]
    fn warnings_of_each_compiler() {
        let text = |found: Vec<CompilerDiagnostic>| -> Vec<String> {
            let source = Source::from_text("a.slang", "").unwrap();
            warnings(&source, Path::new(source.name()), found).iter().map(ToString::to_string).collect()
        };
        let output = "warning[E31000]: unknown attribute\n  --> b.hlsl:22:7\n   |\n22 | [[vk::x]]\n   |   ^^^^^ 'vk_x'\n---'\n\
                      error[E1]: wrong\n --> b.hlsl:9:9\n  |\n1 | x\n  | ^ not this\n";
        let twice = [output, output].concat();
        assert_eq!(
            text(slangc(&twice, Severity::Warning)),
            ["b.hlsl:22:7: [E31000] unknown attribute: 'vk_x'"]
        );
        let again = output.replace("^ 'vk_x'", "^ unknown attribute 'vk_x'");
        let wanted = ["b.hlsl:22:7: [E31000] unknown attribute 'vk_x'"];
        assert_eq!(text(slangc(&again, Severity::Warning)), wanted);
        let old = "b.slang(3): warning 30081: implicit conversion\n";
        assert_eq!(text(slangc(old, Severity::Warning)), ["b.slang:3: implicit conversion"]);
        let log =
            "WARNING: 0:3: '#extension' : extension not supported: GL_X\nERROR: 0:4: 'x' : undeclared\n";
        let wanted = "a.slang:3: '#extension': extension not supported: GL_X";
        assert_eq!(text(glslang(log, Severity::Warning)), [wanted]);
        let output = "a.rmiss:4: error: 'x' : undeclared\na.rmiss:9: warning: odd\n";
        assert_eq!(text(glslc(output, Severity::Warning)), ["a.rmiss:9: odd"]);
    }

    #[test]
    fn spans_count_characters_and_survive_any_number() {
        let text: Arc<str> = "a\n  é = b;\n".into();
        assert_eq!(span(&text, 2, 0, 0), 4..11);
        assert_eq!(span(&text, 2, 5, 1), 7..8);
        assert_eq!(span(&text, 2, 99, 9), 11..11);
        assert_eq!(span(&text, 99, 1, 1), 12..12);
    }
}
