//! Reads TOML with spans: every value knows its file and bytes, and an error does not stop reading,
//! so that one run reports all of them.
//!
//! It is not derived with serde, which stops at the first error. A [`Table`] records which keys are
//! requested. Keys that are never requested are unknown, and the suggestion for one of them is
//! chosen from the requested keys. So the list of accepted keys is written only once, in the code
//! that reads them.

mod brackets;
mod diagnostics;
mod key_homes;
mod pieces;
pub mod recorder;
mod schema;
mod unknown_name;
mod values;

use std::cell::RefCell;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use toml::de::DeTable;

use crate::files::sibling;
use crate::tree::{Toml, TomlMember, TomlNode, TreeBuilder};
use anyhit_base::error::names::nearest;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, contained};
use anyhit_base::sorted::SortedSet;

use brackets::first_in_bracket;
pub use diagnostics::Diagnostics;
pub(crate) use diagnostics::first_of;
use recorder::{JsonSchema, SchemaOf, SchemaProbe};
pub use unknown_name::unknown_name;
pub(crate) use values::integer;
pub use values::{OneOrMore, RawText};

/// A TOML file that has been read.
#[derive(Debug, PartialEq, Eq)]
pub struct TomlSource {
    /// Its path as the user or an `include` gave it.
    pub path: PathBuf,
    /// Its text.
    pub text: Arc<str>,
}

impl TomlSource {
    /// A path that the file names, relative to the file's own folder.
    pub fn sibling(&self, path: &str) -> PathBuf {
        sibling(&self.path, path)
    }
}

/// A range of a [`TomlSource`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Span {
    /// The file.
    pub source: Arc<TomlSource>,
    /// The bytes.
    pub range: Range<usize>,
}

impl Span {
    /// The span as a place of an error.
    pub fn place(&self) -> Place {
        Place::Text {
            file: escape::path(&self.source.path).to_string(),
            text: self.source.text.clone(),
            span: self.range.clone(),
        }
    }

    /// An `InvalidScene` error that points here.
    #[must_use]
    pub fn error(&self, message: impl Into<String>) -> Error {
        self.error_with(message, "")
    }

    /// An `InvalidScene` error that points here, with a label at the caret.
    #[must_use]
    pub fn error_with(&self, message: impl Into<String>, label: impl Into<String>) -> Error {
        Error::new(ErrorKind::InvalidScene, message).at_with(self.place(), label)
    }
}

/// A value with its span.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// Its span.
    pub span: Span,
}

/// A whole TOML document, kept so that parts of it can be read later.
#[derive(Clone, Debug)]
pub struct Document {
    source: Arc<TomlSource>,
    root: Arc<TomlNode>,
    /// The root with all members, parsed again once members are forgotten and asked for.
    whole: Option<Arc<OnceLock<TomlNode>>>,
}

impl Document {
    /// Parses a text.
    ///
    /// # Errors
    /// `InvalidScene` with the first syntax errors.
    pub fn parse(path: impl Into<PathBuf>, text: &str) -> Result<Self> {
        Self::parse_within(path, text, &InputLimits::default())
    }

    /// Parses a text; the limit `errors-shown` says how many syntax errors are shown.
    ///
    /// # Errors
    /// As [`Document::parse`].
    pub fn parse_within(
        path: impl Into<PathBuf>,
        text: impl Into<Arc<str>>,
        limits: &InputLimits,
    ) -> Result<Self> {
        let source = Arc::new(TomlSource { path: path.into(), text: text.into() });
        // The crate's own limit of nesting, 80 tables, keeps what recurses here short, too.
        let root = contained("toml", ErrorKind::InvalidScene, || Self::tree(&source, limits));
        match root {
            Ok(root) => Ok(Self { source, root: Arc::new(root), whole: None }),
            Err(error) => Err(error.or_at(Place::File(source.path.clone()))),
        }
    }

