//! A TOML document that owns its text; the parse tree of the `toml` crate borrows it.
//!
//! Numbers keep their digits, because a float is rounded only where its type is known.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::escape;
use crate::sorted::sort_by_key;

/// A value and its range in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct TomlNode {
    /// The bytes; for a table with a header, the header.
    pub range: Range<usize>,
    /// The value.
    pub value: Toml,
}

/// A TOML value.
#[derive(Clone, Debug, PartialEq)]
pub enum Toml {
    /// A string.
    String(String),
    /// An integer: digits without `_` and prefix, and their base.
    Integer(String, u32),
    /// A float as Rust parses it.
    Float(String),
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
    pub key: String,
    /// The bytes of the key.
    pub key_range: Range<usize>,
    /// The value.
    pub node: TomlNode,
}

impl TomlNode {
    /// The document with this root.
    pub fn from_table(root: &Spanned<DeTable<'_>>) -> Self {
        Self { range: root.span(), value: table(root.get_ref()) }
    }

    fn from_value(value: &Spanned<DeValue<'_>>) -> Self {
        let owned = match value.get_ref() {
            DeValue::String(text) => Toml::String(text.to_string()),
            DeValue::Integer(digits) => Toml::Integer(digits.as_str().to_string(), digits.radix()),
            DeValue::Float(digits) => Toml::Float(digits.as_str().to_string()),
            DeValue::Boolean(flag) => Toml::Boolean(*flag),
            DeValue::Datetime(_) => Toml::Datetime,
            DeValue::Array(elements) => Toml::Array(elements.iter().map(Self::from_value).collect()),
            DeValue::Table(entries) => table(entries),
        };
        Self { range: value.span(), value: owned }
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

fn table(entries: &DeTable<'_>) -> Toml {
    let member = |(key, value): (&Spanned<std::borrow::Cow<'_, str>>, _)| TomlMember {
        key: escape::controls(key.get_ref()).into_owned(),
        key_range: key.span(),
        node: TomlNode::from_value(value),
    };
    let mut members: Vec<TomlMember> = entries.iter().map(member).collect();
    sort_by_key(&mut members, |member| member.key_range.start);
    Toml::Table(members)
}
