//! The one error type of the crate, and the only place that renders diagnostics.
//!
//! An [`Error`] is one word. Its [`ErrorKind`] says whose mistake it is: `Invalid*` means that an
//! input breaks a rule (the message cites it), `Unsupported*` means a gap of this crate, `Trap`
//! means that a shader misbehaved while it ran, `Io` that a file could not be read or written. Of a
//! trap an error holds the [`Trap`], all that its report tells as data; of `Io` the error of the
//! operating system, as its [source](std::error::Error::source).

pub mod names;
mod place;
mod report;
mod stage;
mod trap;
mod trap_code;

use std::fmt;
use std::io;
use std::panic::{RefUnwindSafe, UnwindSafe};
use std::path::Path;
use std::sync::Arc;

use crate::error::place::{clamp_span, line_at};
use crate::escape;
use crate::style::Style;

use codespan_reporting::diagnostic::{Diagnostic, Label, LabelStyle, Severity};
use codespan_reporting::files::SimpleFile;
use codespan_reporting::term::termcolor::{self, Color, ColorSpec};
use codespan_reporting::term::{self, Styles, StylesWriter, WriteStyle};
use serde::{Deserialize, Serialize};

pub use place::{Place, SourceColumns};
pub use report::{ErrorClass, ErrorReport};
pub use stage::Stage;
pub use trap::IndexOperand;
pub use trap::{DescriptorElement, ShaderFrame, Trap, TrapOperands};
pub use trap_code::TrapCode;

/// Shorthand for a result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Whose mistake an [`Error`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A SPIR-V module breaks a rule of the specification.
    InvalidModule,
    /// A scene file, or a scene made through the API, breaks a rule.
    InvalidScene,
    /// A mesh file cannot be used.
    InvalidMesh,
    /// An image file cannot be used.
    InvalidImage,
    /// A recording of hits cannot be used.
    InvalidRecording,
    /// Shader source text did not compile.
    InvalidSource,
    /// A command line or an argument of the API makes no sense.
    InvalidArgument,
    /// A valid instruction, capability or type of a module that this crate does not run.
    UnsupportedModule,
    /// A valid feature of a file that this crate does not read.
    UnsupportedFile,
    /// A tool or feature that this build or machine lacks.
    UnsupportedTool,
    /// A shader misbehaved while it ran.
    Trap,
    /// The sanitizer denies what a shader does.
    Finding,
    /// An expectation did not hold.
    Expectation,
    /// The operating system refused.
    Io,
}

impl ErrorKind {
    /// What is to be done about this class of problem, where the message does not say it.
    #[must_use]
    pub fn help(self) -> Option<&'static str> {
        Some(match self {
            Self::InvalidModule => "the module is invalid: fix the shader or its compiler flags",
            Self::InvalidRecording => "docs/verify.md describes the format of recordings",
            Self::UnsupportedModule => "the module is valid; this is a limitation of anyhit",
            Self::UnsupportedFile => "the file is valid; this is a limitation of anyhit",
            Self::InvalidScene
            | Self::InvalidMesh
            | Self::InvalidImage
            | Self::InvalidSource
            | Self::InvalidArgument
            | Self::UnsupportedTool
            | Self::Trap
            | Self::Finding
            | Self::Expectation
            | Self::Io => return None,
        })
    }
}

/// Returns a note on how to enable a feature of this crate: in Cargo.toml, or on the command line.
pub fn feature_note(feature: &str) -> String {
    format!(
        "help: enable the feature `{feature}`: `features = [\"{feature}\"]` in Cargo.toml, or `cargo build --features {feature}`"
    )
}

/// Where a place of an error goes, in [`Error::relocated`].
#[derive(Clone, Debug)]
pub enum Relocation {
    /// It becomes another place.
    To(Place),
    /// It becomes a note.
    Note(String),
    /// It is left out.
    Nowhere,
}

/// An error of any part of the crate: kind, message, places and notes.
pub struct Error(Box<ErrorData>);