    /// Parses a large text whose members `geometry` and `instance` are taken piece by piece, and
    /// empty afterwards. `None` where it must be parsed as a whole, because of its size, or of
    /// mistakes or notes that go to `report`; what was taken does not count then.
    pub fn parse_apart(
        path: impl Into<PathBuf>,
        text: impl Into<Arc<str>>,
        report: &Diagnostics,
        take: &mut dyn FnMut(&str, TomlValue<'_>),
    ) -> Option<Self> {
        let source = Arc::new(TomlSource { path: path.into(), text: text.into() });
        u32::try_from(source.text.len()).ok()?;
        let mut take_member =
            |one: TomlMember| take(&one.key, TomlValue { node: &one.node, source: &source, report });
        let tree = || Ok(pieces::tree(&source.text, Some(&mut take_member)));
        let root = contained("toml", ErrorKind::InvalidScene, tree).ok()??;
        let is_clean = report.is_empty() && report.take_notes().is_empty();
        is_clean.then(|| Self { source, root: Arc::new(root), whole: None })
    }

    fn tree(source: &Arc<TomlSource>, limits: &InputLimits) -> Result<TomlNode> {
        if u32::try_from(source.text.len()).is_err() {
            return Err(Error::new(ErrorKind::InvalidScene, "the file has more than 4 GiB"));
        }
        if let Some(root) = pieces::tree(&source.text, None) {
            return Ok(root);
        }
        let (root, errors) = parse_table(&source.text);
        if errors.is_empty() {
            return Ok(TreeBuilder::default().tree(&root));
        }
        let start = |error: &toml::de::Error| error.span().map_or(0, |range| range.start);
        let report = |error: &toml::de::Error| {
            let range = error.span().unwrap_or(0..0);
            Span { source: source.clone(), range }.error(format!("not TOML: {}", error.message()))
        };
        // Where a bracket is open still, all that follows is read as if it stood in it: what is
        // wrong there is no mistake of its own. A key that is there twice is a mistake by itself,
        // wherever it stands.
        let is_duplicate = |error: &toml::de::Error| error.message().contains("duplicate key");
        let inside = first_in_bracket(&source.text, errors.iter().map(start))
            .filter(|inside| !is_duplicate(&errors[inside.error]));
        let errors = &errors[..inside.as_ref().map_or(errors.len(), |inside| inside.error + 1)];
        let most = usize::try_from(limits.get(InputLimit::ErrorsShown)).unwrap_or(usize::MAX).max(1);
        let mut shown: Vec<Error> = errors.iter().take(most).map(report).collect();
        if let Some(inside) = inside.filter(|_| shown.len() == errors.len())
            && let Some(last) = shown.pop()
        {
            let bracket = Span { source: source.clone(), range: inside.bracket..inside.bracket + 1 };
            let label = format!("this has no closing `{}`", inside.closing);
            shown.push(last.at_with(bracket.place(), label));
        }
        Err(Error::several(shown).and_more(errors.len().saturating_sub(most)))
    }

    /// The root table as it was parsed.
    pub fn node(&self) -> &TomlNode {
        let Some(whole) = &self.whole else { return &self.root };
        let parse = || Self::tree(&self.source, &InputLimits::default());
        whole.get_or_init(|| parse().unwrap_or_else(|_| (*self.root).clone()))
    }

    /// The root table as it was parsed, without what [`Document::forget`] has freed.
    pub fn read_node(&self) -> &TomlNode {
        &self.root
    }

    /// Frees members of the root table that have been read, which are large. [`Document::root`]
    /// lacks them from here on.
    pub fn forget(&mut self, keys: &[&str]) {
        if let Some(TomlNode { value: Toml::Table(members), .. }) = Arc::get_mut(&mut self.root) {
            members.retain(|member| !keys.contains(&&*member.key));
            self.whole.get_or_insert_default();
        }
    }

    /// The root table.
    pub fn root<'a>(&'a self, report: &'a Diagnostics) -> Table<'a> {
        let value = TomlValue { node: &self.root, source: &self.source, report };
        Table::new(value).expect("bug in anyhit: the root of a TOML document is not a table")
    }

    /// The file.
    pub fn source(&self) -> &Arc<TomlSource> {
        &self.source
    }
}

/// Parses a document or a piece of it.
fn parse_table(text: &str) -> (toml::Spanned<DeTable<'_>>, Vec<toml::de::Error>) {
    DeTable::parse_recoverable(text)
}

/// A type that can be read from a TOML value. `None` means that an error has been reported.
#[doc(hidden)]
pub trait Parse: Sized {
    /// Reads the value.
    fn parse(value: TomlValue<'_>) -> Option<Self>;

    /// The JSON Schema of the values that it reads.
    fn schema(probe: &mut SchemaProbe) -> JsonSchema {
        probe.of_parser::<Self>()
    }
}

/// A closed set of names, such as the filters of a sampler.
#[doc(hidden)]
pub trait Named: Copy + 'static {
    /// What such a name denotes, for messages.
    const WHAT: &'static str;
    /// All names.
    const NAMES: &'static [(&'static str, Self)];
}

