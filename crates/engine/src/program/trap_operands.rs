//! The values that caused a trap, as data.

use crate::accel::RayRule;
use crate::machine::device_memory::STRUCTURE_HANDLE;
use crate::machine::{AccessFault, Binding, Bindings, LaneTrap, OpIndex, TrapCode};
use crate::module::Opcode;
use crate::ops::memory::{BufferRef, Chunk};
use crate::ops::ray_rules;
use crate::program::Program;
use anyhit_base::error::{DescriptorElement, IndexOperand, TrapOperands};

impl Program {
    /// The values that caused a trap: those that this program knows, which are not those of tables
    /// and limits. `index` is the one of [`Program::out_of_bounds_index`].
    pub(crate) fn trap_operands(
        &self,
        trap: LaneTrap,
        fault_value: u64,
        accessed: Option<&AccessFault>,
        index: Option<IndexOperand>,
    ) -> TrapOperands {
        let in_heap = matches!(accessed, Some(AccessFault::HeapOffset { .. }));
        let index = match index {
            Some(index) if trap.code == TrapCode::IndexOutOfBounds && !in_heap => {
                return self.index_operands(trap, index, accessed);
            }
            index => index,
        };
        if let Some(&AccessFault::HeapOffset { first, offset }) = accessed {
            let heap = self.heap_binding(first).map_or_else(String::new, |heap| heap.to_string());
            return TrapOperands::HeapOffset { heap, offset };
        }
        match trap.code {
            TrapCode::InvalidTrace | TrapCode::InvalidRayQuery | TrapCode::InvalidHitObject => RayRule::ALL
                .get(fault_value as usize)
                .map_or(TrapOperands::None, |rule| TrapOperands::Ray { rule: rule.describe() }),
            TrapCode::InvalidHitKind => TrapOperands::HitKind { hit_kind: fault_value as u32 },
            TrapCode::Aborted => match accessed {
                Some(AccessFault::Message(message)) => TrapOperands::Abort { message: message.to_string() },
                _ => TrapOperands::None,
            },
            // A handle that is no descriptor is a device address.
            TrapCode::AccelerationStructureMissing if (fault_value >> 32) as u32 == STRUCTURE_HANDLE => {
                TrapOperands::Descriptor { descriptor: self.descriptor_element(fault_value as u32) }
            }
            TrapCode::AccelerationStructureMissing => self.address_operands(fault_value, None, None),
            TrapCode::IndexOutOfBounds
            | TrapCode::BufferOutOfBounds
            | TrapCode::NullPointer
            | TrapCode::AddressInvalid
            | TrapCode::AddressOutOfBounds
            | TrapCode::AddressMisaligned
            | TrapCode::AtomicMisaligned
            | TrapCode::DescriptorMissing
            | TrapCode::ShaderRecordEmpty
            | TrapCode::ImageOutOfBounds
            | TrapCode::ImageRowAbsent
            | TrapCode::ImageMismatch
            | TrapCode::SamplerMismatch => match self.accessed_chunk(trap.op) {
                Some(chunk) => self.buffer_operands(trap.code, chunk, fault_value, accessed, index),
                None => accessed.map_or(TrapOperands::None, |accessed| self.image_operands(accessed)),
            },
            _ => TrapOperands::None,
        }
    }

    /// An index that is out of bounds: of a runtime array, the part of the buffer where its element
    /// would be.
    fn index_operands(
        &self,
        trap: LaneTrap,
        index: IndexOperand,
        accessed: Option<&AccessFault>,
    ) -> TrapOperands {
        match (index.offset, self.accessed_chunk(trap.op)) {
            (Some(offset), Some(chunk)) => {
                self.buffer_operands(trap.code, chunk, offset, accessed, Some(index))
            }
            _ => {
                let IndexOperand { index, length, of, .. } = index;
                TrapOperands::Index { index, length, of }
            }
        }
    }

