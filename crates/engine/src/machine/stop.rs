//! Why the interpreter returned a batch to the pipeline.

use crate::machine::lanes::{Mask, Reg};
use crate::machine::object::ObjectRef;

/// Why the interpreter stopped; the mask holds the lanes that wait.
///
/// The code that serves a stop reads operands and writes results in the batch's registers, and runs
/// the batch again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop<const W: usize> {
    /// Every lane has ended; see [`Batch::exits`](crate::machine::Batch::exits).
    Done,
    /// `OpTraceRayKHR`
    TraceRay {
        /// The lanes that trace.
        mask: Mask<W>,
        /// Operand registers in the order of the instruction: acceleration structure (2 words), ray
        /// flags, cull mask, SBT offset, SBT stride, miss index, origin (3), t min, direction (3),
        /// t max, time (0 for a trace without motion).
        operands: Reg,
        /// The registers of the payload variable.
        payload: RegSpan,
    },
    /// `OpExecuteCallableKHR`
    ExecuteCallable {
        /// The lanes that call.
        mask: Mask<W>,
        /// The register of the SBT index.
        index: Reg,
        /// The registers of the callable data variable.
        data: RegSpan,
    },
    /// `OpReportIntersectionKHR`
    ReportIntersection {
        /// The lanes that report.
        mask: Mask<W>,
        /// The register of the hit distance.
        t: Reg,
        /// The register of the hit kind.
        hit_kind: Reg,
        /// The register that takes the answer, a bool.
        accepted: Reg,
    },
    /// `OpControlBarrier` of scope Workgroup
    Barrier {
        /// The lanes that have come to it.
        mask: Mask<W>,
    },
    /// `OpHitObjectTraceRayEXT`: as `TraceRay`, but no closest-hit or miss shader runs, what was
    /// found is recorded in a hit object.
    HitObjectTrace {
        /// The lanes that trace.
        mask: Mask<W>,
        /// The hit objects.
        object: ObjectRef,
        /// Operand registers, as those of `TraceRay`.
        operands: Reg,
        /// The registers of the payload variable.
        payload: RegSpan,
    },
    /// `OpHitObjectExecuteShaderEXT`
    HitObjectExecute {
        /// The lanes that execute.
        mask: Mask<W>,
        /// The hit objects.
        object: ObjectRef,
        /// The registers of the payload variable.
        payload: RegSpan,
    },
    /// `OpHitObjectGetShaderRecordBufferHandleEXT`
    HitObjectRecordHandle {
        /// The lanes that execute the instruction.
        mask: Mask<W>,
        /// The hit objects.
        object: ObjectRef,
        /// The two registers that take the device address.
        to: Reg,
    },
    /// The observer asked for a pause before the operation that runs next.
    Paused,
}

/// Consecutive registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegSpan {
    /// The first register.
    pub first: Reg,
    /// The number of registers.
    pub count: u32,
}
