//! The operation that finds a descriptor in a heap (`SPV_EXT_descriptor_heap`).

use crate::machine::resource::ELEMENT_BITS;
use crate::machine::{AccessFault, Batch, Bindings, Mask, Reg, TrapCode};
use crate::module::heap::DESCRIPTOR_BYTES;
use crate::ops::access::{Access, OperandKind};
use crate::ops::memory::{OUT_OF_BOUNDS, trap};

/// The size of a heap in bytes (`maxResourceHeapSize`, `maxSamplerHeapSize`).
pub const HEAP_BYTES: u32 = DESCRIPTOR_BYTES << ELEMENT_BITS;

/// `to` becomes the handle of the descriptor at a byte offset of a heap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeapDescriptor {
    /// The register of the handle.
    pub to: Reg,
    /// The handle of the heap's first descriptor.
    pub first: u32,
    /// What is added to the offset.
    pub offset: u32,
    /// The register of the offset.
    pub index: Reg,
}

impl HeapDescriptor {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        visit(Access::Read(self.index, 1));
        visit(Access::Write(self.to, 1));
    }

    /// See [`crate::ops::op::Op::visit_single_registers`].
    pub(super) fn visit_single_registers(&mut self, mut visit: impl FnMut(&mut Reg, OperandKind)) {
        visit(&mut self.index, OperandKind::Use);
        visit(&mut self.to, OperandKind::Def);
    }

    /// Runs the operation for the running lanes.
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>) {
        for lane in batch.mask.lanes() {
            let index = batch.registers[self.index].0[lane];
            let offset = u64::from(index) + u64::from(self.offset);
            let code = match offset {
                _ if index == OUT_OF_BOUNDS || offset >= HEAP_BYTES.into() => TrapCode::IndexOutOfBounds,
                _ if !offset.is_multiple_of(DESCRIPTOR_BYTES.into()) => TrapCode::DescriptorMisaligned,
                _ => {
                    let element = offset as u32 / DESCRIPTOR_BYTES;
                    batch.registers[self.to].0[lane] = Bindings::element_handle(self.first, element);
                    continue;
                }
            };
            batch.record_access_fault(lane, AccessFault::HeapOffset { first: self.first, offset });
            trap(batch, Mask::lane(lane), code);
        }
    }
}