/// A TOML value with its span.
#[derive(Clone, Copy, Debug)]
pub struct TomlValue<'a> {
    node: &'a TomlNode,
    source: &'a Arc<TomlSource>,
    report: &'a Diagnostics,
}

impl<'a> TomlValue<'a> {
    /// Its span.
    pub fn span(&self) -> Span {
        Span { source: self.source.clone(), range: self.node.range() }
    }

    /// The bare TOML value.
    pub fn toml(&self) -> &'a Toml {
        &self.node.value
    }

    /// The text of a string; `None`, without a report, if it is no string.
    pub fn text(&self) -> Option<&'a str> {
        match self.toml() {
            Toml::String(text) => Some(text),
            _ => None,
        }
    }

    /// Whether it is this word.
    pub fn is_word(&self, word: &'static str) -> bool {
        if let Some(recorder) = self.report.recorder() {
            recorder.names(self.node.range(), &[word]);
        }
        self.text() == Some(word)
    }

    /// The elements of an array; `None`, without a report, if it is no array.
    pub fn elements(&self) -> Option<impl Iterator<Item = TomlValue<'a>> + use<'a>> {
        let (source, report) = (self.source, self.report);
        let Toml::Array(elements) = self.toml() else { return None };
        Some(elements.iter().map(move |node| TomlValue { node, source, report }))
    }

    /// Reports that the value cannot be used; always `None`.
    pub fn wrong<T>(&self, message: impl Into<String>) -> Option<T> {
        self.report.push(self.span().error(message));
        None
    }

    /// Reports that something else was expected; always `None`.
    pub fn expected<T>(&self, what: &str) -> Option<T> {
        self.report_unexpected(what);
        None
    }

    fn report_unexpected(&self, wanted: &str) {
        let found = self.toml().what();
        if let Some(recorder) = self.report.recorder() {
            recorder.refused(self.node.range());
        }
        self.report.push(self.span().error_with(format!("expected {wanted}, found {found}"), "here"));
    }

    /// The report that mistakes go to.
    pub fn report(&self) -> &'a Diagnostics {
        self.report
    }

    /// The value as a document of its own.
    pub fn to_document(&self) -> Document {
        Document { source: self.source.clone(), root: Arc::new(self.node.clone()), whole: None }
    }

    /// A copy that owns its text.
    pub fn to_owned_value(&self) -> OwnedTomlValue {
        OwnedTomlValue { node: self.node.clone(), source: self.source.clone() }
    }
}

/// A value that owns its text, to be read later.
#[derive(Clone, Debug)]
pub struct OwnedTomlValue {
    node: TomlNode,
    source: Arc<TomlSource>,
}

impl OwnedTomlValue {
    /// Its span.
    pub fn span(&self) -> Span {
        Span { source: self.source.clone(), range: self.node.range() }
    }

    /// The value; mistakes go to a report.
    pub fn value<'a>(&'a self, report: &'a Diagnostics) -> TomlValue<'a> {
        TomlValue { node: &self.node, source: &self.source, report }
    }
}

