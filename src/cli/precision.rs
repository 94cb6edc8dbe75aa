//! The argument `--precision`, which several commands take.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use anyhit_engine::geometry::Precision;

/// Parses a precision, and lists them in the help.
pub(super) fn parser() -> impl TypedValueParser<Value = Precision> {
    PossibleValuesParser::new(Precision::ALL.map(Precision::name))
        .map(|name| Precision::ALL.into_iter().find(|one| one.name() == name).unwrap_or_default())
}
