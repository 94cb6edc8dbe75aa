//! How an invocation ends.

use std::sync::Arc;

use crate::machine::device_memory::STRUCTURE_HANDLE;
use crate::machine::index::OpIndex;
use crate::machine::resource::{BindingSummary, Bindings};
use anyhit_base::error::Error;
use serde::{Serialize, Serializer};

pub use anyhit_base::error::TrapCode;

/// The details of an access that trapped, for its report.
#[derive(Clone, Debug)]
pub enum AccessFault {
    /// A descriptor that is not bound, or of another kind.
    Descriptor {
        /// Slot and array element; see [`Bindings::handle`](crate::machine::Bindings::handle).
        handle: u32,
        /// What is bound.
        bound: Arc<[BindingSummary]>,
        /// What of the descriptor is missing, where a variable holds more than that.
        part: Option<&'static str>,
    },
    /// A device address without a buffer, or beyond the end of its buffer.
    Address {
        /// Where the nearest buffer begins.
        start: u64,
        /// The size of that buffer.
        size: u64,
        /// Slot and array element, where a descriptor leads to it, too.
        handle: Option<u32>,
        /// The scene's name for it.
        name: Option<Arc<str>>,
    },
    /// An offset in a descriptor heap that no descriptor has.
    HeapOffset {
        /// The handle of the heap's first descriptor.
        first: u32,
        /// Bytes from the beginning of the heap.
        offset: u64,
    },
    /// Bytes of a buffer.
    Buffer {
        /// Slot and array element, where a descriptor leads to it.
        handle: Option<u32>,
        /// The size of the buffer, or of the range that is bound.
        size: u64,
        /// Of a range: the buffer's name, and the offset in it.
        view: Option<(Arc<str>, u64)>,
    },
    /// A texel of an image.
    Texel {
        /// Slot and array element.
        handle: u32,
        /// Column, row and slice, then the layer of an array or cube.
        coordinate: Vec<i64>,
        /// Columns, rows and slices of the level, then the layers.
        extent: Vec<u32>,
        /// The level, and how many the image has.
        level: [u32; 2],
        /// The sample, and how many a texel has.
        sample: [u32; 2],
    },
    /// An image of another kind than the shader declares.
    ImageKind {
        /// Slot and array element.
        handle: u32,
        /// What the shader declares, in words.
        declared: String,
        /// What is bound, in words.
        bound: String,
    },
    /// An image whose texels cannot be read: why.
    ImageFile(Arc<Error>),
    /// A record of the hit table: what its index is the sum of.
    HitRecord(HitRecordTerms),
    /// The message of an abort.
    Message(Arc<str>),
}

/// What the index of a hit record is made of: the first, and the second times the third, and the
/// fourth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HitRecordTerms {
    /// The SBT offset of the instance.
    pub instance_offset: u32,
    /// The geometry's index in its structure.
    pub geometry: u32,
    /// The SBT stride of the trace.
    pub stride: u32,
    /// The SBT offset of the trace.
    pub offset: u32,
}

impl AccessFault {
    /// A descriptor that was not found.
    pub fn descriptor(handle: u32, bindings: &Bindings) -> Self {
        Self::Descriptor { handle, bound: bindings.bound.clone(), part: None }
    }

    /// A sampler that was not found.
    pub fn sampler(handle: u32, bindings: &Bindings) -> Self {
        Self::Descriptor { handle, bound: bindings.bound.clone(), part: Some("a sampler") }
    }

    /// The value of an acceleration structure that was not found; `None` for a device address.
    pub fn structure(value: u64, bindings: &Bindings) -> Option<Self> {
        ((value >> 32) as u32 == STRUCTURE_HANDLE).then(|| Self::descriptor(value as u32, bindings))
    }

    /// A device address; `None` where no buffer has one.
    pub fn address(address: u64, bindings: &Bindings) -> Option<Self> {
        let (start, buffer, name) = bindings.memory.nearest_buffer(address)?;
        let handle = bindings.handle_of(buffer);
        Some(Self::Address { start, size: buffer.size(), handle, name: name.cloned() })
    }
}

/// The trap of a lane: its code, and the place in the program where it happened. A
/// [`Trap`](anyhit_base::error::Trap) is what becomes of it in an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LaneTrap {
    /// The kind of the trap.
    pub code: TrapCode,
    /// The operation, or the terminator of a block.
    pub op: OpIndex,
}

/// How one lane of a batch ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Exit {
    /// It is still running, or ran to the end of its entry point.
    #[default]
    Returned,
    /// `OpIgnoreIntersectionKHR`
    Ignored,
    /// `OpTerminateRayKHR`
    Terminated,
    /// The machine stopped it.
    #[doc(hidden)]
    Trapped(LaneTrap),
}

/// As a word: `returned`, `ignored`, `terminated`, `trapped`.
impl Serialize for Exit {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        to.serialize_str(match self {
            Self::Returned => "returned",
            Self::Ignored => "ignored",
            Self::Terminated => "terminated",
            Self::Trapped(_) => "trapped",
        })
    }
}
