//! What a module lets compilers and devices do with its floats, operation by operation.
//!
//! With `SPV_KHR_float_controls2` the fast-math mode of an instruction says it, or that of the
//! entry point for floats of its width. Otherwise everything is allowed but what `NoContraction`
//! forbids ("the operation cannot be combined with another instruction", and may not be
//! reassociated), and what `SignedZeroInfNanPreserve` and `DenormPreserve` preserve.

use rustc_hash::FxHashMap;

use anyhit_engine::machine::OpIndex;
use anyhit_engine::module::ty::Type;
use anyhit_engine::module::{Definition, Id, Module, Opcode};
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_engine::ops::op::Op;
use anyhit_engine::program::Program;

/// The capability `FloatControls2` (`SPV_KHR_float_controls2`).
const FLOAT_CONTROLS2: u32 = 6029;
/// The decoration `NoContraction`.
const NO_CONTRACTION: u32 = 42;
/// The decoration `FPFastMathMode`.
const FP_FAST_MATH_MODE: u32 = 40;
/// The execution mode `FPFastMathDefault`.
const FP_FAST_MATH_DEFAULT: u32 = 6028;
/// The execution mode `DenormPreserve`.
const DENORM_PRESERVE: u32 = 4459;
/// The execution mode `DenormFlushToZero`.
const DENORM_FLUSH_TO_ZERO: u32 = 4460;
/// The execution mode `SignedZeroInfNanPreserve`.
const SIGNED_ZERO_INF_NAN_PRESERVE: u32 = 4461;

/// `NSZ`, a bit of `FP Fast Math Mode`.
const IGNORE_ZERO_SIGN: u64 = 0x4;
/// `AllowContract`, a bit of `FP Fast Math Mode`.
const ALLOW_CONTRACT: u64 = 0x1_0000;
/// `AllowReassoc`, a bit of `FP Fast Math Mode`.
const ALLOW_REASSOC: u64 = 0x2_0000;

/// Core instructions that are sums of products.
const FORMULAS: [Opcode; 4] =
    [Opcode::VectorTimesMatrix, Opcode::MatrixTimesVector, Opcode::MatrixTimesMatrix, Opcode::Dot];
/// `Determinant`, `MatrixInverse`, and from `Length` to `Refract` what is defined by dot products,
/// of `GLSL.std.450`.
const GLSL_FORMULAS: [u32; 9] = [33, 34, 66, 67, 68, 69, 70, 71, 72];

/// What may be done with the floats of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FloatLicence {
    /// The words of its instruction.
    pub offset: u32,
    /// Whether it may be contracted with others.
    pub contracts: bool,
    /// Whether it may be reassociated with others.
    pub reassociates: bool,
    /// Whether the sign of its zeros does not count.
    pub ignores_zero_sign: bool,
    /// Whether its denormal operands and results may be flushed.
    pub flushes: bool,
    /// Whether the instruction is a formula of several operations: "the formula given may be
    /// transformed using the mathematical associativity, commutativity and distributivity" (Vulkan,
    /// "Precision of Individual Operations").
    pub is_formula: bool,
}

/// What may be done with the floats of each operation of a program.
#[derive(Debug)]
pub(super) struct FloatLicences(FxHashMap<OpIndex, FloatLicence>);

impl FloatLicences {
    /// Those of the lane kernels of a program.
    pub(super) fn of(program: &Program) -> Self {
        let modes = EntryModes::of(program);
        let licence = |(at, op): (usize, &Op)| {
            let Op::LaneKernel { kernel, .. } = op else { return None };
            let width = float_width(kernel)?;
            let offset = program.origins.get(at)?.offset;
            Some((OpIndex::new(at), modes.licence(&program.module, offset, width)))
        };
        Self(program.ops.iter().enumerate().filter_map(licence).collect())
    }

    /// That of an operation on floats of 16, 32 or 64 bits.
    pub(super) fn get(&self, op: OpIndex) -> Option<&FloatLicence> {
        self.0.get(&op)
    }
}

/// The width of the floats that a kernel gives, or else takes.
fn float_width(kernel: &LaneKernel) -> Option<u32> {
    let widths = [kernel.float_result, kernel.float_operands[0]];
    widths.into_iter().find(|&width| width > 0)
}

/// What an entry point says of its floats.
#[derive(Debug, Default)]
struct EntryModes {
    /// Whether instructions have fast-math modes.
    has_fast_math_modes: bool,
    /// The modes of widths that have one.
    defaults: Vec<(u32, u64)>,
    /// The widths whose denormals are preserved, or flushed always.
    denormals_are_fixed: u32,
    /// The widths whose zeros have signs.
    zero_signs_count: u32,
}

impl EntryModes {
    /// The modes of a program's entry point.
    fn of(program: &Program) -> Self {
        let module = &program.module;
        let mut entries = module.entry_points.iter();
        let entry = entries.find(|entry| entry.stage == program.stage && entry.name == program.name);
        Self::of_modes(module, entry.map_or(&[], |entry| &entry.modes))
    }

    /// The modes that a list of execution modes says.
    fn of_modes(module: &Module, list: &[(u32, Vec<u32>)]) -> Self {
        let mut modes =
            Self { has_fast_math_modes: module.capabilities.contains(&FLOAT_CONTROLS2), ..Self::default() };
        for (number, operands) in list {
            match (*number, &operands[..]) {
                (DENORM_PRESERVE | DENORM_FLUSH_TO_ZERO, &[width]) => modes.denormals_are_fixed |= width,
                (SIGNED_ZERO_INF_NAN_PRESERVE, &[width]) => modes.zero_signs_count |= width,
                (FP_FAST_MATH_DEFAULT, &[ty, mode]) => {
                    let ty = module.type_with_id(Id(ty)).map(|ty| module.ty(ty));
                    if let (Some(&Type::Float { width, .. }), Some(mode)) =
                        (ty, module.scalar_value(Id(mode)))
                    {
                        modes.defaults.push((width, mode));
                    }
                }
                _ => {}
            }
        }
        modes
    }

