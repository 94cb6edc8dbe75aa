//! Why the interpreter handed a batch back.

use crate::machine::lanes::{Mask, Reg};
use crate::machine::object::ObjectRef;

/// Why the interpreter stopped; the mask holds the lanes that wait.
///
/// Whoever serves a stop reads operands and writes results in the batch's registers, and runs the
/// batch again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop<const W: usize> {
    /// Every lane has ended; see [`Batch::exits`](crate::machine::Batch::exits).
    Done,
    /// `OpTraceRayKHR`
    TraceRay {
        /// The lanes that trace.
        mask: Mask<W>,
        /// Operand rows in the order of the instruction: acceleration structure (2 words), ray
        /// flags, cull mask, SBT offset, SBT stride, miss index, origin (3), t min, direction (3),
        /// t max, time (0 for a trace without motion).
        operands: Reg,
        /// The rows of the payload variable.
        payload: Rows,
    },
    /// `OpExecuteCallableKHR`
    ExecuteCallable {
        /// The lanes that call.
        mask: Mask<W>,
        /// The row of the SBT index.
        index: Reg,
        /// The rows of the callable data variable.
        data: Rows,
    },
    /// `OpReportIntersectionKHR`
    ReportIntersection {
        /// The lanes that report.
        mask: Mask<W>,
        /// The row of the hit distance.
        t: Reg,
        /// The row of the hit kind.
        hit_kind: Reg,
        /// The row that takes the answer, a bool.
        accepted: Reg,
    },
    /// `OpControlBarrier` of scope Workgroup
    Barrier {
        /// The lanes that have come to it.
        mask: Mask<W>,
    },
    /// `OpHitObjectTraceRayEXT`: as `TraceRay`, but no closest-hit or miss shader runs, what was found
    /// is recorded in a hit object.
    HitObjectTrace {
        /// The lanes that trace.
        mask: Mask<W>,
        /// The hit objects.
        object: ObjectRef,
        /// As of `TraceRay`.
        operands: Reg,
        /// The rows of the payload variable.
        payload: Rows,
    },
    /// `OpHitObjectExecuteShaderEXT`
    HitObjectExecute {
        /// The lanes that execute.
        mask: Mask<W>,
        /// The hit objects.
        object: ObjectRef,
        /// The rows of the payload variable.
        payload: Rows,
    },
    /// `OpHitObjectGetShaderRecordBufferHandleEXT`
    HitObjectRecordHandle {
        /// The lanes that ask.
        mask: Mask<W>,
        /// The hit objects.
        object: ObjectRef,
        /// The two rows that take the device address.
        to: Reg,
    },
    /// The observer asked for a pause before the operation that runs next.
    Paused,
}

/// A stretch of rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rows {
    /// The first row.
    pub first: Reg,
    /// How many.
    pub count: u32,
}
