//! Twins: the same operation once more in f64, for judging what rounding did to the first.

use std::collections::HashMap;
use std::sync::LazyLock;

use crate::machine::{Reg, Registers};
use crate::ops::lane_kernel::{LaneKernel, OpFamily, Width};
use crate::ops::{SECTIONS, conversion, float_controls, glsl, relational_logical};

/// What stands for a kernel where values are f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Twin {
    /// The same formula over f64: its result is a float.
    Number(&'static LaneKernel),
    /// The same comparison over f64.
    Comparison(&'static LaneKernel),
    /// A float becomes an integer.
    Integer(&'static LaneKernel),
    /// The operand's value: the kernel only rounds.
    Same,
    /// A kernel on truth values.
    Logical,
    /// `OpSelect` on a word.
    Select,
    /// Nothing: integers, and bits taken apart.
    None,
}

/// The twin of a kernel.
pub fn twin(kernel: &'static LaneKernel) -> Twin {
    static TWINS: LazyLock<HashMap<usize, Twin>> = LazyLock::new(|| {
        let mut twins = HashMap::new();
        let parts = [glsl::parts::FAMILIES];
        for family in SECTIONS.iter().chain(&parts).flat_map(|section| section.iter().copied()) {
            for kernel in family.kernels {
                twins.insert(std::ptr::from_ref(kernel) as usize, of(family, kernel));
            }
        }
        twins
    });
    let known = TWINS.get(&(std::ptr::from_ref(kernel) as usize)).copied();
    known.or_else(|| conversion_twin(kernel)).or_else(|| controlled_twin(kernel)).unwrap_or_else(|| {
        match kernel == &relational_logical::select::SelectWord.kernels[0] {
            true => Twin::Select,
            false => Twin::None,
        }
    })
}

fn of(family: &'static OpFamily, kernel: &LaneKernel) -> Twin {
    if kernel.width == 0 {
        return Twin::Logical;
    }
    let takes_floats = kernel.float_operands.iter().any(|&width| width > 0);
    let Some(wide) = family.kernel(64).filter(|wide| takes_floats && wide.float_operands[0] == 64) else {
        return Twin::None;
    };
    let compares = relational_logical::FAMILIES.iter().any(|known| known.name == family.name);
    match (kernel.float_result > 0, compares) {
        (true, _) => Twin::Number(wide),
        (false, true) => Twin::Comparison(wide),
        (false, false) => Twin::Integer(wide),
    }
}

fn conversion_twin(kernel: &'static LaneKernel) -> Option<Twin> {
    if kernel.name != "Convert" {
        return None;
    }
    Some(match (kernel.float_operands[0] > 0, kernel.float_result > 0) {
        (true, true) => Twin::Same,
        (true, false) => conversion::from_f64_like(kernel).map_or(Twin::None, Twin::Integer),
        (false, true) => {
            let kind =
                if kernel.signed { conversion::Conversion::SToF } else { conversion::Conversion::UToF };
            conversion::kernel(kind, kernel.width, 64).map_or(Twin::None, Twin::Number)
        }
        (false, false) => Twin::None,
    })
}

/// Kernels that float controls put in the place of others.
fn controlled_twin(kernel: &'static LaneKernel) -> Option<Twin> {
    if float_controls::Flushed.kernels.contains(kernel) {
        return Some(Twin::Same);
    }
    let name = kernel.name.strip_suffix("TowardZero")?;
    if let Some(kind) = match name {
        "ConvertSToF" => Some(conversion::Conversion::SToF),
        "ConvertUToF" => Some(conversion::Conversion::UToF),
        _ => None,
    } {
        return conversion::kernel(kind, kernel.width, 64).map(Twin::Number);
    }
    if name == "FConvert" {
        return Some(Twin::Same);
    }
    let mut families = SECTIONS.iter().flat_map(|section| section.iter());
    let family = families.find(|family| family.name == name)?;
    family.kernel(64).map(Twin::Number)
}

/// Room to run a kernel for one lane.
#[derive(Debug)]
pub struct Scratch(Registers<1>);

impl Default for Scratch {
    fn default() -> Self {
        Self(Registers::new(8))
    }
}

impl Scratch {
    /// Runs a kernel on operands given as bits; the bits of the result.
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
    fn every_kind_of_row_has_its_twin() {
        assert_eq!(twin(kernel(&FAdd, 32)), Twin::Number(kernel(&FAdd, 64)));
        assert_eq!(twin(kernel(&FAdd, 64)), Twin::Number(kernel(&FAdd, 64)));
        assert_eq!(twin(kernel(&IAdd, 32)), Twin::None);
        let less = &relational_logical::FOrdLessThan;
        assert_eq!(twin(kernel(less, 16)), Twin::Comparison(kernel(less, 64)));
        assert_eq!(twin(kernel(&relational_logical::LogicalAnd, 0)), Twin::Logical);
        assert_eq!(twin(&relational_logical::select::SelectWord.kernels[0]), Twin::Select);
        let convert = |kind, from, to| conversion::kernel(kind, from, to).expect("a kernel");
        assert_eq!(twin(convert(Conversion::F, 32, 16)), Twin::Same);
        let to_int = Twin::Integer(convert(Conversion::FToS, 64, 32));
        assert_eq!(twin(convert(Conversion::FToS, 32, 32)), to_int);
        let from_int = Twin::Number(convert(Conversion::SToF, 32, 64));
        assert_eq!(twin(convert(Conversion::SToF, 32, 32)), from_int);
        assert_eq!(twin(&float_controls::Flushed.kernels[1]), Twin::Same);
        assert_eq!(twin(kernel(&float_controls::FAddTowardZero, 32)), Twin::Number(kernel(&FAdd, 64)));
    }

    #[test]
    fn a_row_runs_in_scratch() {
        let mut scratch = Scratch::default();
        let bits = scratch.run(kernel(&FAdd, 64), [1f64.to_bits(), 2f64.powi(-40).to_bits(), 0]);
        assert_eq!(f64::from_bits(bits), 1.0 + 2f64.powi(-40));
        let less = scratch.run(kernel(&relational_logical::FOrdLessThan, 64), [0, 1f64.to_bits(), 0]);
        assert_eq!(less, 1);
    }
}