    /// What may be done with the floats of a width in an instruction.
    fn licence(&self, module: &Module, offset: u32, width: u32) -> FloatLicence {
        let words = module.words.get(offset as usize..).unwrap_or_default();
        let result = words.get(2).map(|&id| Id(id)).filter(|&id| module.type_of(id).is_some());
        let is_decorated = |number| result.is_some_and(|id| module.decorations.find(id, number).is_some());
        let own = result.and_then(|id| module.decorations.literal(id, FP_FAST_MATH_MODE)).map(u64::from);
        let default = || self.defaults.iter().find(|(own, _)| *own == width).map(|&(_, mode)| mode);
        let mode = if self.has_fast_math_modes { own.or_else(default) } else { None };
        let is_free = !is_decorated(NO_CONTRACTION);
        let allows = |bit, otherwise| mode.map_or(otherwise, |mode| mode & bit != 0);
        FloatLicence {
            offset,
            contracts: is_free && allows(ALLOW_CONTRACT, true),
            reassociates: is_free && allows(ALLOW_REASSOC, true),
            ignores_zero_sign: allows(IGNORE_ZERO_SIGN, self.zero_signs_count & width == 0),
            flushes: self.denormals_are_fixed & width == 0,
            is_formula: is_formula(module, words),
        }
    }
}

/// Whether an instruction, given by its words, is a formula of sums and products.
fn is_formula(module: &Module, words: &[u32]) -> bool {
    let opcode = words.first().map_or(Opcode::Nop, |&head| Opcode::of_word(head));
    match (opcode, words) {
        (Opcode::ExtInst, &[_, _, _, set, number, ..]) => match module.definition(Id(set)) {
            Some(Definition::InstructionSet(at)) => {
                module.instruction_sets[at as usize] == "GLSL.std.450" && GLSL_FORMULAS.contains(&number)
            }
            _ => false,
        },
        _ => FORMULAS.contains(&opcode),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::module::assemble::Assembler;

    /// The licence of `%22 = OpFAdd %float %21 %21`, which has a decoration with its operands,
    /// under execution modes. `%23` and `%24` are fast-math modes: none, and `AllowReassoc`.
    fn licence(capability: Option<u32>, decoration: &[u32], modes: &[(u32, Vec<u32>)]) -> FloatLicence {
        let mut a = Assembler::bare(100);
        a.op(Opcode::Capability, &[1]);
        capability.iter().for_each(|&capability| {
            a.op(Opcode::Capability, &[capability]);
        });
        a.op(Opcode::MemoryModel, &[0, 1]);
        if !decoration.is_empty() {
            a.op(Opcode::Decorate, &[&[22], decoration].concat());
        }
        a.types();
        a.op(Opcode::Constant, &[6, 21, 1f32.to_bits()]);
        a.op(Opcode::Constant, &[5, 23, 0]);
        a.op(Opcode::Constant, &[5, 24, ALLOW_REASSOC as u32]);
        let mut offset = 0;
        a.function(30, 31, |a| {
            offset = a.op(Opcode::FAdd, &[6, 22, 21, 21]);
            a.op(Opcode::Return, &[]);
        });
        let module = a.loaded();
        EntryModes::of_modes(&module, modes).licence(&module, offset as u32, 32)
    }

    #[test]
    fn everything_is_allowed_that_nothing_forbids() {
        let free = licence(None, &[], &[]);
        assert!(free.contracts && free.reassociates && free.ignores_zero_sign && free.flushes);
        assert!(!free.is_formula);
    }

    #[test]
    fn no_contraction_forbids_to_join_and_to_reorder() {
        let bound = licence(None, &[NO_CONTRACTION], &[]);
        assert!(!bound.contracts && !bound.reassociates && bound.ignores_zero_sign && bound.flushes);
    }

    #[test]
    fn modes_of_a_width_preserve_zeros_and_denormals() {
        let of = |mode, width| licence(None, &[], &[(mode, vec![width])]);
        assert!(!of(SIGNED_ZERO_INF_NAN_PRESERVE, 32).ignores_zero_sign);
        assert!(of(SIGNED_ZERO_INF_NAN_PRESERVE, 16).ignores_zero_sign);
        assert!(!of(DENORM_PRESERVE, 32).flushes && !of(DENORM_FLUSH_TO_ZERO, 32).flushes);
        assert!(of(DENORM_PRESERVE, 64).flushes);
    }

    #[test]
    fn a_fast_math_mode_says_what_is_allowed() {
        let none = &[(FP_FAST_MATH_DEFAULT, vec![6, 23])][..];
        let some = &[(FP_FAST_MATH_DEFAULT, vec![6, 24])][..];
        let strict = licence(Some(FLOAT_CONTROLS2), &[], none);
        assert!(!strict.contracts && !strict.reassociates && !strict.ignores_zero_sign && strict.flushes);
        assert!(licence(Some(FLOAT_CONTROLS2), &[], some).reassociates);
        // The instruction's own mode stands before that of the entry point.
        let own = [FP_FAST_MATH_MODE, (ALLOW_CONTRACT | IGNORE_ZERO_SIGN) as u32];
        let own = licence(Some(FLOAT_CONTROLS2), &own, some);
        assert!(own.contracts && !own.reassociates && own.ignores_zero_sign);
    }
}
