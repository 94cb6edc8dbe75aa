//! The types of the operands of instructions that trace rays, query them, or record their hits. All
//! have 32 bits.

use crate::module::Opcode;

use crate::ops::operand_types::TypeConstraint::{self, Any, Scalar, ScalarBits, VectorBits};
use crate::ops::operand_types::kinds::{BOOL, FLOAT, INT, UINT};
use crate::ops::operand_types::rules::{OperandTypeRule, rule};

const WORD: TypeConstraint = ScalarBits(INT, 32);
const UNSIGNED: TypeConstraint = ScalarBits(UINT, 32);
const NUMBER: TypeConstraint = ScalarBits(FLOAT, 32);
const VECTOR: TypeConstraint = VectorBits(FLOAT, 32, 3);

/// Makes a table of the rules of instructions: the types of operands, behind `->` that of the
/// result.
macro_rules! ray_rules {
    ($($($op:ident)|+ : [$($operand:ident)*] $(-> $result:expr)?;)*) => {
        /// The rule of an instruction.
        pub(super) fn ray(opcode: Opcode) -> Option<&'static OperandTypeRule> {
            Some(match opcode {
                $($(Opcode::$op)|+ => {
                    static RULE: OperandTypeRule = rule(ray_rules!(@ $($result)?), &[$($operand),*]);
                    &RULE
                })*
                _ => return None,
            })
        }
    };
    (@) => { Any };
    (@ $result:expr) => { $result };
}

ray_rules! {
    // Structure, flags, cull mask, SBT offset and stride, miss index; the ray; a time.
    TraceRayKHR: [Any WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER];
    TraceRayMotionNV: [Any WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER NUMBER];
    ExecuteCallableKHR: [UNSIGNED];
    ReportIntersectionKHR: [NUMBER UNSIGNED] -> Scalar(BOOL);
    RayQueryInitializeKHR: [Any Any WORD WORD VECTOR NUMBER VECTOR NUMBER];
    // As those that trace, behind a hit object; behind the payload a hint and its bits.
    HitObjectTraceRayNV | HitObjectTraceRayEXT:
        [Any Any WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER];
    HitObjectTraceRayMotionNV | HitObjectTraceRayMotionEXT:
        [Any Any WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER NUMBER];
    HitObjectTraceReorderExecuteEXT:
        [Any Any WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER Any WORD WORD];
    HitObjectTraceMotionReorderExecuteEXT:
        [Any Any WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER NUMBER Any WORD WORD];
    // Instance, primitive, geometry, hit kind, record.
    HitObjectRecordHitNV: [Any Any WORD WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER];
    HitObjectRecordHitMotionNV: [Any Any WORD WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER NUMBER];
    HitObjectRecordHitWithIndexNV: [Any Any WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER];
    HitObjectRecordHitWithIndexMotionNV:
        [Any Any WORD WORD WORD WORD WORD VECTOR NUMBER VECTOR NUMBER NUMBER];
    HitObjectRecordMissNV: [Any WORD VECTOR NUMBER VECTOR NUMBER];
    HitObjectRecordMissMotionNV: [Any WORD VECTOR NUMBER VECTOR NUMBER NUMBER];
    HitObjectRecordMissEXT: [Any WORD WORD VECTOR NUMBER VECTOR NUMBER];
    HitObjectRecordMissMotionEXT: [Any WORD WORD VECTOR NUMBER VECTOR NUMBER NUMBER];
    HitObjectRecordFromQueryEXT: [Any Any WORD Any UNSIGNED];
    HitObjectSetShaderBindingTableRecordIndexEXT: [Any WORD];
    ReorderThreadWithHintNV | ReorderThreadWithHintEXT: [WORD WORD];
    ReorderThreadWithHitObjectNV | ReorderThreadWithHitObjectEXT: [Any WORD WORD];
    HitObjectReorderExecuteShaderEXT: [Any Any WORD WORD];
}
