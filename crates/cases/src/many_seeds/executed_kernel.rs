//! A kernel on floats that was executed, of which something may be drawn.

use crate::many_seeds::float_licence::FloatLicence;
use anyhit_engine::machine::{ChoiceKind, DrawnDetails, OpIndex, OpenChoices, Reg};
use anyhit_engine::ops::lane_kernel::LaneKernel;

/// A kernel on floats that was executed.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExecutedKernel<'a> {
    /// The operation.
    pub op: OpIndex,
    /// The kernel.
    pub kernel: &'static LaneKernel,
    /// The register of the result.
    pub to: Reg,
    /// Those of the operands.
    pub from: &'a [Reg; 3],
    /// What may be done with it.
    pub licence: &'a FloatLicence,
}

impl ExecutedKernel<'_> {
    /// The site of a choice about its instruction: it is made for all invocations and components.
    pub(super) fn place(&self, choices: &OpenChoices) -> u64 {
        u64::from(choices.shader.0) << 32 | u64::from(self.licence.offset)
    }

    /// Whether it subtracts its second operand.
    pub(super) fn is_difference(&self) -> bool {
        self.kernel.name == "FSub"
    }

    /// Notes a draw that makes a difference.
    pub(super) fn note(&self, choices: &OpenChoices, kind: ChoiceKind) {
        let site = choices.site(kind, [0; 3], self.place(choices));
        let (shader, op) = (choices.shader, Some(self.op));
        choices.note(site, || DrawnDetails::Value { shader, op, what: None });
    }
}
