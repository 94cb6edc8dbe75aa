//! How what is undefined spreads through lane kernels.

use anyhit_engine::ops::lane_kernel::LaneKernel;

/// How a lane kernel's result depends on undefined operands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flow {
    /// It is undefined where one is.
    #[default]
    Any,
    /// An operand whose bits are all zero decides.
    And,
    /// An operand whose bits are all one decides: of a bool, 1.
    Or {
        /// The word that decides.
        ones: u32,
    },
    /// Only the condition and the chosen operand count.
    Select,
    /// The bits of a field replace those of the third operand.
    Merge,
}

impl Flow {
    /// That of a kernel.
    pub(super) fn of(kernel: &LaneKernel) -> Self {
        match kernel.name {
            "LogicalAnd" | "BitwiseAnd" => Self::And,
            "LogicalOr" => Self::Or { ones: 1 },
            "BitwiseOr" => Self::Or { ones: u32::MAX },
            "SelectWord" => Self::Select,
            "FieldMerge" => Self::Merge,
            _ => Self::Any,
        }
    }
}
