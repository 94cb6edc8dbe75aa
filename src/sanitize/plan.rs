//! What the sanitizer does at each operation of a program, prepared before it runs.

mod instruction;
pub(super) mod lane_inputs;
mod uniformity;
mod values;

use std::sync::Arc;

use rspirv::spirv::{ExecutionMode, FPFastMathMode, Op as Opcode, Scope};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::machine::{BlockIndex, OpIndex, Reg, Registers};
use crate::module::{Id, Module};
use crate::ops::lane_kernel::{InstructionSet, LaneKernel, family};
use crate::ops::op::Op;
use crate::ops::ray_query::RayQueryOp;
use crate::ops::subgroup::{ReadSource, SubgroupKind};
use crate::program::{InstructionSpan, Program};
use crate::sanitize::cause::OpPlace;
use crate::sanitize::operand_check::{CheckedInstruction, LaneOperands, OperandCheck, checks_of};
use crate::sanitize::rule::{Rule, arithmetic, subgroup};
pub(super) use instruction::InstructionWords;
use instruction::scalar_width;
use lane_inputs::tracked_inputs;
use uniformity::UniformityPlan;
pub(super) use uniformity::{ResourceOperand, UniformReason, Uniformity};
use values::Values;

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
}

/// What is done at an operation.
#[derive(Clone, Debug, Default)]
pub struct OpPlan {
    /// How undefined operands of a kernel spread.
    pub flow: Flow,
    /// Rules about its operands.
    pub checks: Box<[&'static OperandCheck]>,
    /// Bits of a scalar of the instruction's result, where `checks` need it.
    pub result_width: u32,
    /// Whether an operation that compares floats is told of NaN, or one that stores them.
    pub watches_nan: bool,
    /// Whether nothing uses the result of `OpRayQueryProceedKHR`.
    pub ignores_result: bool,
    /// The rule about what an instruction reads from another lane that is not active; `None` where
    /// there is none.
    pub inactive: Option<&'static Rule>,
    /// What an operation on floats is promised of its operands and its result.
    pub fast_math: FastMath,
    /// What must be the same in all lanes of a subgroup.
    pub uniformity: Option<Uniformity>,
    /// Of a kernel whose operands say how large or where an array is: what is looked at.
    pub watched: Option<Watched>,
}

/// Arithmetic on the sizes and places of arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watched {
    /// The length of an array, minus something.
    LengthMinus,
    /// A comparison of what an atomic addition returned with how much there is.
    Allocation {
        /// Which operand was returned.
        counter: usize,
    },
    /// An address, made from another.
    Address {
        /// Whether it is one of an element of the array at the other.
        is_chain: bool,
    },
}

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
}

/// An operation that has run: where it stands, and what is prepared for it.
#[derive(Clone, Copy, Debug)]
pub struct Executed<'a> {
    /// Its shader and its index.
    pub place: OpPlace,
    /// What is done at it.
    pub step: &'a OpPlan,
}

/// A program with what is done at each of its operations.
#[derive(Debug)]
pub struct ProgramPlan {
    /// The program, not optimised.
    pub program: Arc<Program>,
    /// By operation.
    pub steps: Vec<OpPlan>,
    /// Where it is tracked what stands for lanes of a subgroup: the registers of such builtins.
    pub lane_inputs: Option<Box<[Reg]>>,
    /// The blocks that have barriers of scope Subgroup, each with the word offset of one.
    pub subgroup_barriers: Vec<(BlockIndex, u32)>,
}

impl ProgramPlan {
    /// Plans for a program that is not optimised.
    pub fn new(program: &Arc<Program>) -> Self {
        let constants: FxHashMap<Reg, u32> = program.constants.iter().copied().collect();
        let origins = program.origins.iter();
        let uniformity = UniformityPlan::new(program, &constants);
        let proceeds = |op: &Op| matches!(op, Op::RayQuery(RayQueryOp::Proceed { .. }));
        let used =
            if program.ops.iter().any(proceeds) { used_ids(&program.module) } else { FxHashSet::default() };
        let preserved = Preserved::of(program);
        let values = Values::of(&program.module);
        let steps = program.ops.iter().zip(origins).map(|(op, origin)| {
            let instruction = InstructionWords::at(&program.module, origin.offset);
            let uniformity = uniformity.of(op, instruction);
            let result = instruction.words.get(2).map(|&id| Id(id));
            let ignores_result = proceeds(op) && result.is_some_and(|id| !used.contains(&id));
            let step = step(&program.module, instruction, op, &constants, &preserved);
            let watched = watched(&program.module, instruction, op, &values);
            OpPlan { uniformity, ignores_result, watched, ..step }
        });
        let lane_inputs = tracked_inputs(program);
        Self {
            program: program.clone(),
            steps: steps.collect(),
            lane_inputs,
            subgroup_barriers: subgroup_barriers(program),
        }
    }

