//! Descriptor heaps (`SPV_EXT_descriptor_heap`): the variables that are heaps, and where
//! descriptors lie in them.
//!
//! All descriptors have one size. An index then selects the same place in a heap, whatever type the
//! shader gives to what lies there, as in the heaps of Direct3D 12.

use crate::module::decoration::number;
use crate::module::ty::{Type, TypeId};
use crate::module::{GlobalVariable, Id, Module};

/// The size and the alignment of a descriptor in bytes: `samplerDescriptorSize`,
/// `imageDescriptorSize`, `bufferDescriptorSize` and the alignments of the same names
/// (`VkPhysicalDeviceDescriptorHeapPropertiesEXT`), and the value of `OpConstantSizeOfEXT`.
pub const DESCRIPTOR_BYTES: u32 = 32;

/// A heap of descriptors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Heap {
    /// `ResourceHeapEXT`: buffers, images, texel buffers and acceleration structures.
    Resources,
    /// `SamplerHeapEXT`
    Samplers,
}

impl Heap {
    /// The number of its builtin.
    pub fn builtin(self) -> u32 {
        match self {
            Self::Samplers => 5122,
            Self::Resources => 5123,
        }
    }

    /// The heap whose base pointer a builtin is.
    pub fn of_builtin(number: u32) -> Option<Self> {
        [Self::Resources, Self::Samplers].into_iter().find(|heap| heap.builtin() == number)
    }

    /// The name that messages give to a variable without one.
    pub fn variable_name(self) -> &'static str {
        match self {
            Self::Resources => "resource_heap",
            Self::Samplers => "sampler_heap",
        }
    }
}

/// A number of bytes that a decoration gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteCount {
    /// A literal.
    Literal(u32),
    /// The id of a constant, which a specialization may change.
    Constant(Id),
}

impl Module {
    /// The heap whose base pointer a variable is.
    #[doc(hidden)]
    pub fn heap(&self, variable: &GlobalVariable) -> Option<Heap> {
        // Other builtins have a type of data.
        if variable.ty.is_some() {
            return None;
        }
        Heap::of_builtin(self.decorations.literal(variable.id, number::BUILT_IN)?)
    }

    /// The heaps that an entry point's call tree uses.
    #[doc(hidden)]
    pub fn heaps_of(&self, function: Id) -> Vec<Heap> {
        let mut heaps: Vec<Heap> = Vec::new();
        for function in self.call_tree(function) {
            let variables = &self.functions[function as usize].variables;
            let found = variables.iter().filter_map(|&at| self.heap(&self.variables[at as usize]));
            heaps.extend(found);
        }
        heaps.sort_unstable();
        heaps.dedup();
        heaps
    }

    /// The distance between the elements of an array in a heap: `ArrayStride` or
    /// `ArrayStrideIdEXT`.
    #[doc(hidden)]
    pub fn heap_stride(&self, array: TypeId) -> Option<ByteCount> {
        let (Type::Array { stride, .. } | Type::RuntimeArray { stride, .. }) = *self.ty(array) else {
            return None;
        };
        let by_id = || self.decorations.literal(self.id_of_type(array)?, number::ARRAY_STRIDE_ID);
        stride.map(ByteCount::Literal).or_else(|| by_id().map(|id| ByteCount::Constant(Id(id))))
    }

    /// The offset of a struct member in a heap: `Offset` or `OffsetIdEXT`.
    #[doc(hidden)]
    pub fn heap_offset(&self, ty: TypeId, member: u32) -> Option<ByteCount> {
        let Type::Struct { members, .. } = self.ty(ty) else { return None };
        let by_id = || {
            let found = self.decorations.find_member(self.id_of_type(ty)?, member, number::OFFSET_ID)?;
            found.operands.first().copied()
        };
        let literal = members.get(member as usize)?.offset.map(ByteCount::Literal);
        literal.or_else(|| by_id().map(|id| ByteCount::Constant(Id(id))))
    }
}