#[derive(Clone)]
struct ErrorData {
    kind: ErrorKind,
    message: String,
    places: Vec<(Place, String)>,
    notes: Vec<String>,
    /// Further mistakes found in the same run.
    others: Vec<Error>,
    /// How many more there were, which nothing keeps.
    not_shown: usize,
    /// Whether a limit of what is read is exceeded.
    is_limit: bool,
    /// What happened, of an error that tells of a trap.
    trap: Option<Box<Trap>>,
    /// The rule of the sanitizer that it is about, and whether it is only a warning.
    rule: Option<(&'static str, bool)>,
    /// The file of the module that it is about.
    module: Option<String>,
    /// What the operating system said.
    io: Option<Arc<io::Error>>,
}

// Nothing changes the error of the operating system that it keeps, so that a panic cannot leave it
// half changed.
impl UnwindSafe for Error {}
impl RefUnwindSafe for Error {}

impl Clone for Error {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl Error {
    /// An error of a kind with its one-line message. Characters that would end the line or are
    /// hidden, as names in it may have, become escapes.
    #[cold]
    #[must_use]
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self(Box::new(ErrorData {
            kind,
            message: escape::into_line(message.into()),
            places: Vec::new(),
            notes: Vec::new(),
            others: Vec::new(),
            not_shown: 0,
            is_limit: false,
            trap: None,
            rule: None,
            module: None,
            io: None,
        }))
    }

    /// An error of the operating system about a file, which it keeps as its
    /// [source](std::error::Error::source).
    #[cold]
    #[must_use]
    pub fn io(path: impl AsRef<Path>, source: io::Error) -> Self {
        Self::new(ErrorKind::Io, format!("{}: {source}", escape::path(&path.as_ref()))).caused_by(source)
    }

    /// The error of a trap, with the message of its code, or the beginning of that of an abort.
    #[doc(hidden)]
    #[cold]
    pub fn trapped(trap: Trap) -> Self {
        const MOST: usize = 1000;
        let message = match &trap.operands {
            TrapOperands::Abort { message } if !message.is_empty() => {
                let cut = message.char_indices().nth(MOST).map(|(end, _)| format!("{}...", &message[..end]));
                format!("the shader aborted: {}", cut.as_deref().unwrap_or(message))
            }
            _ => trap.code.message().to_owned(),
        };
        let mut error = Self::new(ErrorKind::Trap, message);
        error.0.trap = Some(Box::new(trap));
        error
    }

    /// Several errors as one; the first gives kind and message. Empty input is a bug of the caller.
    #[doc(hidden)]
    #[cold]
    pub fn several(errors: Vec<Self>) -> Self {
        let mut errors = errors.into_iter();
        let mut first = errors.next().expect("bug in anyhit: no errors to report");
        first.0.others.extend(errors);
        first
    }

    /// Says that there were so many more mistakes, which are not shown.
    #[must_use]
    pub fn and_more(mut self, count: usize) -> Self {
        self.0.not_shown += count;
        self
    }

    /// How many more mistakes there were that are not among [`Error::others`].
    #[must_use]
    pub fn not_shown(&self) -> usize {
        self.0.not_shown
    }

    /// Adds a place of the problem.
    #[must_use]
    pub fn at(self, place: Place) -> Self {
        self.at_with(place, "")
    }

    /// Adds a place of the problem, unless a place is known already.
    #[must_use]
    pub fn or_at(self, place: Place) -> Self {
        if self.0.places.is_empty() { self.at(place) } else { self }
    }

    /// Adds a place of the problem, with a label.
    #[must_use]
    pub fn at_with(mut self, place: Place, label: impl Into<String>) -> Self {
        self.0.places.push((place, escape::into_line(label.into())));
        self
    }

    /// Adds a note in one line: a rule's number, a hint, a value. Characters that would end the
    /// line or are hidden become escapes.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.0.notes.push(escape::into_line(note.into()));
        self
    }

    /// Adds a note of several lines, which are escaped by themselves: a list, a table, a
    /// comparison. None of them begins with a command to the runner of a workflow.
    #[doc(hidden)]
    #[must_use]
    pub fn note_lines(mut self, lines: impl Into<String>) -> Self {
        let lines = lines.into();
        self.0.notes.push(escape::text(&lines, false).into_owned());
        self
    }

