//! A TOML document that owns its text; the parse tree of the `toml` crate borrows it.
//!
//! Numbers keep their digits, because a float is rounded only where its type is known. Scenes have
//! hundreds of thousands of tables: ranges have 32 bits, and equal keys share their text.

use std::ops::Range;
use std::sync::Arc;

use rustc_hash::FxHashSet;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use anyhit_base::escape;
use anyhit_base::sorted::sort_by_key;

/// A value and its range in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct TomlNode {
    range: TextRange,
    /// The value.
    pub value: Toml,
}

/// A TOML value.
#[derive(Clone, Debug, PartialEq)]
pub enum Toml {
    /// A string.
    String(Box<str>),
    /// An integer: digits without `_` and prefix, and their base.
    Integer(Box<str>, u32),
    /// A float as Rust parses it.
    Float(Box<str>),
    /// `true` or `false`.
    Boolean(bool),
    /// A date or time, which no scene needs.
    Datetime,
    /// An array.
    Array(Vec<TomlNode>),
    /// A table in the order of its text.
    Table(Vec<TomlMember>),
}

/// A key with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct TomlMember {
    /// The key, control characters as escapes.
    pub key: Arc<str>,
    key_range: TextRange,
    /// The value.
    pub node: TomlNode,
}

/// A range of a text of less than 4 GiB.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TextRange {
    start: u32,
    end: u32,
}

impl TextRange {
    fn get(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

impl TomlNode {
    /// The bytes; for a table with a header, the header.
    pub fn range(&self) -> Range<usize> {
        self.range.get()
    }
}

impl TomlMember {
    /// Takes the instances or geometries of a scene, if it is these, and leaves none.
    pub(super) fn take_parts(&mut self) -> Option<Self> {
        let parts = match (&*self.key, &mut self.node.value) {
            ("instance", Toml::Array(elements)) => Toml::Array(std::mem::take(elements)),
            ("geometry", Toml::Table(members)) => Toml::Table(std::mem::take(members)),
            _ => return None,
        };
        let node = TomlNode { range: self.node.range, value: parts };
        Some(Self { key: self.key.clone(), key_range: self.key_range, node })
    }

    /// The bytes of the key.
    pub fn key_range(&self) -> Range<usize> {
        self.key_range.get()
    }
}

/// Makes the tree of a document, which may be parsed in pieces.
#[derive(Debug, Default)]
pub(super) struct TreeBuilder {
    keys: FxHashSet<Arc<str>>,
    /// Where the piece begins in the document.
    base: usize,
}

impl TreeBuilder {
    /// A builder of a piece that begins at this place of its document.
    pub(super) fn of_piece(base: usize) -> Self {
        Self { base, ..Self::default() }
    }

    /// The tree of a document or of a piece of it.
    pub(super) fn tree(&mut self, root: &Spanned<DeTable<'_>>) -> TomlNode {
        // The root has no range.
        let Toml::Table(members) = self.table(root.get_ref()) else { unreachable!("a table is one") };
        Self::root(members)
    }

    /// A root table.
    pub(super) fn root(members: Vec<TomlMember>) -> TomlNode {
        TomlNode { range: TextRange { start: 0, end: 0 }, value: Toml::Table(members) }
    }

    fn range(&self, range: Range<usize>) -> TextRange {
        let place = |at: usize| (self.base + at) as u32;
        TextRange { start: place(range.start), end: place(range.end) }
    }

    fn value(&mut self, value: &Spanned<DeValue<'_>>) -> TomlNode {
        let owned = match value.get_ref() {
            DeValue::String(text) => Toml::String(text.as_ref().into()),
            DeValue::Integer(digits) => Toml::Integer(digits.as_str().into(), digits.radix()),
            DeValue::Float(digits) => Toml::Float(digits.as_str().into()),
            DeValue::Boolean(flag) => Toml::Boolean(*flag),
            DeValue::Datetime(_) => Toml::Datetime,
            DeValue::Array(elements) => Toml::Array(elements.iter().map(|one| self.value(one)).collect()),
            DeValue::Table(entries) => self.table(entries),
        };
        TomlNode { range: self.range(value.span()), value: owned }
    }

    fn table(&mut self, entries: &DeTable<'_>) -> Toml {
        let mut members = Vec::with_capacity(entries.len());
        for (key, value) in entries {
            let (key_range, node) = (self.range(key.span()), self.value(value));
            members.push(TomlMember { key: self.key(&escape::controls(key.get_ref())), key_range, node });
        }
        sort_by_key(&mut members, |member| member.key_range.start);
        Toml::Table(members)
    }

    fn key(&mut self, key: &str) -> Arc<str> {
        if let Some(known) = self.keys.get(key) {
            return known.clone();
        }
        let key: Arc<str> = key.into();
        self.keys.insert(key.clone());
        key
    }
}

impl Toml {
    /// What it is, for messages.
    pub fn what(&self) -> &'static str {
        match self {
            Self::String(_) => "a string",
            Self::Integer(..) => "an integer",
            Self::Float(_) => "a float",
            Self::Boolean(_) => "a Boolean",
            Self::Datetime => "a date",
            Self::Array(_) => "an array",
            Self::Table(_) => "a table",
        }
    }
}
