//! How operations access memory that invocations share: buffers and images.

use crate::machine::Reg;
use crate::ops::atomic::{AtomicKind, Update};
use crate::ops::image::texel_ref::TexelRef;
use crate::ops::memory::Chunk;

/// What an operation does with a part of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SharedUse {
    /// Reads it.
    Load,
    /// Writes it.
    Store,
    /// Updates it by an atomic instruction, which may be a load, too.
    Update(Update),
}

impl SharedUse {
    /// Whether it may leave another value.
    pub fn stores(self) -> bool {
        match self {
            Self::Load => false,
            Self::Store => true,
            Self::Update(update) => update.kind != AtomicKind::Load,
        }
    }

    /// Whether it writes, or is an atomic instruction, which takes part in the order of writes.
    pub fn may_write(self) -> bool {
        self != Self::Load
    }

    /// The effect of an atomic instruction.
    pub fn update(self) -> Option<Update> {
        match self {
            Self::Update(update) => Some(update),
            Self::Load | Self::Store => None,
        }
    }
}

/// A part of memory that an operation accesses.
#[derive(Clone, Copy, Debug)]
pub enum SharedPart<'a> {
    /// Scalars of a buffer.
    Bytes(&'a Chunk),
    /// A texel of an image.
    Texel(&'a TexelRef),
    /// Texels of an image that filtering chooses.
    Texels {
        /// The register of the image's handle.
        image: Reg,
        /// The register of the sampler's handle, where the operation has a sampler.
        sampler: Option<Reg>,
    },
}

/// Visits the parts of memory that an operation accesses.
pub type SharedVisitor<'v, 'a> = dyn FnMut(SharedUse, SharedPart<'a>) + 'v;
