//! Shadow operations: the operations on f64 that accompany lane kernels, so that `--shadow` can
//! tell the effect of rounding (as LLVM's NSan does).

use std::collections::HashMap;
use std::sync::LazyLock;

use crate::machine::{Reg, Registers};
use crate::ops::glsl::parts;
use crate::ops::lane_kernel::{LaneKernel, OpFamily, Width};
use crate::ops::{SECTIONS, bit, conversion, float_controls, relational_logical};

/// The effect of a lane kernel on shadow values, which are f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShadowOp {
    /// The formula over f64, whose result is a float.
    Number(&'static LaneKernel),
    /// The comparison over f64.
    Comparison(&'static LaneKernel),
    /// The conversion of an f64 to an integer.
    Integer(&'static LaneKernel),
    /// The operand's value, unchanged: the kernel only rounds.
    Identity,
    /// A kernel on booleans.
    Logical,
    /// `OpSelect` on a word.
    Select,
    /// One float is packed into a word, into so many bits at a shift.
    Pack(u32),
    /// One float is unpacked from such a word.
    Unpack(u32),
    /// The bitwise or of two words, which may have packed floats.
    Join,
    /// No shadow value: integers, and bit patterns taken apart.
    None,
}

/// Returns the shadow operation of a kernel.
pub fn shadow_op(kernel: &'static LaneKernel) -> ShadowOp {
    static SHADOW_OPS: LazyLock<HashMap<usize, ShadowOp>> = LazyLock::new(|| {
        let mut shadow_ops = HashMap::new();
        let packing = [parts::FAMILIES];
        for family in SECTIONS.iter().chain(&packing).flat_map(|section| section.iter().copied()) {
            for kernel in family.kernels {
                shadow_ops.insert(std::ptr::from_ref(kernel) as usize, family_shadow(kernel));
            }
        }
        shadow_ops
    });
    let known = SHADOW_OPS.get(&(std::ptr::from_ref(kernel) as usize)).copied();
    known.or_else(|| conversion_shadow(kernel)).or_else(|| controlled_shadow(kernel)).unwrap_or_else(|| {
        match kernel == &relational_logical::select::SelectWord.kernels[0] {
            true => ShadowOp::Select,
            false => ShadowOp::None,
        }
    })
}

/// The families that pack floats into words and unpack them.
static PACKED: [(&OpFamily, ShadowOp); 10] = [
    (&parts::Half, ShadowOp::Pack(16)),
    (&parts::Snorm16, ShadowOp::Pack(16)),
    (&parts::Unorm16, ShadowOp::Pack(16)),
    (&parts::Snorm8, ShadowOp::Pack(8)),
    (&parts::Unorm8, ShadowOp::Pack(8)),
    (&parts::FromHalf, ShadowOp::Unpack(16)),
    (&parts::FromSnorm16, ShadowOp::Unpack(16)),
    (&parts::FromUnorm16, ShadowOp::Unpack(16)),
    (&parts::FromSnorm8, ShadowOp::Unpack(8)),
    (&parts::FromUnorm8, ShadowOp::Unpack(8)),
];

fn family_shadow(kernel: &LaneKernel) -> ShadowOp {
    if kernel.width == 0 {
        return ShadowOp::Logical;
    }
    if let Some((_, packed)) = PACKED.iter().find(|(family, _)| kernel.is(family)) {
        return *packed;
    }
    if kernel.is(&bit::BitwiseOr) && kernel.width == 32 {
        return ShadowOp::Join;
    }
    let takes_floats = kernel.float_operands.iter().any(|&width| width > 0);
    let Some(wide) = kernel.family.kernel(64).filter(|wide| takes_floats && wide.float_operands[0] == 64)
    else {
        return ShadowOp::None;
    };
    let compares = kernel.is_one_of(relational_logical::FAMILIES);
    match (kernel.float_result > 0, compares) {
        (true, _) => ShadowOp::Number(wide),
        (false, true) => ShadowOp::Comparison(wide),
        (false, false) => ShadowOp::Integer(wide),
    }
}

fn conversion_shadow(kernel: &'static LaneKernel) -> Option<ShadowOp> {
    if !kernel.is(&conversion::CONVERT) {
        return None;
    }
    Some(match (kernel.float_operands[0] > 0, kernel.float_result > 0) {
        (true, true) => ShadowOp::Identity,
        (true, false) => conversion::f64_counterpart(kernel).map_or(ShadowOp::None, ShadowOp::Integer),
        (false, true) => {
            let kind =
                if kernel.signed { conversion::Conversion::SToF } else { conversion::Conversion::UToF };
            conversion::kernel(kind, kernel.width, 64).map_or(ShadowOp::None, ShadowOp::Number)
        }
        (false, false) => ShadowOp::None,
    })
}

/// The shadow operation of a kernel that float controls substitute for another.
fn controlled_shadow(kernel: &'static LaneKernel) -> Option<ShadowOp> {
    if float_controls::FlushDenormal.kernels.contains(kernel) {
        return Some(ShadowOp::Identity);
    }
    let family = float_controls::rounded_family(kernel);
    if kernel.is(family) {
        return None;
    }
    if *family != conversion::CONVERT {
        return family.kernel(64).map(ShadowOp::Number);
    }
    if kernel.float_operands[0] > 0 {
        return Some(ShadowOp::Identity);
    }
    let kind = if kernel.signed { conversion::Conversion::SToF } else { conversion::Conversion::UToF };
    conversion::kernel(kind, kernel.width, 64).map(ShadowOp::Number)
}

/// A register file of one lane, in which single kernels run.
#[derive(Debug)]
pub struct ScratchRegisters(Registers<1>);

impl Default for ScratchRegisters {
    fn default() -> Self {
        Self(Registers::new(8))
    }
}

impl ScratchRegisters {
    /// Runs a kernel on operands given as bits and returns the bits of the result.
    pub fn run(&mut self, kernel: &LaneKernel, operands: [u64; 3]) -> u64 {
        const FROM: [Reg; 3] = [Reg(2), Reg(4), Reg(6)];
        for (&bits, first) in operands.iter().zip(FROM) {
            self.0[first].0 = [bits as u32];
            self.0[first.plus(1)].0 = [(bits >> 32) as u32];
        }
        self.0[Reg(1)].0 = [0];
        Width::<1>::run(kernel, &mut self.0, Reg(0), &FROM);
        u64::from(self.0[Reg(0)].0[0]) | u64::from(self.0[Reg(1)].0[0]) << 32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::arithmetic::{FAdd, IAdd};
    use crate::ops::conversion::Conversion;

    fn kernel(family: &'static OpFamily, width: u32) -> &'static LaneKernel {
        family.kernel(width).expect("a kernel of this width")
    }

    #[test]
    fn every_kind_of_kernel_has_its_shadow_operation() {
        assert_eq!(shadow_op(kernel(&FAdd, 32)), ShadowOp::Number(kernel(&FAdd, 64)));
        assert_eq!(shadow_op(kernel(&FAdd, 64)), ShadowOp::Number(kernel(&FAdd, 64)));
        assert_eq!(shadow_op(kernel(&IAdd, 32)), ShadowOp::None);
        let less = &relational_logical::FOrdLessThan;
        assert_eq!(shadow_op(kernel(less, 16)), ShadowOp::Comparison(kernel(less, 64)));
        assert_eq!(shadow_op(kernel(&relational_logical::LogicalAnd, 0)), ShadowOp::Logical);
        assert_eq!(shadow_op(&relational_logical::select::SelectWord.kernels[0]), ShadowOp::Select);
        assert_eq!(shadow_op(&parts::Half.kernels[0]), ShadowOp::Pack(16));
        assert_eq!(shadow_op(&parts::FromUnorm8.kernels[0]), ShadowOp::Unpack(8));
        assert_eq!(shadow_op(kernel(&crate::ops::bit::BitwiseOr, 32)), ShadowOp::Join);
        let convert = |kind, from, to| conversion::kernel(kind, from, to).expect("a kernel");
        assert_eq!(shadow_op(convert(Conversion::F, 32, 16)), ShadowOp::Identity);
        let to_int = ShadowOp::Integer(convert(Conversion::FToS, 64, 32));
        assert_eq!(shadow_op(convert(Conversion::FToS, 32, 32)), to_int);
        let from_int = ShadowOp::Number(convert(Conversion::SToF, 32, 64));
        assert_eq!(shadow_op(convert(Conversion::SToF, 32, 32)), from_int);
        assert_eq!(shadow_op(&float_controls::FlushDenormal.kernels[1]), ShadowOp::Identity);
        assert_eq!(
            shadow_op(kernel(&float_controls::FAddTowardZero, 32)),
            ShadowOp::Number(kernel(&FAdd, 64))
        );
    }

    #[test]
    fn a_kernel_runs_in_scratch_registers() {
        let mut scratch = ScratchRegisters::default();
        let bits = scratch.run(kernel(&FAdd, 64), [1f64.to_bits(), 2f64.powi(-40).to_bits(), 0]);
        assert_eq!(f64::from_bits(bits), 1.0 + 2f64.powi(-40));
        let less = scratch.run(kernel(&relational_logical::FOrdLessThan, 64), [0, 1f64.to_bits(), 0]);
        assert_eq!(less, 1);
    }
}
