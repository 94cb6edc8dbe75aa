//! The rules about the operands of an operation that constants leave open, and what is looked for
//! in them.

use rustc_hash::FxHashMap;

use crate::lane_operands::LaneOperands;
use crate::operand_check::{CheckedInstruction, OperandCheck, checks_of};
use crate::word_range::WordRange;
use anyhit_engine::machine::{Reg, Registers};
use anyhit_engine::ops::lane_kernel::LaneKernel;

/// A rule about the operands of an operation.
#[derive(Clone, Debug)]
pub struct OpenCheck {
    /// The rule.
    pub check: &'static OperandCheck,
    /// The registers of which a lane is in a range wherever the rule is broken; `None` where
    /// nothing is known.
    suspects: Option<Box<[(Reg, WordRange)]>>,
}

impl OpenCheck {
    /// Whether the rule may be broken in some lane of a batch, so that each is looked at by itself.
    #[inline]
    pub fn may_break<const W: usize>(&self, registers: &Registers<W>) -> bool {
        match &self.suspects {
            Some(suspects) => suspects.iter().any(|&(register, range)| range.meets(&registers[register])),
            None => true,
        }
    }
}

/// A lane kernel of a program with its operands, and the constants among them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Operation<'a> {
    pub kernel: &'a LaneKernel,
    pub from: &'a [Reg; 3],
    /// Bits of a scalar of the instruction's result.
    pub result_width: u32,
    pub constants: &'a FxHashMap<Reg, u32>,
}

impl<'a> Operation<'a> {
    /// The rules about the operands that constants do not decide.
    pub(super) fn open_checks(
        self,
        instruction: CheckedInstruction,
    ) -> impl Iterator<Item = OpenCheck> + use<'a> {
        let checks = checks_of(instruction, self.kernel).filter(move |check| !self.passes(check));
        checks.map(move |check| OpenCheck { check, suspects: self.suspects(check) })
    }

    /// Whether constants decide that a check holds.
    fn passes(self, check: &OperandCheck) -> bool {
        let mut registers = Registers::<1>::new(6);
        let own = [Reg(0), Reg(2), Reg(4)];
        for &at in check.decided_by {
            for word in 0..self.kernel.operands[at] {
                let Some(&bits) = self.constants.get(&self.from[at].plus(word)) else { return false };
                registers.set_lane_words(own[at].plus(word), 0, [bits]);
            }
        }
        !(check.breaks)(&LaneOperands::read(&registers, self.kernel, &own, self.result_width, 0))
    }

    /// What is looked for in the operands before a check looks at each lane.
    fn suspects(self, check: &OperandCheck) -> Option<Box<[(Reg, WordRange)]>> {
        let all = (check.suspects)(self.result_width);
        if all.is_empty() || self.kernel.width != u32::BITS {
            return None;
        }
        let mut open = Vec::new();
        for (at, range) in all {
            match self.constants.get(&self.from[at]) {
                Some(&word) if range.contains(word) => return None,
                Some(_) => {}
                None => open.push((self.from[at], range)),
            }
        }
        Some(open.into())
    }

    /// Whether an operand is a constant that no subnormal number, nor 0, is near.
    pub(super) fn is_normal_constant(self, at: usize) -> bool {
        let Self { kernel, from, constants, .. } = self;
        let high = constants.get(&from[at].plus(kernel.operands[at].saturating_sub(1)));
        let exponent = match kernel.float_operands[at] {
            16 => 0x7C00,
            32 => 0x7F80_0000,
            _ => 0x7FF0_0000,
        };
        high.is_some_and(|bits| bits & exponent != 0)
    }
}
