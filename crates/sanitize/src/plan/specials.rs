//! Which operations give NaNs and infinities.

use crate::plan::flow::Flow;
use anyhit_engine::ops::bit::field;
use anyhit_engine::ops::conversion::CONVERT;
use anyhit_engine::ops::glsl::parts;
use anyhit_engine::ops::lane_kernel::{LaneKernel, OpFamily};
use anyhit_engine::ops::{arithmetic, bit, glsl, observed};

/// Kernels whose results are made of the bits of their operands: packing, unpacking, and what
/// integers are packed, hashed or made sortable with.
static CARRIERS: [&OpFamily; 22] = [
    &parts::Half,
    &parts::Snorm8,
    &parts::Unorm8,
    &parts::Snorm16,
    &parts::Unorm16,
    &parts::FromHalf,
    &observed::PackedDouble,
    &bit::BitwiseAnd,
    &bit::BitwiseOr,
    &bit::BitwiseXor,
    &bit::Not,
    &bit::BitReverse,
    &bit::ShiftLeftLogical,
    &bit::ShiftRightLogical,
    &bit::ShiftRightArithmetic,
    &field::FieldMerge,
    &field::FieldUExtract,
    &field::FieldSExtract,
    &arithmetic::IAdd,
    &arithmetic::ISub,
    &arithmetic::IMul,
    &arithmetic::SNegate,
];

/// Kernels that give a NaN or an infinity where an operand is one.
static INHERITORS: [&OpFamily; 14] = [
    &arithmetic::FNegate,
    &glsl::FAbs,
    &glsl::FMin,
    &glsl::FMax,
    &glsl::FClamp,
    &glsl::NMin,
    &glsl::NMax,
    &glsl::NClamp,
    &glsl::Floor,
    &glsl::Ceil,
    &glsl::Trunc,
    &glsl::Round,
    &glsl::RoundEven,
    &glsl::FSign,
];

/// Whether the result of a lane kernel may be a NaN or infinite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Specials {
    /// It is neither, or nobody has made it: it was unpacked from bits.
    #[default]
    None,
    /// It is where an operand is.
    Inherited,
    /// It is made of the bits of its operands, which may be those of one.
    Carried,
    /// The kernel may make one.
    Born,
}

impl Specials {
    /// What of a kernel's result is followed.
    pub(super) fn of(kernel: &LaneKernel, flow: Flow) -> Self {
        let takes_floats = kernel.float_operands != [0; 3];
        let converts = kernel.is(&CONVERT);
        match kernel.float_result {
            _ if flow == Flow::Select => Self::Inherited,
            _ if kernel.is_one_of(&CARRIERS) => Self::Carried,
            0 if converts && !takes_floats => Self::Carried,
            0 => Self::None,
            // The greatest integer of 64 bits is a finite float of 32.
            17.. if converts && !takes_floats => Self::None,
            width if converts && takes_floats && kernel.float_operands[0] <= width => Self::Inherited,
            _ if converts => Self::Born,
            _ if !takes_floats => Self::None,
            _ if kernel.is_one_of(&INHERITORS) => Self::Inherited,
            _ => Self::Born,
        }
    }
}