    /// The variable that an operation declares, if its instruction is `OpVariable`.
    pub fn variable_at(&self, op: OpIndex) -> Option<Id> {
        let module = &self.program.module;
        let instruction = InstructionWords::at(module, self.program.origins.get(op.index())?.offset);
        match (instruction.opcode?, instruction.words) {
            (Opcode::Variable, &[_, _, result, ..]) => Some(Id(result)),
            _ => None,
        }
    }
}

fn step(
    module: &Module,
    instruction: InstructionWords<'_>,
    op: &Op,
    constants: &FxHashMap<Reg, u32>,
    preserved: &Preserved,
) -> OpPlan {
    match op {
        Op::LaneKernel { kernel, from, .. } => {
            let result_width = instruction.result_width(module);
            let flow = flow(kernel);
            let known = instruction.known(module);
            let checks = known.into_iter().flat_map(|known| checks_of(known, kernel));
            let is_open = |check: &&OperandCheck| {
                let tests_nan = check.rule == &arithmetic::NAN_TEST_FOLDED;
                let holds = tests_nan && preserved.holds(module, instruction, kernel.float_operands[0]);
                !holds
                    && check.decoration.is_none_or(|number| instruction.is_decorated(module, number))
                    && !passes(check, kernel, from, result_width, constants)
            };
            let compares = instruction.opcode.is_some_and(is_comparison) && from[0] != from[1];
            OpPlan {
                flow,
                checks: checks.filter(is_open).collect(),
                result_width,
                watches_nan: compares && kernel.float_operands[0] > 0 && kernel.float_result == 0,
                fast_math: fast_math(instruction, module, kernel),
                ..OpPlan::default()
            }
        }
        Op::Subgroup(subgroup) => {
            OpPlan { inactive: inactive_rule(instruction.opcode, subgroup.kind), ..OpPlan::default() }
        }
        Op::Memory(_) => OpPlan { watches_nan: instruction.stores_floats(module), ..OpPlan::default() },
        _ => OpPlan::default(),
    }
}

/// What is looked at of a kernel, for the sizes and places of arrays.
fn watched(
    module: &Module,
    instruction: InstructionWords<'_>,
    op: &Op,
    values: &Values<'_>,
) -> Option<Watched> {
    /// `PhysicalStorageBufferAddresses`
    const DEVICE_ADDRESSES: u32 = 5347;
    use Opcode as O;
    let Op::LaneKernel { kernel, .. } = op else { return None };
    if kernel.name == "AddressElement" {
        return Some(Watched::Address { is_chain: true });
    }
    let operand = |at: usize| instruction.words.get(3 + at).map(|&id| Id(id));
    let is_allocated = |at: usize| operand(at).is_some_and(|id| values.is_allocated(id));
    match instruction.opcode? {
        O::IAdd | O::ISub if kernel.width == 64 && module.capabilities.contains(&DEVICE_ADDRESSES) => {
            Some(Watched::Address { is_chain: false })
        }
        O::ISub if operand(0).is_some_and(|id| values.is_array_length(id)) => Some(Watched::LengthMinus),
        O::ULessThan | O::SLessThan | O::UGreaterThanEqual | O::SGreaterThanEqual if is_allocated(0) => {
            Some(Watched::Allocation { counter: 0 })
        }
        O::UGreaterThan | O::SGreaterThan | O::ULessThanEqual | O::SLessThanEqual if is_allocated(1) => {
            Some(Watched::Allocation { counter: 1 })
        }
        _ => None,
    }
}

/// The rule about a lane that a subgroup instruction reads and that is not active. What the
/// swizzles of `SPV_AMD_shader_ballot` read there is not said.
fn inactive_rule(opcode: Option<Opcode>, kind: SubgroupKind) -> Option<&'static Rule> {
    let SubgroupKind::Read(source) = kind else { return None };
    match (source, opcode?) {
        (_, Opcode::ExtInst) => None,
        (ReadSource::Rotate(_), _) => Some(&subgroup::ROTATE_INACTIVE),
        (ReadSource::Quad | ReadSource::QuadSet(_) | ReadSource::QuadClear(_) | ReadSource::QuadSwap, _) => {
            Some(&subgroup::QUAD_INDEX)
        }
        (_, Opcode::GroupNonUniformBroadcast | Opcode::SubgroupReadInvocationKHR) => {
            Some(&subgroup::BROADCAST_INACTIVE)
        }
        _ => Some(&subgroup::SHUFFLE_INACTIVE),
    }
}

/// Where a program has control barriers of scope Subgroup, which are no operations.
fn subgroup_barriers(program: &Program) -> Vec<(BlockIndex, u32)> {
    let module = &program.module;
    let blocks = module.functions.iter().flat_map(|function| &function.blocks);
    let barriers = blocks.flat_map(|block| &block.instructions).filter(|one| {
        let scope = module.operands(one).first().and_then(|&scope| module.scalar_value(Id(scope)));
        one.opcode == Opcode::ControlBarrier as u16 && scope == Some(Scope::Subgroup as u64)
    });
    let spans = |offset: u32| {
        let holds = move |span: &&InstructionSpan| (span.first..=span.last).contains(&offset);
        program.instruction_spans.iter().filter(holds).map(move |span| (span.block, offset))
    };
    barriers.flat_map(|barrier| spans(barrier.offset)).collect()
}