    /// Prefixes the message with a context: `"while reading a.toml"`.
    #[must_use]
    pub fn context(mut self, context: impl fmt::Display) -> Self {
        self.0.message = escape::into_line(format!("{context}: {}", self.0.message));
        self
    }

    /// Adds the error of the operating system that is behind it.
    #[doc(hidden)]
    #[must_use]
    pub fn caused_by(mut self, source: io::Error) -> Self {
        self.0.io = Some(Arc::new(source));
        self
    }

    /// Replaces its places and those of the errors that were found with it; labels stay.
    #[doc(hidden)]
    #[must_use]
    pub fn relocated(mut self, relocate: &dyn Fn(Place) -> Relocation) -> Self {
        for (place, label) in std::mem::take(&mut self.0.places) {
            match relocate(place) {
                Relocation::To(place) => self.0.places.push((place, label)),
                Relocation::Note(note) => self.0.notes.push(note),
                Relocation::Nowhere => {}
            }
        }
        self.0.others =
            std::mem::take(&mut self.0.others).into_iter().map(|one| one.relocated(relocate)).collect();
        self
    }

    /// Says which rule of the sanitizer it is about, and whether it is only a warning.
    #[doc(hidden)]
    #[must_use]
    pub fn with_rule(mut self, rule: &'static str, is_warning: bool) -> Self {
        self.0.rule = Some((rule, is_warning));
        self
    }

    /// Says which file holds the module that it is about.
    #[doc(hidden)]
    #[must_use]
    pub fn in_module(mut self, file: impl Into<String>) -> Self {
        self.0.module = Some(escape::into_line(file.into()));
        self
    }

    /// Returns the file of the module that it is about, where that is known.
    #[doc(hidden)]
    #[must_use]
    pub fn module(&self) -> Option<&str> {
        self.0.module.as_deref()
    }

    /// Changes the trap that it tells of; does nothing where it tells of none.
    #[doc(hidden)]
    #[must_use]
    pub fn with_trap(mut self, change: impl FnOnce(&mut Trap)) -> Self {
        if let Some(trap) = self.0.trap.as_deref_mut() {
            change(trap);
        }
        self
    }

    /// The trap: its code, the shader and its line, the launch index, the values that caused it and
    /// the stack of shader calls. `None` for an error of any other kind.
    #[must_use]
    pub fn trap(&self) -> Option<&Trap> {
        self.0.trap.as_deref()
    }