/// A TOML table that records which keys are requested.
#[derive(Debug)]
pub struct Table<'a> {
    value: TomlValue<'a>,
    entries: &'a [TomlMember],
    requested: RefCell<SortedSet<&'static str>>,
    missing: RefCell<Vec<&'static str>>,
    /// Keys of which it was said already that they must not be here.
    refused: RefCell<SortedSet<&'a str>>,
}

impl<'a> Table<'a> {
    /// The value as a table; reports an error if it is none.
    pub fn new(value: TomlValue<'a>) -> Option<Self> {
        let Toml::Table(entries) = value.toml() else { return value.expected("a table") };
        Some(Self {
            value,
            entries,
            requested: RefCell::default(),
            missing: RefCell::default(),
            refused: RefCell::default(),
        })
    }

    /// The span of the table or of its header.
    pub fn span(&self) -> Span {
        self.value.span()
    }

    /// The report that mistakes go to.
    pub fn report(&self) -> &'a Diagnostics {
        self.value.report
    }

    /// The value of a key, if it is there.
    pub fn value(&self, key: &'static str) -> Option<TomlValue<'a>> {
        self.request(key, None, false);
        self.member(key)
    }

    /// Notes that a key is requested, perhaps as a type, and whether it must be there.
    fn request(&self, key: &'static str, schema: Option<SchemaOf>, required: bool) {
        self.requested.borrow_mut().insert(key);
        if let Some(recorder) = self.report().recorder() {
            recorder.key(&self.value.node.range(), key, schema, required);
        }
    }

    fn member(&self, key: &str) -> Option<TomlValue<'a>> {
        let member = self.entries.iter().find(|member| &*member.key == key)?;
        Some(TomlValue { node: &member.node, ..self.value })
    }

    /// The value of a key that must not be here, for a better message than that it is unknown.
    pub fn refused(&self, key: &str) -> Option<TomlValue<'a>> {
        let member = self.entries.iter().find(|member| &*member.key == key)?;
        self.refused.borrow_mut().insert(&member.key);
        Some(TomlValue { node: &member.node, ..self.value })
    }

    /// Whether a key is there. This does not count as a request.
    pub fn has(&self, key: &'static str) -> bool {
        if let Some(recorder) = self.report().recorder() {
            recorder.key(&self.value.node.range(), key, None, false);
        }
        self.has_name(key)
    }

    /// Whether a key is there that is no word of the format.
    pub fn has_name(&self, name: &str) -> bool {
        self.entries.iter().any(|member| &*member.key == name)
    }

    /// Reads a key that may be missing.
    pub fn optional<T: Parse>(&self, key: &'static str) -> Option<T> {
        self.request(key, Some(T::schema), false);
        T::parse(self.member(key)?)
    }

    /// Reads a key that has a default.
    pub fn or<T: Parse>(&self, key: &'static str, default: T) -> T {
        self.optional(key).unwrap_or(default)
    }

    /// Reads a key that must be there; [`Self::finish`] reports it if it is not.
    pub fn required<T: Parse>(&self, key: &'static str) -> Option<T> {
        self.request(key, Some(T::schema), true);
        match self.member(key) {
            Some(value) => T::parse(value),
            None => {
                self.missing.borrow_mut().push(key);
                None
            }
        }
    }

    /// All keys with their values, for tables whose keys are the user's names.
    pub fn iter(&self) -> impl Iterator<Item = (Spanned<String>, TomlValue<'a>)> + '_ {
        if let Some(recorder) = self.report().recorder() {
            recorder.any_key(&self.value.node.range());
        }
        self.members()
    }

    fn members(&self) -> impl Iterator<Item = (Spanned<String>, TomlValue<'a>)> + '_ {
        self.entries.iter().map(|member| {
            let span = Span { source: self.value.source.clone(), range: member.key_range() };
            (Spanned { value: member.key.to_string(), span }, TomlValue { node: &member.node, ..self.value })
        })
    }

    /// Reports every missing key, and every key that was not requested. Call it after the last
    /// request and before returning early because of a missing key.
    pub fn finish(&self) {
        let (requested, refused) = (self.requested.borrow(), self.refused.borrow());
        let known = |key: &str| requested.contains(key) || refused.contains(key);
        let unknown: Vec<_> = self.members().filter(|(key, _)| !known(&key.value)).collect();
        for key in self.missing.take() {
            // A misspelt key is reported once: the message for the unknown key suggests this one.
            // Among very many unknown keys that is not searched for.
            let misspelt = unknown.iter().take(SUGGESTED).map(|(name, _)| name.value.as_str());
            if nearest(key, misspelt).is_none() {
                self.report().push(self.span().error_with(format!("`{key}` is missing"), "in this table"));
            }
        }
        for (at, (key, _)) in unknown.iter().enumerate() {
            if self.report().is_full() {
                self.report().count(unknown.len() - at);
                break;
            }
            let suggestion = || nearest(&key.value, requested.iter().copied());
            let label = match key_homes::home_of(&key.value) {
                Some(home) => format!("`{}` belongs {home}", key.value),
                None => match suggestion() {
                    Some(suggestion) => format!("did you mean `{suggestion}`?"),
                    None => "not a key of this table".into(),
                },
            };
            let known: Vec<_> = requested.iter().copied().collect();
            self.report().push(
                key.span
                    .error_with(format!("unknown key `{}`", key.value), label)
                    .note(format!("valid keys: {}", known.join(", "))),
            );
        }
    }
}

/// Among how many unknown keys a missing one is searched for.
const SUGGESTED: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Filter {
        Nearest,
        Linear,
    }

    impl Named for Filter {
        const WHAT: &'static str = "filter";
        const NAMES: &'static [(&'static str, Self)] =
            &[("nearest", Self::Nearest), ("linear", Self::Linear)];
    }

    fn read<T>(text: &str, read: impl FnOnce(&Table<'_>) -> Option<T>) -> Result<T> {
        let document = Document::parse("t.toml", text)?;
        let report = Diagnostics::default();
        let table = document.root(&report);
        let value = read(&table);
        table.finish();
        drop(table);
        report.finish()?;
        Ok(value.expect("no mistake, yet no value"))
    }

    #[test]
    fn forgotten_members_are_parsed_again_where_they_are_asked_for() {
        let mut document = Document::parse("t.toml", "a = 1\n[b]\nc = 2\n").unwrap();
        let whole = document.node().clone();
        document.forget(&["b", "d"]);
        let report = Diagnostics::default();
        let root = document.root(&report);
        assert_eq!((root.has_name("a"), root.has_name("b")), (true, false));
        assert_eq!(*document.node(), whole);
    }

    #[test]
    fn a_float_is_rounded_once() {
        // 1 + 2^-24 + 2^-60 lies above the tie between 1 and 1 + 2^-23; an f64 loses the 2^-60 and
        // a second rounding of the tie then goes to the even 1.
        let text = "x = 1.000000059604644775391492261737988";
        assert_eq!(read(text, |t| t.required::<f32>("x")).unwrap(), 1.0 + f32::EPSILON);
    }

    #[test]
    fn an_f32_out_of_range_is_refused_but_inf_is_not() {
        assert!(read("x = 1e39", |t| t.required::<f32>("x")).unwrap_err().render().contains("t.toml:1:5"));
        assert_eq!(read("x = -inf", |t| t.required::<f32>("x")).unwrap(), f32::NEG_INFINITY);
        assert_eq!(read("x = 3.4028235e38", |t| t.required::<f32>("x")).unwrap(), f32::MAX);
    }

    #[test]
    fn hexadecimal_integers_cover_all_32_bits() {
        assert_eq!(read("x = 0xffff_ffff", |t| t.required::<u32>("x")).unwrap(), u32::MAX);
        assert!(read("x = 0x1_0000_0000", |t| t.required::<u32>("x")).is_err());
    }

    #[test]
    fn an_unknown_key_is_shown_with_a_suggestion() {
        let error = read("radus = 2\n", |t| Some(t.or("radius", 1.0_f32))).unwrap_err();
        let text = error.render();
        assert!(text.contains("t.toml:1:1"), "{text}");
        assert!(text.contains("^^^^^ did you mean `radius`?"), "{text}");
    }

    #[test]
    fn a_misspelt_required_key_is_one_mistake() {
        let error = read("radus = 2\n", |t| t.required::<f32>("radius")).unwrap_err();
        assert_eq!(error.others().len(), 0, "{error:?}");
        let error = read("other = 2\n", |t| t.required::<f32>("radius")).unwrap_err();
        assert_eq!(error.message(), "`radius` is missing");
        assert_eq!(error.others().len(), 1, "{error:?}");
    }

    #[test]
    fn every_mistake_of_an_array_is_reported() {
        let error = read("x = [1, 'a', 2, true]", |t| t.required::<Vec<f32>>("x")).unwrap_err();
        assert_eq!(error.message(), "expected a number, found a string");
        assert_eq!(error.others()[0].message(), "expected a number, found a Boolean");
    }

    #[test]
    fn of_many_mistakes_the_first_are_shown_and_all_counted() {
        let text: String = (0..20_000).map(|at| format!("key{at} = 1\n")).collect();
        let begin = std::time::Instant::now();
        let error = read(&text, |t| t.required::<f32>("radius")).unwrap_err();
        // The missing key is one of them.
        assert_eq!(1 + error.others().len() + error.not_shown(), 20_001);
        assert_eq!(error.others().len(), 49);
        let report = error.render();
        assert!(report.lines().count() < 1000, "{} lines", report.lines().count());
        assert!(report.contains("19951 more errors are not shown"), "{report}");
        // It took 4 s where each was rendered by itself from a text of 20,000 lines.
        assert!(begin.elapsed().as_secs_f64() < 2.0, "{:?}", begin.elapsed());
    }

    #[test]
    fn syntax_errors_are_capped_and_deep_nesting_is_refused() {
        let error = Document::parse("t.toml", &"x = = 1\n".repeat(5000)).unwrap_err();
        assert!(error.others().len() < 50, "{}", error.others().len());
        assert!(error.not_shown() > 4000, "{}", error.not_shown());
        let all = 1 + error.others().len() + error.not_shown();
        for (shown, wanted) in [(3, 3), (0, 1)] {
            let limits = InputLimits::default().with(InputLimit::ErrorsShown, shown);
            let error = Document::parse_within("t.toml", "x = = 1\n".repeat(5000), &limits).unwrap_err();
            assert_eq!((1 + error.others().len(), error.not_shown()), (wanted, all - wanted));
        }
        for deep in [
            format!("x = {}{}", "[".repeat(100_000), "]".repeat(100_000)),
            format!("x = {}1{}", "{ a = ".repeat(100_000), " }".repeat(100_000)),
            format!("{}x = 1", "a.".repeat(100_000)),
            format!("[{}x]", "a.".repeat(100_000)),
        ] {
            let error = Document::parse("t.toml", &deep).unwrap_err();
            assert!(error.message().starts_with("not TOML: "), "{}", error.message());
        }
    }

    #[test]
    fn names_are_suggested() {
        let error = read("x = 'liner'", |t| t.required::<Filter>("x")).unwrap_err();
        assert!(error.render().contains("did you mean `linear`?"), "{error:?}");
        assert_eq!(read("x = 'nearest'", |t| t.required::<Filter>("x")).unwrap(), Filter::Nearest);
    }

    #[test]
    fn broken_toml_shows_its_place() {
        let error = Document::parse("t.toml", "version = 1\nx = = 2\n").unwrap_err();
        assert!(error.render().contains("t.toml:2:"), "{error:?}");
        assert!(error.message().starts_with("not TOML: "));
    }
}