/// The ids that instructions of functions use.
fn used_ids(module: &Module) -> FxHashSet<Id> {
    let blocks = module.functions.iter().flat_map(|function| &function.blocks);
    blocks.flat_map(|block| &block.instructions).flat_map(|one| module.operand_ids(one)).collect()
}

/// For which floats NaN and infinity are preserved, so that tests for them cannot be folded.
#[derive(Debug, Default)]
struct Preserved {
    /// `SignedZeroInfNanPreserve`: widths.
    widths: Vec<u32>,
    /// `FPFastMathDefault`: widths and modes.
    defaults: Vec<(u32, FPFastMathMode)>,
}

impl Preserved {
    fn of(program: &Program) -> Self {
        let mut preserved = Self::default();
        let mut entries = program.module.entry_points.iter();
        let entry = entries.find(|entry| entry.stage == program.stage && entry.name == program.name);
        for (mode, operands) in entry.into_iter().flat_map(|entry| &entry.modes) {
            match (ExecutionMode::from_u32(*mode), operands.as_slice()) {
                (Some(ExecutionMode::SignedZeroInfNanPreserve), &[width]) => preserved.widths.push(width),
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

    /// Whether the test for NaN or infinity of a float of a width gives what it says.
    fn holds(&self, module: &Module, instruction: InstructionWords<'_>, width: u32) -> bool {
        /// `FPFastMathMode`
        const FP_FAST_MATH_MODE: u32 = 40;
        let ignored = match instruction.opcode {
            Some(Opcode::IsNan) => FPFastMathMode::NOT_NAN,
            _ => FPFastMathMode::NOT_INF,
        };
        let result = instruction.words.get(2).copied();
        let own = result.and_then(|id| module.decorations.literal(Id(id), FP_FAST_MATH_MODE));
        match own {
            Some(bits) => !FPFastMathMode::from_bits_retain(bits).contains(ignored),
            None => {
                let mut defaults = self.defaults.iter().filter(|(own, _)| *own == width);
                self.widths.contains(&width) || defaults.any(|(_, mode)| !mode.contains(ignored))
            }
        }
    }
}

fn flow(kernel: &LaneKernel) -> Flow {
    match kernel.name {
        "LogicalAnd" | "BitwiseAnd" => Flow::And,
        "LogicalOr" => Flow::Or { ones: 1 },
        "BitwiseOr" => Flow::Or { ones: u32::MAX },
        "SelectWord" => Flow::Select,
        _ => Flow::Any,
    }
}

/// Whether constants decide that a check holds.
fn passes(
    check: &OperandCheck,
    kernel: &LaneKernel,
    from: &[Reg; 3],
    result_width: u32,
    constants: &FxHashMap<Reg, u32>,
) -> bool {
    let mut registers = Registers::<1>::new(6);
    let own = [Reg(0), Reg(2), Reg(4)];
    for &at in check.decided_by {
        for word in 0..kernel.operands[at] {
            let Some(&bits) = constants.get(&from[at].plus(word)) else { return false };
            registers.set_lane_words(own[at].plus(word), 0, [bits]);
        }
    }
    !(check.breaks)(&LaneOperands::read(&registers, kernel, &own, result_width, 0))
}

/// What `FPFastMathMode` promises of a kernel's operands and result, where they are those of
/// the instruction, or are NaN or infinite only if its own are.
fn fast_math(instruction: InstructionWords<'_>, module: &Module, kernel: &LaneKernel) -> FastMath {
    const FP_FAST_MATH_MODE: u32 = 40;
    const NOT_NAN: u32 = 1;
    const NOT_INF: u32 = 2;
    let Some(mode) =
        instruction.result(module).and_then(|id| module.decorations.literal(id, FP_FAST_MATH_MODE))
    else {
        return FastMath::default();
    };
    let own = match instruction.known(module) {
        Some(CheckedInstruction::Core(opcode)) => {
            is_sum_of_products(opcode) || is_family_of(InstructionSet::Core, opcode as u32, kernel)
        }
        Some(CheckedInstruction::Glsl(number)) => is_family_of(InstructionSet::Glsl, number as u32, kernel),
        None => false,
    };
    FastMath { not_nan: own && mode & NOT_NAN != 0, not_infinite: own && mode & NOT_INF != 0 }
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

fn is_comparison(opcode: Opcode) -> bool {
    use Opcode as O;
    matches!(
        opcode,
        O::FOrdEqual
            | O::FUnordEqual
            | O::FOrdNotEqual
            | O::FUnordNotEqual
            | O::FOrdLessThan
            | O::FUnordLessThan
            | O::FOrdGreaterThan
            | O::FUnordGreaterThan
            | O::FOrdLessThanEqual
            | O::FUnordLessThanEqual
            | O::FOrdGreaterThanEqual
            | O::FUnordGreaterThanEqual
    )
}
