//! Data whose bytes depend on device addresses, which are known only when the sizes of all data
//! are.

use std::fmt;
use std::sync::Arc;

use crate::address_entry::AddressOf;
use crate::addresses::Addresses;
use crate::read::Span;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_engine::machine::Buffer;

/// The bytes of an address.
const ADDRESS_SIZE: usize = 8;

#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    Bytes(Vec<u8>),
    Align(u32),
    /// An address, so many times.
    Address(AddressOf, u32),
}

/// The data of a resolved scene: bytes, with addresses between them.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Data {
    parts: Vec<Part>,
    /// The size that zeros fill up to, and where the scene says it.
    size: Option<(u64, Place)>,
    /// Whether its size alone is given.
    unfilled: bool,
}

/// Bytes, and the addresses in them with their places, ascending.
pub type Flattened = (Vec<u8>, Vec<(usize, AddressOf)>);

/// The number of bytes that are given, and the size where it is said.
impl fmt::Debug for Data {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = |part: &Part| if let Part::Bytes(bytes) = part { bytes.len() } else { 0 };
        let given: usize = self.parts.iter().map(bytes).sum();
        f.debug_struct("Data")
            .field("given_bytes", &given)
            .field("size", &self.size.as_ref().map(|(size, _)| size))
            .finish_non_exhaustive()
    }
}

impl From<Vec<u8>> for Data {
    fn from(bytes: Vec<u8>) -> Self {
        Self { parts: vec![Part::Bytes(bytes)], ..Self::default() }
    }
}

impl Data {
    /// The bytes, where there are no addresses in them and no zeros behind them.
    pub fn bytes(&self) -> Option<&[u8]> {
        self.given().filter(|_| self.size.is_none())
    }

    /// The bytes that are given, where there are no addresses in them.
    fn given(&self) -> Option<&[u8]> {
        match self.parts.as_slice() {
            [] => Some(&[]),
            [Part::Bytes(bytes)] => Some(bytes),
            _ => None,
        }
    }

    /// A buffer of them.
    ///
    /// # Errors
    /// As [`Data::encode`].
    pub fn buffer(&self, addresses: &Addresses) -> Result<Arc<Buffer>> {
        let given = self.given();
        match (given, &self.size) {
            (Some(bytes), None) => Ok(Buffer::new(bytes)),
            (Some(bytes), Some((size, _))) if bytes.len() as u64 <= *size => {
                Ok(Buffer::with_size(bytes, *size as usize))
            }
            _ => self.encode(addresses).map(|bytes| Buffer::new(&bytes)),
        }
    }

    /// Data of which only the size is given: no host has filled it.
    pub(super) fn unfilled() -> Self {
        Self { unfilled: true, ..Self::default() }
    }

    /// Whether only its size is given, so that a host leaves the bytes undefined. Here they are
    /// zeros.
    pub fn is_unfilled(&self) -> bool {
        self.unfilled
    }

    /// Whether there is no data at all.
    pub fn is_empty(&self) -> bool {
        self.bytes().is_some_and(<[u8]>::is_empty) && self.size.is_none()
    }

    /// The bytes at the end that are known already, to append others to.
    pub(super) fn tail(&mut self) -> &mut Vec<u8> {
        if !matches!(self.parts.last(), Some(Part::Bytes(_))) {
            self.parts.push(Part::Bytes(Vec::new()));
        }
        match self.parts.last_mut() {
            Some(Part::Bytes(bytes)) => bytes,
            _ => unreachable!("bug in anyhit: the last part does not hold bytes"),
        }
    }

    /// Appends zeros up to a multiple of a number of bytes.
    pub(super) fn align(&mut self, to: u32) {
        match self.bytes().map(<[u8]>::len) {
            Some(size) => self.tail().resize(size.next_multiple_of(to as usize), 0),
            None => self.parts.push(Part::Align(to)),
        }
    }

    /// Appends an address so many times.
    pub(super) fn push_address(&mut self, of: AddressOf, repeat: u32) {
        self.parts.push(Part::Address(of, repeat));
    }

    /// Appends bytes in which addresses have these places, ascending.
    pub(super) fn append(&mut self, bytes: &[u8], addresses: &[(usize, AddressOf)]) {
        let mut done = 0;
        for (at, of) in addresses {
            // Members may share their bytes.
            if *at < done {
                continue;
            }
            self.tail().extend_from_slice(&bytes[done..*at]);
            self.push_address(of.clone(), 1);
            done = at + ADDRESS_SIZE;
        }
        self.tail().extend_from_slice(&bytes[done..]);
    }

    /// The bytes, zeros for addresses, and these with their places.
    pub(super) fn flattened(&self) -> Flattened {
        let (mut bytes, mut addresses) = (Vec::new(), Vec::new());
        for part in &self.parts {
            match part {
                Part::Bytes(more) => bytes.extend_from_slice(more),
                Part::Align(to) => bytes.resize(bytes.len().next_multiple_of(*to as usize), 0),
                Part::Address(of, repeat) => {
                    for _ in 0..*repeat {
                        addresses.push((bytes.len(), of.clone()));
                        bytes.resize(bytes.len() + ADDRESS_SIZE, 0);
                    }
                }
            }
        }
        (bytes, addresses)
    }

    /// Says how long it is, with zeros at its end.
    pub(super) fn pad_to(&mut self, size: u64, place: Place) {
        self.size = Some((size, place));
    }

    /// Where the first address is written.
    pub fn first_address(&self) -> Option<&Span> {
        self.parts.iter().find_map(|part| match part {
            Part::Address(of, _) => Some(&of.target.span),
            _ => None,
        })
    }

    /// Calls a function with everything whose address the data contains.
    pub fn targets<'a>(&'a self, found: &mut dyn FnMut(&'a AddressOf)) {
        for part in &self.parts {
            if let Part::Address(of, _) = part {
                found(of);
            }
        }
    }

    /// How many bytes it has.
    ///
    /// # Errors
    /// If the data is longer than its size.
    pub fn size(&self) -> Result<u64> {
        let mut size = 0_u64;
        for part in &self.parts {
            size = match part {
                Part::Bytes(bytes) => size.checked_add(bytes.len() as u64),
                Part::Align(to) => size.checked_next_multiple_of(u64::from(*to)),
                Part::Address(_, repeat) => size.checked_add(ADDRESS_SIZE as u64 * u64::from(*repeat)),
            }
            .ok_or_else(|| Error::new(ErrorKind::InvalidScene, "the data exceeds 2^64 bytes"))?;
        }
        match &self.size {
            None => Ok(size),
            Some((most, _)) if size <= *most => Ok(*most),
            Some((most, place)) => {
                let message = format!("the data has {size} bytes, more than the `size` of {most}");
                Err(Error::new(ErrorKind::InvalidScene, message).at(place.clone()))
            }
        }
    }

    /// Its bytes.
    ///
    /// # Errors
    /// Those of the addresses that it names.
    pub fn encode(&self, addresses: &Addresses) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        for part in &self.parts {
            match part {
                Part::Bytes(more) => bytes.extend_from_slice(more),
                Part::Align(to) => bytes.resize(bytes.len().next_multiple_of(*to as usize), 0),
                Part::Address(of, repeat) => {
                    bytes.extend(addresses.address(of)?.to_le_bytes().repeat(*repeat as usize));
                }
            }
        }
        if let Some((size, _)) = self.size {
            bytes.resize(size as usize, 0);
        }
        Ok(bytes)
    }
}
