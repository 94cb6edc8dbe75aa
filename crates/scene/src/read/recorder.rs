//! What parsers request while they read, noted for a schema.

use std::cell::RefCell;
use std::ops::Range;

use anyhit_base::sorted::SortedMap;

/// A JSON Schema, or a part of one.
pub type JsonSchema = serde_json::Value;

/// Makes the schema of a type.
pub type SchemaOf = fn(&mut SchemaProbe) -> JsonSchema;

/// Makes schemas; holds the definitions that they refer to.
#[derive(Debug, Default)]
pub struct SchemaProbe {
    pub(super) definitions: SortedMap<String, JsonSchema>,
}

/// What a parser requested while it read a probe.
#[derive(Debug, Default)]
pub struct RequestRecorder {
    pub(super) keys: RefCell<Vec<(Range<usize>, &'static str, Request)>>,
    pub(super) names: RefCell<Vec<(Range<usize>, Vec<&'static str>)>>,
    /// The tables whose keys are the user's names.
    pub(super) open: RefCell<Vec<Range<usize>>>,
    /// The values that were expected to have another type.
    pub(super) refused: RefCell<Vec<Range<usize>>>,
}

/// How a key was requested.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Request {
    pub schema: Option<SchemaOf>,
    pub required: bool,
}

impl RequestRecorder {
    /// A key of the table at a place was requested, perhaps as a type.
    pub(super) fn key(
        &self,
        table: &Range<usize>,
        key: &'static str,
        schema: Option<SchemaOf>,
        required: bool,
    ) {
        self.keys.borrow_mut().push((table.clone(), key, Request { schema, required }));
    }

    /// All keys of the table at a place were requested, whatever they are.
    pub(super) fn any_key(&self, table: &Range<usize>) {
        self.open.borrow_mut().push(table.clone());
    }

    /// A value of another type was expected at a place.
    pub(super) fn refused(&self, value: Range<usize>) {
        self.refused.borrow_mut().push(value);
    }

    /// The value at a place was read as one of some names.
    pub(super) fn names(&self, value: Range<usize>, names: &[&'static str]) {
        self.names.borrow_mut().push((value, names.to_vec()));
    }
}
