//! Operations: what instructions are translated to. They have no types and no composites.

use crate::machine::object::ObjectRef;
use crate::machine::stop::RegSpan;
use crate::machine::{Batch, Bindings, Reg};
use crate::module::ty::CooperativeMatrix;
use crate::ops::access::{Access, ComputedRegisters, OperandKind, RegCopy};
use crate::ops::heap_descriptor::HeapDescriptor;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::shared_access::{SharedPart, SharedUse, SharedVisitor};
use crate::ops::{
    atomic, cooperative, debug_printf, hit_object, image, memory, ray_query, ray_tracing, subgroup,
};

/// One operation on registers.
#[derive(Clone, Debug, PartialEq)]
pub enum Op {
    /// A regular instruction: one scalar function, applied in every lane.
    LaneKernel {
        /// The instruction at one width.
        kernel: &'static LaneKernel,
        /// The first register of the result.
        to: Reg,
        /// The first register of each operand.
        from: [Reg; 3],
    },
    /// Moves, loads and stores.
    Memory(memory::MemoryOp),
    /// Finds a descriptor in a heap.
    HeapDescriptor(HeapDescriptor),
    /// Atomic instructions.
    Atomic(Box<atomic::AtomicOp>),
    /// Subgroup instructions.
    Subgroup(Box<subgroup::SubgroupOp>),
    /// Products of cooperative vectors, and operations on cooperative matrices.
    Cooperative(Box<cooperative::CooperativeOp>),
    /// `DebugPrintf` and `OpAbortKHR`.
    Print(debug_printf::PrintOp),
    /// Image instructions.
    Image(image::ImageOp),
    /// Ray query instructions.
    RayQuery(ray_query::RayQueryOp),
    /// Hit object instructions.
    HitObject(Box<hit_object::HitObjectOp>),
    /// `OpControlBarrier` of scope Workgroup, which hands the batch to the pipeline.
    Barrier,
    /// Instructions that hand the batch to the pipeline.
    Stop(ray_tracing::RayTracingOp),
    /// An instruction that becomes no other operation, for debuggers to stop at: it does nothing,
    /// and only programs that are not optimised have it.
    Step,
}

// Every pass over a program iterates over all operations, so large and rare variants are boxed.
const _: () = assert!(size_of::<Op>() <= 40);

impl Op {
    /// Copies a register in all lanes.
    pub fn copy_of(to: Reg, from: Reg) -> Self {
        Self::Memory(memory::MemoryOp::Move { to, from })
    }

    /// Reports the registers that the operation reads and writes, and whether it has a side effect.
    /// The methods of rarer operations call the visitor through a pointer, so that they are not
    /// compiled anew for each visitor.
    #[inline]
    pub fn accesses(&self, mut visit: impl FnMut(Access)) {
        match self {
            Self::LaneKernel { kernel, to, from } => {
                for (at, &words) in kernel.operands.iter().enumerate() {
                    if words == 0 {
                        break;
                    }
                    visit(Access::Read(from[at], words));
                }
                visit(Access::Write(*to, kernel.words));
            }
            Self::Memory(op) => op.accesses(&mut visit),
            Self::HeapDescriptor(op) => op.accesses(&mut visit),
            Self::Atomic(op) => op.accesses(&mut visit),
            Self::Subgroup(op) => op.accesses(&mut visit),
            Self::Cooperative(op) => op.accesses(&mut visit),
            Self::Print(op) => op.accesses(&mut visit),
            Self::Image(op) => op.accesses(&mut visit),
            Self::RayQuery(op) => op.accesses(&mut visit),
            Self::HitObject(op) => op.accesses(&mut visit),
            Self::Barrier => visit(Access::Effect),
            Self::Stop(op) => op.accesses(&mut visit),
            Self::Step => {}
        }
    }