    /// The rule for rays that a trap is about, where the specification has numbered it.
    pub(crate) fn ray_vuid(&self, trap: LaneTrap, fault_value: u64) -> Option<String> {
        let of_rays = matches!(
            trap.code,
            TrapCode::InvalidTrace | TrapCode::InvalidRayQuery | TrapCode::InvalidHitObject
        );
        let rule = RayRule::ALL.get(fault_value as usize).filter(|_| of_rays)?;
        let first = *self.module.words.get(self.origins.get(trap.op.index())?.offset as usize)?;
        ray_rules::vuid(Opcode::of_word(first), *rule)
    }

    /// The part of a buffer that an operation accesses.
    pub(super) fn accessed_chunk(&self, op: OpIndex) -> Option<&Chunk> {
        self.ops.get(op.index())?.accessed_chunk()
    }

    fn buffer_operands(
        &self,
        code: TrapCode,
        chunk: &Chunk,
        fault_value: u64,
        accessed: Option<&AccessFault>,
        index: Option<IndexOperand>,
    ) -> TrapOperands {
        let bytes = chunk.width / 8 * chunk.count;
        if let BufferRef::Address(_) = chunk.buffer {
            let nearest = accessed.filter(|_| code != TrapCode::NullPointer);
            return self.address_operands(fault_value, Some(bytes), nearest);
        }
        let (handle, size) = match accessed {
            Some(&AccessFault::Descriptor { handle, .. }) => {
                return TrapOperands::Descriptor { descriptor: self.descriptor_element(handle) };
            }
            Some(&AccessFault::Buffer { handle, size, .. }) => (handle, Some(size)),
            _ => (None, None),
        };
        let (handle, storage_class) = match chunk.buffer {
            BufferRef::PushConstants => (None, Some("PushConstant")),
            BufferRef::ShaderRecord => (None, Some("ShaderRecordBufferKHR")),
            BufferRef::Workgroup => (None, Some("Workgroup")),
            BufferRef::Handle(handle) => (Some(handle), None),
            BufferRef::Computed(_) | BufferRef::Address(_) => (handle, None),
        };
        let descriptor = handle.and_then(|handle| self.descriptor_element(handle));
        let (index, length, of) = index.map_or((None, None, None), |one| (one.index, one.length, one.of));
        TrapOperands::Buffer {
            descriptor,
            storage_class,
            offset: fault_value,
            bytes,
            size,
            index,
            length,
            of,
        }
    }

    fn address_operands(
        &self,
        address: u64,
        bytes: Option<u32>,
        nearest: Option<&AccessFault>,
    ) -> TrapOperands {
        match nearest {
            Some(AccessFault::Address { start, size, handle, name }) => TrapOperands::Address {
                address,
                bytes,
                start: Some(*start),
                size: Some(*size),
                buffer: name.as_deref().map(str::to_owned),
                descriptor: handle.and_then(|handle| self.descriptor_element(handle)),
            },
            _ => TrapOperands::Address {
                address,
                bytes,
                start: None,
                size: None,
                buffer: None,
                descriptor: None,
            },
        }
    }

    fn image_operands(&self, accessed: &AccessFault) -> TrapOperands {
        match accessed {
            AccessFault::Texel { handle, coordinate, extent, level, sample } => TrapOperands::Texel {
                image: self.descriptor_element(*handle),
                coordinate: coordinate.clone(),
                extent: extent.clone(),
                level: level[0],
                levels: level[1],
                sample: sample[0],
                samples: sample[1],
            },
            AccessFault::Descriptor { handle, .. }
            | AccessFault::ImageKind { handle, .. }
            | AccessFault::Buffer { handle: Some(handle), .. } => {
                TrapOperands::Descriptor { descriptor: self.descriptor_element(*handle) }
            }
            AccessFault::Buffer { handle: None, .. }
            | AccessFault::Address { .. }
            | AccessFault::ImageFile(_)
            | AccessFault::HeapOffset { .. }
            | AccessFault::HitRecord(_)
            | AccessFault::Message(_) => TrapOperands::None,
        }
    }

    /// Slot and array element of a handle; `None` for null.
    fn descriptor_element(&self, handle: u32) -> Option<DescriptorElement> {
        let (slot, element) = Bindings::slot_of(handle)?;
        let slot = self.slots.get(slot)?;
        let Binding { set, binding } = slot.binding;
        Some(DescriptorElement { name: slot.name.clone(), set, binding, element })
    }
}
