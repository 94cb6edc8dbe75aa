//! Which operations give NaNs and infinities.

use crate::ops::lane_kernel::LaneKernel;
use crate::sanitize::plan::flow::Flow;

/// Whether the result of a lane kernel may be a NaN or infinite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Specials {
    /// It is neither, or nobody has made it: it was unpacked from bits.
    #[default]
    None,
    /// It is where an operand is.
    Inherited,
    /// The kernel may make one.
    Born,
}

impl Specials {
    /// What of a kernel's result is followed.
    pub(super) fn of(kernel: &LaneKernel, flow: Flow) -> Self {
        let takes_floats = kernel.float_operands != [0; 3];
        match kernel.name {
            _ if flow == Flow::Select => Self::Inherited,
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
