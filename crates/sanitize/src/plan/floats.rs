//! What an operation on floats is promised, what the shader declares of NaN, infinity and subnormal
//! numbers, and where a subnormal number decides.

use rspirv::spirv::{ExecutionMode, FPFastMathMode};

use crate::flushed_use::{FlushedUse, comparison};
use crate::operand_check::CheckedInstruction;
use crate::plan::instruction::{InstructionWords, scalar_width};
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::{Id, Module, Opcode};
use anyhit_engine::ops::arithmetic::FDiv;
use anyhit_engine::ops::lane_kernel::{InstructionSet, LaneKernel, family};
use anyhit_engine::program::Program;

/// The promises of `FPFastMathMode` that values can break.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FastMath {
    /// `NotNaN`
    pub not_nan: bool,
    /// `NotInf`
    pub not_infinite: bool,
}

impl FastMath {
    /// Whether nothing is promised.
    pub fn is_none(self) -> bool {
        self == Self::default()
    }

    /// What `FPFastMathMode` promises of a kernel's operands and result, where they are those of
    /// the instruction, or are NaN or infinite only if its own are.
    pub(super) fn of(instruction: InstructionWords<'_>, module: &Module, kernel: &LaneKernel) -> Self {
        let mode = instruction.result(module);
        let mode = mode.and_then(|id| module.decorations.literal(id, number::FP_FAST_MATH_MODE));
        let Some(mode) = mode.map(FPFastMathMode::from_bits_retain) else { return Self::default() };
        let own = match instruction.known(module) {
            Some(CheckedInstruction::Core(opcode)) => {
                is_sum_of_products(opcode) || is_family_of(InstructionSet::Core, opcode.0.into(), kernel)
            }
            Some(CheckedInstruction::Glsl(number)) => {
                is_family_of(InstructionSet::Glsl, number as u32, kernel)
            }
            None => false,
        };
        Self {
            not_nan: own && mode.contains(FPFastMathMode::NOT_NAN),
            not_infinite: own && mode.contains(FPFastMathMode::NOT_INF),
        }
    }
}

/// Whether a kernel is all that an instruction does, component by component.
fn is_family_of(set: InstructionSet, number: u32, kernel: &LaneKernel) -> bool {
    family(set, number).is_some_and(|family| family.kernels.iter().any(|own| std::ptr::eq(own, kernel)))
}

/// Whether an instruction adds products: no NaN or infinity within it gets lost.
fn is_sum_of_products(opcode: Opcode) -> bool {
    use Opcode as O;
    matches!(
        opcode,
        O::Dot
            | O::VectorTimesScalar
            | O::MatrixTimesScalar
            | O::VectorTimesMatrix
            | O::MatrixTimesVector
            | O::MatrixTimesMatrix
            | O::OuterProduct
    )
}

/// For which floats NaN and infinity are preserved, so that tests for them cannot be folded, and
/// subnormal numbers are.
#[derive(Debug, Default)]
pub(super) struct Preserved {
    /// `SignedZeroInfNanPreserve`: widths.
    widths: Vec<u32>,
    /// `FPFastMathDefault`: widths and modes.
    defaults: Vec<(u32, FPFastMathMode)>,
    /// `DenormPreserve`: widths.
    subnormals: Vec<u32>,
}

impl Preserved {
    /// What the entry point of a program declares.
    pub(super) fn of(program: &Program) -> Self {
        let mut preserved = Self::default();
        let mut entries = program.module.entry_points.iter();
        let entry = entries.find(|entry| entry.stage == program.stage && entry.name == program.name);
        for (mode, operands) in entry.into_iter().flat_map(|entry| &entry.modes) {
            match (ExecutionMode::from_u32(*mode), operands.as_slice()) {
                (Some(ExecutionMode::SignedZeroInfNanPreserve), &[width]) => preserved.widths.push(width),
                (Some(ExecutionMode::DenormPreserve), &[width]) => preserved.subnormals.push(width),
                (Some(ExecutionMode::FPFastMathDefault), &[ty, mode]) => {
                    let width =
                        program.module.type_with_id(Id(ty)).map(|ty| scalar_width(&program.module, ty));
                    let mode = program.module.scalar_value(Id(mode));
                    let mode = mode.map(|bits| FPFastMathMode::from_bits_retain(bits as u32));
                    preserved.defaults.extend(width.zip(mode));
                }
                _ => {}
            }
        }
        preserved
    }

    /// Whether an instruction whose result is a float of a width keeps NaN and infinity as they
    /// are.
    pub(super) fn specials(&self, module: &Module, instruction: InstructionWords<'_>, width: u32) -> bool {
        self.honours(module, instruction, width, FPFastMathMode::NOT_NAN | FPFastMathMode::NOT_INF)
    }

    /// Whether the test for NaN or infinity of a float of a width gives what it says.
    pub(super) fn tests(&self, module: &Module, instruction: InstructionWords<'_>, width: u32) -> bool {
        let ignored = match instruction.opcode {
            Opcode::IsNan => FPFastMathMode::NOT_NAN,
            _ => FPFastMathMode::NOT_INF,
        };
        self.honours(module, instruction, width, ignored)
    }

    /// Whether an instruction on floats of a width does none of what some flags allow.
    fn honours(
        &self,
        module: &Module,
        instruction: InstructionWords<'_>,
        width: u32,
        ignored: FPFastMathMode,
    ) -> bool {
        let result = instruction.words.get(2).copied();
        let own = result.and_then(|id| module.decorations.literal(Id(id), number::FP_FAST_MATH_MODE));
        match own {
            Some(bits) => !FPFastMathMode::from_bits_retain(bits).intersects(ignored),
            None => {
                let mut defaults = self.defaults.iter().filter(|(own, _)| *own == width);
                self.widths.contains(&width) || defaults.any(|(_, mode)| !mode.intersects(ignored))
            }
        }
    }

    /// What flushing subnormal operands would change in an instruction that is executed by a
    /// kernel; `None` where it changes nothing, or the shader forbids it.
    pub(super) fn flushed_use(
        &self,
        instruction: InstructionWords<'_>,
        kernel: &LaneKernel,
    ) -> Option<FlushedUse> {
        if self.subnormals.contains(&kernel.float_operands[1]) {
            return None;
        }
        match instruction.opcode {
            Opcode::FDiv if kernel.is(&FDiv) => Some(FlushedUse::Divisor),
            opcode => comparison(opcode),
        }
    }
}
