//! How what is undefined spreads through lane kernels.

use anyhit_engine::ops::bit::field::FieldMerge;
use anyhit_engine::ops::bit::{BitwiseAnd, BitwiseOr};
use anyhit_engine::ops::lane_kernel::{LaneKernel, OpFamily};
use anyhit_engine::ops::relational_logical::select::SelectWord;
use anyhit_engine::ops::relational_logical::{LogicalAnd, LogicalOr};

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

/// Those of kernels that not every operand decides.
static FLOWS: [(&OpFamily, Flow); 6] = [
    (&LogicalAnd, Flow::And),
    (&BitwiseAnd, Flow::And),
    (&LogicalOr, Flow::Or { ones: 1 }),
    (&BitwiseOr, Flow::Or { ones: u32::MAX }),
    (&SelectWord, Flow::Select),
    (&FieldMerge, Flow::Merge),
];

impl Flow {
    /// That of a kernel.
    pub(super) fn of(kernel: &LaneKernel) -> Self {
        FLOWS.iter().find(|(family, _)| kernel.is(family)).map_or(Self::Any, |(_, flow)| *flow)
    }
}
