//! Operations: what instructions are translated to. They have no types and no composites.

use crate::machine::{Batch, Bindings, Reg};
use crate::ops::access::Access;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::{atomic, debug_printf, hit_object, image, memory, ray_query, ray_tracing, subgroup};

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
    /// Atomic instructions.
    Atomic(Box<atomic::AtomicOp>),
    /// Subgroup instructions.
    Subgroup(Box<subgroup::SubgroupOp>),
    /// `DebugPrintf`.
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
            Self::Atomic(op) => op.accesses(&mut visit),
            Self::Subgroup(op) => op.accesses(&mut visit),
            Self::Print(op) => op.accesses(&mut visit),
            Self::Image(op) => op.accesses(&mut visit),
            Self::RayQuery(op) => op.accesses(&mut visit),
            Self::HitObject(op) => op.accesses(&mut visit),
            Self::Barrier => visit(Access::Effect),
            Self::Stop(op) => op.accesses(&mut visit),
            Self::Step => {}
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
            Self::Atomic(op) => op.eval(batch, bindings),
            Self::Subgroup(op) => op.eval(batch),
            Self::Print(op) => op.eval(batch, bindings),
            Self::Image(op) => op.eval(batch, bindings),
            Self::RayQuery(op) => op.eval(batch, bindings),
            Self::HitObject(op) => op.eval(batch, bindings),
            Self::Step => {}
            Self::Barrier | Self::Stop(_) => unreachable!("bug in anyhit: a stop is not evaluated"),
        }
    }
}