    /// Whose mistake it is.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        self.0.kind
    }

    /// Says that a limit of what is read is exceeded.
    #[doc(hidden)]
    #[must_use]
    pub fn of_limit(mut self) -> Self {
        self.0.is_limit = true;
        self
    }

    /// An error of a class, about whose cause everything is told already.
    #[doc(hidden)]
    #[cold]
    pub fn of_class(class: ErrorClass, message: impl Into<String>) -> Self {
        // Of each class a kind without a help of its own.
        let kind = match class {
            ErrorClass::Expectation => ErrorKind::Expectation,
            ErrorClass::Trap => ErrorKind::Trap,
            ErrorClass::Finding => ErrorKind::Finding,
            ErrorClass::Unsupported => ErrorKind::UnsupportedTool,
            ErrorClass::Limit => return Self::new(ErrorKind::InvalidScene, message).of_limit(),
            ErrorClass::Other => ErrorKind::InvalidScene,
        };
        Self::new(kind, message)
    }

    /// The class, which the exit code tells; that of the first of several errors.
    #[doc(hidden)]
    pub fn class(&self) -> ErrorClass {
        match self.0.kind {
            _ if self.0.is_limit => ErrorClass::Limit,
            ErrorKind::Expectation => ErrorClass::Expectation,
            ErrorKind::Trap => ErrorClass::Trap,
            ErrorKind::Finding => ErrorClass::Finding,
            ErrorKind::UnsupportedModule | ErrorKind::UnsupportedFile | ErrorKind::UnsupportedTool => {
                ErrorClass::Unsupported
            }
            _ => ErrorClass::Other,
        }
    }

    /// The one-line message, without places and notes.
    #[must_use]
    pub fn message(&self) -> &str {
        &self.0.message
    }

    /// The places, most important first, each with its label.
    #[must_use]
    pub fn places(&self) -> impl Iterator<Item = (&Place, &str)> {
        self.0.places.iter().map(|(place, label)| (place, label.as_str()))
    }

    /// The notes in order.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.0.notes
    }

    /// Further errors that were found in the same run.
    #[must_use]
    pub fn others(&self) -> &[Error] {
        &self.0.others
    }

    /// The whole report as plain text, as the command line prints it.
    ///
    /// ```
    /// use anyhit::{Error, ErrorKind};
    ///
    /// let error = Error::new(ErrorKind::InvalidArgument, "`--pixel 9` is not X,Y");
    /// assert!(error.render().starts_with("error: `--pixel 9` is not X,Y"));
    /// ```
    #[must_use]
    pub fn render(&self) -> String {
        let styles = Styles::no_color();
        let mut writer = termcolor::NoColor::new(Vec::new());
        self.render_to(&mut StylesWriter::new(&mut writer, &styles));
        // Lines of sources are shown as well.
        escape::text(&String::from_utf8_lossy(&writer.into_inner()), false).into_owned()
    }

    /// The whole report with the escape sequences of ANSI terminals for colour.
    #[must_use]
    pub fn render_coloured(&self) -> String {
        let styles = styles();
        let mut writer = termcolor::Ansi::new(Vec::new());
        self.render_to(&mut StylesWriter::new(&mut writer, &styles));
        escape::text(&String::from_utf8_lossy(&writer.into_inner()), true).into_owned()
    }

    fn render_to(&self, writer: &mut impl WriteStyle) {
        self.render_one(writer);
        for other in &self.0.others {
            // Writing to a vector does not fail.
            let _ = writeln!(writer);
            other.render_to(writer);
        }
        if self.0.not_shown > 0 {
            let _ = writeln!(writer);
            let _ = writeln!(writer, "error: {} more errors are not shown", self.0.not_shown);
        }
    }

    fn render_one(&self, writer: &mut impl WriteStyle) {
        let mut notes = Vec::new();
        let mut labels = Vec::new();
        let mut file = SimpleFile::new(String::new(), Arc::<str>::from(""));
        for (place, label) in &self.0.places {
            let suffix = if label.is_empty() { String::new() } else { format!(": {label}") };
            match place {
                Place::Text { file: name, text, span } => {
                    let name = escape::line(name).into_owned();
                    let same = labels.is_empty() || (*file.name() == name && file.source() == text);
                    if same {
                        let style =
                            if labels.is_empty() { LabelStyle::Primary } else { LabelStyle::Secondary };
                        file = SimpleFile::new(name, text.clone());
                        labels.push(Label::new(style, (), clamp_span(span, text)).with_message(label));
                    } else {
                        let line = line_at(text, span.start);
                        notes.push(format!("at {name}:{line}{suffix}"));
                    }
                }
                Place::Word(offset) => {
                    let module = self.module().unwrap_or("the module");
                    notes.push(format!("at word {offset} of {module}{suffix}"));
                }
                Place::Line { file, line, column } => {
                    let file = escape::line(file);
                    let column = if *column > 0 { format!(":{column}") } else { String::new() };
                    notes.push(format!("at {file}:{line}{column}{suffix}"));
                }
                Place::File(path) => notes.push(format!("in {}{suffix}", escape::path(&path))),
            }
        }
        if let Some(module) = self.module()
            && !self.places().any(|(place, _)| matches!(place, Place::Word(_)))
        {
            notes.push(format!("in module {module}"));
        }
        notes.extend(self.0.notes.iter().cloned());
        // A limit is no gap: its note says how to raise it.
        let has_help = self.0.is_limit || self.0.notes.iter().any(|note| note.starts_with("help: "));
        let help = self.0.kind.help().filter(|_| !has_help);
        notes.extend(help.map(|help| format!("help: {help}")));
        let (code, severity) = match self.0.rule {
            Some((rule, is_warning)) => (rule, if is_warning { Severity::Warning } else { Severity::Error }),
            None => ("", Severity::Error),
        };
        let mut diagnostic = Diagnostic::new(severity);
        if !code.is_empty() {
            diagnostic = diagnostic.with_code(code);
        }
        let diagnostic = diagnostic.with_message(&self.0.message).with_labels(labels).with_notes(notes);
        let config = term::Config::default();
        if term::emit_to_write_style(writer, &config, &file, &diagnostic).is_err() {
            let _ = writeln!(writer, "error: {}", self.0.message);
        }
    }
}