    /// Reports the buffers and images that the operation accesses, and how. A query or a footprint
    /// of an image, and the length of an array, is no access.
    pub fn shared_accesses<'a>(&'a self, visit: &mut SharedVisitor<'_, 'a>) {
        match self {
            Self::Memory(op) => {
                let load = op.load().map(|(_, chunk)| (SharedUse::Load, chunk));
                let store = op.store().map(|(_, chunk)| (SharedUse::Store, chunk));
                load.into_iter().chain(store).for_each(|(used, chunk)| visit(used, SharedPart::Bytes(chunk)));
            }
            Self::Atomic(op) => {
                let bytes = op.chunk().map(SharedPart::Bytes);
                let part = bytes.or_else(|| op.texel().map(SharedPart::Texel));
                part.into_iter().for_each(|part| visit(SharedUse::Update(op.update()), part));
            }
            Self::Cooperative(op) => {
                let used = op.shared_use();
                op.chunk().into_iter().for_each(|chunk| visit(used, SharedPart::Bytes(chunk)));
            }
            Self::Image(op) => op.shared_accesses(visit),
            _ => {}
        }
    }

    /// The part of a buffer that the operation accesses.
    pub fn accessed_chunk(&self) -> Option<&memory::Chunk> {
        match self {
            Self::Memory(op) => op.chunk(),
            Self::Atomic(op) => op.chunk(),
            Self::Cooperative(op) => op.chunk(),
            _ => None,
        }
    }

    /// Visits the operands that are single registers and may be replaced by others, those that are
    /// read first. What is written is written in all running lanes at least.
    #[inline]
    pub fn visit_single_registers(&mut self, mut visit: impl FnMut(&mut Reg, OperandKind)) {
        match self {
            Self::LaneKernel { kernel, to, from } => {
                for (at, reg) in from.iter_mut().enumerate() {
                    if kernel.operands[at] == 1 {
                        visit(reg, OperandKind::Use);
                    }
                }
                if kernel.words == 1 {
                    visit(to, OperandKind::Def);
                }
            }
            Self::Memory(op) => op.visit_single_registers(visit),
            Self::HeapDescriptor(op) => op.visit_single_registers(visit),
            _ => {}
        }
    }

    /// The copy of one register that the operation is.
    #[inline]
    pub fn copy(&self) -> Option<RegCopy> {
        match self {
            Self::Memory(op) => op.copy(),
            _ => None,
        }
    }

    /// Whether the operation copies a register to itself in all lanes: it does nothing.
    #[inline]
    pub fn is_noop(&self) -> bool {
        self.copy().is_some_and(|copy| !copy.is_masked && copy.to == copy.from)
    }

    /// The offset that the operation computes of an index.
    #[inline]
    pub fn computed_offset(&self) -> Option<memory::ComputedOffset> {
        match self {
            Self::Memory(op) => op.computed_offset(),
            _ => None,
        }
    }

    /// What the operation finds in a descriptor heap.
    #[inline]
    pub fn heap_descriptor(&self) -> Option<&HeapDescriptor> {
        match self {
            Self::HeapDescriptor(op) => Some(op),
            _ => None,
        }
    }

    /// The first register that takes what the operation loads of a buffer, and the part of the
    /// buffer.
    pub fn buffer_load(&self) -> Option<(Reg, &memory::Chunk)> {
        match self {
            Self::Memory(op) => op.load(),
            _ => None,
        }
    }

    /// The first register of what the operation stores to a buffer, and the part of the buffer.
    pub fn buffer_store(&self) -> Option<(Reg, &memory::Chunk)> {
        match self {
            Self::Memory(op) => op.store(),
            _ => None,
        }
    }

    /// The registers that the operation makes undefined.
    pub fn undefines(&self) -> Option<RegSpan> {
        match self {
            Self::Memory(op) => op.undefines(),
            _ => None,
        }
    }

    /// The access to registers that an index chooses, lane by lane.
    #[inline]
    pub fn computed_registers(&self) -> Option<ComputedRegisters> {
        match self {
            Self::Memory(op) => op.computed_registers(),
            _ => None,
        }
    }

    /// Whether the operation may read, and whether it may write, each variable that is accessed
    /// through computed indices.
    #[inline]
    pub fn reaches_addressed(&self) -> (bool, bool) {
        match self {
            Self::Memory(op) => {
                op.computed_registers().map_or((false, false), |computed| (true, computed.writes))
            }
            Self::Atomic(_) => (true, true),
            _ => (false, false),
        }
    }

    /// Whether the operation hands the batch to the pipeline, or to the other batches of its
    /// workgroup.
    #[inline]
    pub fn stops(&self) -> bool {
        matches!(self, Self::Stop(_) | Self::Barrier)
    }

    /// Whether the operation is one of a ray-tracing pipeline, which may write registers before the
    /// batch goes on.
    #[inline]
    pub fn calls_pipeline(&self) -> bool {
        matches!(self, Self::Stop(_))
    }

    /// Whether the operation writes all lanes of its results, also those that do not run, and reads
    /// its operands before.
    #[inline]
    pub fn writes_all_lanes(&self) -> bool {
        matches!(self, Self::LaneKernel { .. }) || self.copy().is_some_and(|copy| !copy.is_masked)
    }

    /// Whether the operation may trap: it does more than compute registers from registers.
    pub fn may_trap(&self) -> bool {
        !self.only_computes() && self.undefines().is_none() && *self != Self::Step
    }

    /// Whether the operation computes registers from registers and nothing else.
    pub fn only_computes(&self) -> bool {
        match self {
            Self::LaneKernel { .. } => true,
            Self::Memory(op) => op.only_computes(),
            _ => false,
        }
    }

    /// Whether results depend on the order in which invocations run the operation; `is_used` tells
    /// whether something reads a register.
    pub fn order_dependent(&self, is_used: &dyn Fn(Reg) -> bool) -> bool {
        match self {
            Self::Atomic(op) => op.order_dependent(is_used),
            _ => false,
        }
    }

    /// Whether the operation needs the other invocations of its subgroup.
    pub fn needs_subgroup(&self) -> bool {
        match self {
            Self::Subgroup(_) => true,
            Self::Cooperative(op) => op.needs_subgroup(),
            _ => false,
        }
    }

    /// The least number of invocations in a subgroup that the operation needs.
    pub fn min_subgroup_size(&self) -> u32 {
        match self {
            Self::Cooperative(op) if op.needs_subgroup() => CooperativeMatrix::MIN_SUBGROUP_SIZE,
            _ => 1,
        }
    }

    /// Whether the operation gives the device address of a shader record.
    pub fn addresses_record(&self) -> bool {
        matches!(self, Self::Stop(op) if op.addresses_record())
    }

    /// Whether the operation prints.
    pub fn prints(&self) -> bool {
        matches!(self, Self::Print(op) if op.prints())
    }

    /// Whether the operation traces a ray, with its shaders.
    pub fn traces(&self) -> bool {
        matches!(self, Self::Stop(op) if op.traced_structure().is_some())
    }

    /// Whether lanes may continue in other subgroups after the operation.
    pub fn may_repack(&self) -> bool {
        match self {
            Self::Stop(op) => op.may_repack(),
            Self::HitObject(op) => op.may_repack(),
            _ => false,
        }
    }

    /// Whether the operation begins a ray query.
    pub fn begins_query(&self) -> bool {
        matches!(self, Self::RayQuery(ray_query::RayQueryOp::Initialize { .. }))
    }

    /// The first of the two registers with the acceleration structure in which the operation traces
    /// a ray or begins a ray query.
    pub fn traced_structure(&self) -> Option<Reg> {
        match self {
            Self::RayQuery(ray_query::RayQueryOp::Initialize { operands, .. }) => Some(*operands),
            Self::Stop(op) => op.traced_structure(),
            _ => None,
        }
    }

    /// The registers of the payload that the operation gives the shaders of a ray.
    pub fn ray_payload(&self) -> Option<RegSpan> {
        match self {
            Self::Stop(op) => op.ray_payload(),
            _ => None,
        }
    }

    /// The registers of the payload or callable data that the operation gives a shader.
    pub fn payload_span(&self) -> Option<RegSpan> {
        match self {
            Self::Stop(op) => op.payload_span(),
            _ => None,
        }
    }

    /// The hit object that the operation reads or writes.
    pub fn hit_object(&self) -> Option<ObjectRef> {
        match self {
            Self::HitObject(op) => op.object(),
            Self::Stop(op) => op.hit_object(),
            _ => None,
        }
    }

    /// Runs the operation for the running lanes of a batch. The interpreter itself handles
    /// [`Op::Stop`] and [`Op::Barrier`].
    #[inline(always)]
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings)
    where
        LaneKernel: Width<W>,
    {
        match self {
            Self::LaneKernel { kernel, to, from } => {
                Width::<W>::run(*kernel, &mut batch.registers, *to, from)
            }
            Self::Memory(op) => op.eval(batch, bindings),
            Self::HeapDescriptor(op) => op.eval(batch),
            Self::Atomic(op) => op.eval(batch, bindings),
            Self::Subgroup(op) => op.eval(batch),
            Self::Cooperative(op) => op.eval(batch, bindings),
            Self::Print(op) => op.eval(batch, bindings),
            Self::Image(op) => op.eval(batch, bindings),
            Self::RayQuery(op) => op.eval(batch, bindings),
            Self::HitObject(op) => op.eval(batch, bindings),
            Self::Step => {}
            Self::Barrier | Self::Stop(_) => unreachable!("bug in anyhit: a stop is not evaluated"),
        }
    }
}
