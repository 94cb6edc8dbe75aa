//! How a scene writes of device addresses: `address = ...` and `{ address_of = ... }`.

use crate::read::{Parse, Spanned, TomlValue};
use crate::tree::Toml;
use anyhit_engine::machine::DeviceMemory;

/// `{ address_of = "materials", offset = 16 }`
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AddressOf {
    /// A resource, or an acceleration structure by its own name.
    pub target: Spanned<String>,
    /// The distance in bytes from its beginning.
    pub offset: Spanned<u64>,
}

/// What a buffer says of its device address: `true`, `false` or a number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AddressChoice {
    /// Nothing: it has one where its address is written somewhere.
    #[default]
    Unsaid,
    /// It has one.
    Automatic,
    /// It must not have one.
    Never,
    /// It lies at this one.
    Given(Spanned<u64>),
}

impl Parse for AddressChoice {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if let Toml::Boolean(has) = value.toml() {
            return Some(if *has { Self::Automatic } else { Self::Never });
        }
        let given: Spanned<u64> = Spanned::parse(value)?;
        if let Err(error) = DeviceMemory::check_address(given.value) {
            return value.wrong(error);
        }
        Some(Self::Given(given))
    }
}
