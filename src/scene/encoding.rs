//! Data whose bytes depend on what is known only after modules are loaded: device addresses, and
//! whatever else a piece says in terms of a module.
//!
//! It is encoded in two phases: first the sizes of all data, then, when every buffer has its
//! address, the bytes.

use std::sync::Arc;

use crate::error::{Error, ErrorKind, Place, Result};
use crate::module::Module;
use crate::scene::addresses::Addresses;
use crate::scene::read::{Span, Spanned};

/// Gives the modules of a scene's shaders.
pub trait Modules {
    /// The module of a shader that the scene names, loaded once.
    ///
    /// # Errors
    /// What loading it reports, or that the scene has no such shader.
    fn module(&self, shader: &Spanned<String>) -> Result<Arc<Module>>;
}

/// What the second phase knows.
#[derive(Clone, Copy)]
pub struct Encoding<'a> {
    /// The modules of the scene's shaders.
    pub modules: &'a dyn Modules,
    /// The addresses of buffers and acceleration structures.
    pub addresses: &'a Addresses,
}

impl Encoding<'_> {
    /// The device address that a piece asks for.
    ///
    /// # Errors
    /// If its target is unknown or has no address, or the offset lies past its end.
    pub fn address(&self, of: &AddressOf) -> Result<u64> {
        self.addresses.address(of)
    }
}

/// `{ address_of = "materials", offset = 16 }`
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AddressOf {
    /// A resource, or an acceleration structure by its own name.
    pub target: Spanned<String>,
    /// The distance in bytes from its beginning.
    pub offset: Spanned<u64>,
}

/// A piece of data whose bytes are known late.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LatePiece {
    /// A device address, 8 bytes.
    Address(AddressOf),
}

impl LatePiece {
    /// The bytes of an address.
    const ADDRESS_SIZE: usize = 8;

    /// The first phase: how many bytes it has.
    fn size(&self, _modules: &dyn Modules) -> Result<u64> {
        match self {
            Self::Address(_) => Ok(8),
        }
    }

    /// The second phase: its bytes, as many as the first phase said.
    fn encode(&self, encoding: &Encoding<'_>) -> Result<Vec<u8>> {
        match self {
            Self::Address(of) => Ok(encoding.address(of)?.to_le_bytes().to_vec()),
        }
    }

    /// Calls a function with everything whose address it contains.
    fn targets<'a>(&'a self, found: &mut dyn FnMut(&'a AddressOf)) {
        match self {
            Self::Address(of) => found(of),
        }
    }

    fn span(&self) -> &Span {
        match self {
            Self::Address(of) => &of.target.span,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    Bytes(Vec<u8>),
    Align(u32),
    Late(LatePiece, u32),
}

/// The data of a resolved scene: bytes, with pieces between them that are encoded later.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Data {
    parts: Vec<Part>,
    /// The size that zeros fill up to, and where the scene says it.
    size: Option<(u64, Place)>,
}

/// Bytes, and the pieces that are encoded later with their places, ascending.
pub type Flattened = (Vec<u8>, Vec<(usize, LatePiece)>);

impl From<Vec<u8>> for Data {
    fn from(bytes: Vec<u8>) -> Self {
        Self { parts: vec![Part::Bytes(bytes)], size: None }
    }
}

impl Data {
    /// The bytes, where nothing is encoded later.
    pub fn bytes(&self) -> Option<&[u8]> {
        match self.parts.as_slice() {
            [] => Some(&[]),
            [Part::Bytes(bytes)] => Some(bytes),
            _ => None,
        }
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
            _ => unreachable!("bug in anyhit: the last part holds bytes"),
        }
    }

    /// Appends zeros up to a multiple of a number of bytes.
    pub(super) fn align(&mut self, to: u32) {
        match self.bytes().map(<[u8]>::len) {
            Some(size) => self.tail().resize(size.next_multiple_of(to as usize), 0),
            None => self.parts.push(Part::Align(to)),
        }
    }

    /// Appends a piece so many times.
    pub(super) fn push_late(&mut self, piece: LatePiece, repeat: u32) {
        self.parts.push(Part::Late(piece, repeat));
    }

    /// Appends bytes in which pieces that are encoded later have these places, ascending.
    pub(super) fn append(&mut self, bytes: &[u8], late: &[(usize, LatePiece)]) {
        let mut done = 0;
        for (at, piece) in late {
            // Members may share their bytes.
            if *at < done {
                continue;
            }
            self.tail().extend_from_slice(&bytes[done..*at]);
            self.push_late(piece.clone(), 1);
            done = at + LatePiece::ADDRESS_SIZE;
        }
        self.tail().extend_from_slice(&bytes[done..]);
    }

    /// The bytes, zeros for what is encoded later, and those pieces with their places.
    pub(super) fn flattened(&self) -> Flattened {
        let (mut bytes, mut late) = (Vec::new(), Vec::new());
        for part in &self.parts {
            match part {
                Part::Bytes(more) => bytes.extend_from_slice(more),
                Part::Align(to) => bytes.resize(bytes.len().next_multiple_of(*to as usize), 0),
                Part::Late(piece, repeat) => {
                    for _ in 0..*repeat {
                        late.push((bytes.len(), piece.clone()));
                        bytes.resize(bytes.len() + LatePiece::ADDRESS_SIZE, 0);
                    }
                }
            }
        }
        (bytes, late)
    }

    /// Says how long it is, with zeros at its end.
    pub(super) fn pad_to(&mut self, size: u64, place: Place) {
        self.size = Some((size, place));
    }

    /// The first piece that is encoded later.
    pub fn first_late(&self) -> Option<&Span> {
        self.parts.iter().find_map(|part| match part {
            Part::Late(piece, _) => Some(piece.span()),
            _ => None,
        })
    }

    /// Calls a function with everything whose address the data contains.
    pub fn targets<'a>(&'a self, found: &mut dyn FnMut(&'a AddressOf)) {
        for part in &self.parts {
            if let Part::Late(piece, _) = part {
                piece.targets(found);
            }
        }
    }

    /// The first phase: how many bytes it has.
    ///
    /// # Errors
    /// If a module is missing, or the data is longer than its size.
    pub fn size(&self, modules: &dyn Modules) -> Result<u64> {
        let mut size = 0_u64;
        for part in &self.parts {
            size = match part {
                Part::Bytes(bytes) => size.checked_add(bytes.len() as u64),
                Part::Align(to) => size.checked_next_multiple_of(u64::from(*to)),
                Part::Late(piece, repeat) => {
                    let all = piece.size(modules)?.checked_mul(u64::from(*repeat));
                    all.and_then(|all| size.checked_add(all))
                }
            }
            .ok_or_else(|| Error::new(ErrorKind::InvalidScene, "data of more than 2^64 bytes"))?;
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

    /// The second phase: its bytes.
    ///
    /// # Errors
    /// Those of the addresses and modules that it names.
    pub fn encode(&self, encoding: &Encoding<'_>) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        for part in &self.parts {
            match part {
                Part::Bytes(more) => bytes.extend_from_slice(more),
                Part::Align(to) => bytes.resize(bytes.len().next_multiple_of(*to as usize), 0),
                Part::Late(piece, repeat) => {
                    bytes.extend(piece.encode(encoding)?.repeat(*repeat as usize));
                }
            }
        }
        if let Some((size, _)) = self.size {
            bytes.resize(size as usize, 0);
        }
        Ok(bytes)
    }
}
