//! Which operations give NaNs and infinities.

use crate::plan::flow::Flow;
use anyhit_engine::ops::lane_kernel::LaneKernel;

/// Kernels whose results are made of the bits of their operands: packing, unpacking, and what
/// integers are packed, hashed or made sortable with.
const CARRIERS: [&str; 22] = [
    "Half",
    "Snorm8",
    "Unorm8",
    "Snorm16",
    "Unorm16",
    "FromHalf",
    "PackedDouble",
    "BitwiseAnd",
    "BitwiseOr",
    "BitwiseXor",
    "Not",
    "BitReverse",
    "ShiftLeftLogical",
    "ShiftRightLogical",
    "ShiftRightArithmetic",
    "FieldMerge",
    "FieldUExtract",
    "FieldSExtract",
    "IAdd",
    "ISub",
    "IMul",
    "SNegate",
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
        match kernel.name {
            _ if flow == Flow::Select => Self::Inherited,
            name if CARRIERS.contains(&name) => Self::Carried,
            "Convert" if !takes_floats && kernel.float_result == 0 => Self::Carried,
            _ if kernel.float_result == 0 => Self::None,
            // The greatest integer of 64 bits is a finite float of 32.
            "Convert" if !takes_floats && kernel.float_result > 16 => Self::None,
            "Convert" if takes_floats && kernel.float_operands[0] <= kernel.float_result => Self::Inherited,
            "Convert" => Self::Born,
            _ if !takes_floats => Self::None,
            "FNegate" | "FAbs" | "FMin" | "FMax" | "FClamp" | "NMin" | "NMax" | "NClamp" | "Floor"
            | "Ceil" | "Trunc" | "Round" | "RoundEven" | "FSign" => Self::Inherited,
            _ => Self::Born,
        }
    }
}