/// The styles of the parts of a report.
fn styles() -> Styles {
    let spec = |style: Style, is_bold: bool| {
        let mut spec = ColorSpec::new();
        spec.set_fg(style.colour().map(Color::Ansi256)).set_bold(is_bold);
        spec
    };
    let (bad, warning, name) = (Style::Bad, Style::Warning, Style::Name);
    Styles {
        header_bug: spec(bad, true),
        header_error: spec(bad, true),
        header_warning: spec(warning, true),
        header_message: spec(Style::Strong, true),
        primary_label_bug: spec(bad, false),
        primary_label_error: spec(bad, false),
        primary_label_warning: spec(warning, false),
        secondary_label: spec(name, false),
        line_number: spec(name, false),
        source_border: spec(name, false),
        note_bullet: spec(name, false),
        ..Styles::no_color()
    }
}

/// What a compiler warns of: it keeps nothing from running, but a shader may mean something else
/// than its author thinks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Warning {
    /// The file, as the compiler names it.
    pub file: String,
    /// The line, from 1; 0 if unknown.
    pub line: u32,
    /// The column, from 1; 0 if unknown.
    pub column: u32,
    /// The message, in one line.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&escape::line(&self.file))?;
        for number in [self.line, self.column].into_iter().take_while(|&number| number > 0) {
            write!(f, ":{number}")?;
        }
        write!(f, ": {}", escape::line(&self.message))
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.message)?;
        for (place, _) in &self.0.places {
            match place {
                Place::Word(offset) => write!(f, " (at word {offset})")?,
                Place::Line { file, line, .. } => write!(f, " (at {}:{line})", escape::line(file))?,
                Place::Text { file, text, span } => {
                    let line = line_at(text, span.start);
                    write!(f, " (at {}:{line})", escape::line(file))?;
                }
                Place::File(path) => write!(f, " (in {})", escape::path(&path))?,
            }
        }
        for note in &self.0.notes {
            write!(f, "; {note}")?;
        }
        Ok(())
    }
}

/// Prints the whole report, so that a failing `unwrap` in a test is readable.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render())
    }
}

impl std::error::Error for Error {
    /// The [`io::Error`] of what the operating system refused; `None` for an error of any other
    /// kind, and where the system was not asked.
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.io.as_deref().map(|source| source as _)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A class whose help would only say the message again has none.
    #[test]
    fn help_is_there_where_it_helps() {
        for kind in [ErrorKind::InvalidScene, ErrorKind::Trap, ErrorKind::Expectation, ErrorKind::Io] {
            assert!(!Error::new(kind, "wrong").render().contains("help:"), "{kind:?}");
        }
        let gap = Error::new(ErrorKind::UnsupportedModule, "no such capability").render();
        assert!(gap.contains("help: the module is valid; this is a limitation of anyhit"), "{gap}");
    }

    #[test]
    fn classes_have_names_and_exit_codes() {
        let class = |kind| Error::new(kind, "x").class();
        for (class, name, code) in [
            (class(ErrorKind::Expectation), "expectation", 1),
            (class(ErrorKind::InvalidScene), "error", 2),
            (class(ErrorKind::Io), "error", 2),
            (class(ErrorKind::Trap), "trap", 3),
            (class(ErrorKind::Finding), "finding", 6),
            (class(ErrorKind::UnsupportedModule), "unsupported", 4),
            (class(ErrorKind::UnsupportedFile), "unsupported", 4),
            (class(ErrorKind::UnsupportedTool), "unsupported", 4),
            (Error::new(ErrorKind::InvalidScene, "x").of_limit().class(), "limit", 5),
        ] {
            assert_eq!((class.name(), class.exit_code()), (name, code));
        }
        for class in [
            ErrorClass::Expectation,
            ErrorClass::Trap,
            ErrorClass::Finding,
            ErrorClass::Unsupported,
            ErrorClass::Limit,
            ErrorClass::Other,
        ] {
            assert_eq!(Error::of_class(class, "a test could not run").class(), class);
        }
    }

