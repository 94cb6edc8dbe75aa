//! A named table of a scene.

use serde_json::json;

use crate::read::recorder::{JsonSchema, SchemaProbe};
use crate::read::{Parse, Spanned, Table, TomlValue};

/// A named table; `None` where it has a mistake that is already reported.
#[derive(Clone, Debug)]
pub struct Entry<T> {
    /// Its name.
    pub name: Spanned<String>,
    /// Its content.
    pub content: Option<T>,
}

/// Named tables: keys are names.
#[derive(Debug)]
pub struct Entries<T>(pub Vec<Entry<T>>);

impl<T> Default for Entries<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Parse> Parse for Entries<T> {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        Some(Self(table.iter().map(|(name, value)| Entry { name, content: T::parse(value) }).collect()))
    }

    fn schema(probe: &mut SchemaProbe) -> JsonSchema {
        json!({ "type": "object", "additionalProperties": T::schema(probe) })
    }
}
