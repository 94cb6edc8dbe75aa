//! A row of the table of what rspirv lacks of SPIR-V's grammar.

pub(super) use rspirv::grammar::OperandKind as Kind;

/// A name that rspirv's tables lack, or have with other requirements.
pub(super) struct Entry {
    pub(super) number: u32,
    pub(super) name: &'static str,
    pub(super) capabilities: &'static [u32],
    pub(super) extensions: &'static [&'static str],
}

/// Creates a row of `grammar_delta`.
pub(super) const fn entry(
    number: u32,
    name: &'static str,
    capabilities: &'static [u32],
    extensions: &'static [&'static str],
) -> Entry {
    Entry { number, name, capabilities, extensions }
}