    #[test]
    fn an_error_is_one_word() {
        assert_eq!(size_of::<Error>(), size_of::<usize>());
        assert_eq!(size_of::<Result<()>>(), size_of::<usize>());
    }

    #[test]
    fn the_error_of_the_operating_system_is_the_source() {
        use std::error::Error as _;

        let denied = || io::Error::from(io::ErrorKind::PermissionDenied);
        let error = Error::io("a.spv", denied()).context("while reading a.toml").clone();
        let source = error.source().and_then(|source| source.downcast_ref::<io::Error>());
        assert_eq!(source.map(io::Error::kind), Some(io::ErrorKind::PermissionDenied));
        assert_eq!(error.message(), format!("while reading a.toml: a.spv: {}", denied()));
        assert!(error.trap().is_none());
        assert!(Error::new(ErrorKind::InvalidScene, "x").source().is_none());
    }

    #[test]
    fn an_error_keeps_its_trap_through_contexts_and_in_json() {
        let error = Error::trapped(Trap::new(TrapCode::NullMiss));
        assert_eq!(error.message(), TrapCode::NullMiss.message());
        let error = error.context("a shader trapped").note("a note");
        assert_eq!(error.trap().map(|trap| trap.code), Some(TrapCode::NullMiss));
        let json = serde_json::to_value(ErrorReport::of(&error)).unwrap();
        assert_eq!(json["trap"]["code"], "null_miss");
        let other = ErrorReport::of(&Error::new(ErrorKind::InvalidScene, "x"));
        assert!(serde_json::to_value(other).unwrap().get("trap").is_none());
    }

    #[test]
    fn a_text_place_is_shown_with_line_and_caret() {
        let error = Error::new(ErrorKind::InvalidScene, "unknown key `radus`").at_with(
            Place::Text { file: "a.toml".into(), text: "version = 1\nradus = 2\n".into(), span: 12..17 },
            "did you mean `radius`?",
        );
        let text = error.render();
        assert!(text.contains("a.toml:2:1"), "{text}");
        assert!(text.contains("^^^^^ did you mean `radius`?"), "{text}");
    }

    #[test]
    fn a_module_is_named_once() {
        let error = || Error::new(ErrorKind::Finding, "x").in_module("sky.spv");
        let count = |error: Error| error.render().matches("sky.spv").count();
        let text = error().render();
        assert!(text.contains("in module sky.spv"), "{text}");
        let text = error().at(Place::Word(7)).render();
        assert!(text.contains("at word 7 of sky.spv"), "{text}");
        assert_eq!((count(error()), count(error().at(Place::Word(7)))), (1, 1));
    }

    #[test]
    fn colour_adds_escapes_and_nothing_else() {
        let error = Error::new(ErrorKind::InvalidScene, "unknown key `radus`").note("a note");
        let mut bare = String::new();
        let mut rest = error.render_coloured();
        while let Some(at) = rest.find('\u{1b}') {
            let end = at + rest[at..].find('m').expect("an escape ends with `m`") + 1;
            bare.push_str(&rest[..at]);
            rest = rest.split_off(end);
        }
        assert_ne!(bare, "");
        assert_eq!(bare + &rest, error.render());
        assert!(!error.render().contains('\u{1b}'));
    }

    #[test]
    fn spans_outside_the_text_do_not_panic() {
        let place = Place::Text { file: "a".into(), text: "\u{e9}".into(), span: 1..99 };
        let error = Error::new(ErrorKind::InvalidScene, "x").at(place);
        assert!(!error.render().is_empty());
        assert!(!error.to_string().is_empty());
    }
}
