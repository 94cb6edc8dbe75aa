//! What the sanitizer does at each operation of a program, prepared before it runs.

mod counters;
mod floats;
mod flow;
mod instruction;
mod operands;
mod specials;
pub(super) mod stale;
mod uniformity;
mod values;

use std::sync::Arc;

use rspirv::spirv::Scope;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::cause::OpPlace;
use crate::flushed_use::{FlushedUse, comparison};
use crate::rule::{Rule, arithmetic, subgroup};
use anyhit_engine::machine::{BlockIndex, OpIndex, Reg};
use anyhit_engine::module::{Id, Module, Opcode};
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::ray_query::RayQueryOp;
use anyhit_engine::ops::subgroup::{ReadSource, SubgroupKind};
use anyhit_engine::ops::{address, observed};
use anyhit_engine::program::{InstructionSpan, Program};
pub use counters::FloatCounter;
use counters::float_counters;
pub use floats::FastMath;
use floats::Preserved;
pub use flow::Flow;
pub(super) use instruction::InstructionWords;
pub use operands::OpenCheck;
use operands::Operation;
pub use specials::Specials;
use stale::{StalePlan, reads_clock, stale_plans};
use uniformity::UniformityPlan;
pub(super) use uniformity::{ResourceOperand, UniformReason, Uniformity};
use values::Values;

/// What is done at an operation.
#[derive(Clone, Debug, Default)]
pub struct OpPlan {
    /// Whether a kernel's operation only has to be followed: none of its rules is about it.
    pub is_plain: bool,
    /// How undefined operands of a kernel spread.
    pub flow: Flow,
    /// Whether its result may be a NaN or infinite.
    pub specials: Specials,
    /// Rules about its operands.
    pub checks: Box<[OpenCheck]>,
    /// Bits of a scalar of the instruction's result, where `checks` need it.
    pub result_width: u32,
    /// Whether an operation that compares floats is told of NaN.
    pub watches_special: bool,
    /// Whether the shader declares that NaN and infinity are preserved in an operation's result.
    pub preserves_special: bool,
    /// Whether nothing uses the result of `OpRayQueryProceedKHR`.
    pub ignores_result: bool,
    /// The rule about what an instruction reads from another lane that is not active; `None` where
    /// there is none.
    pub inactive: Option<&'static Rule>,
    /// Which operand counts the turns of a loop, where it is a sum that does.
    pub counter: Option<FloatCounter>,
    /// Whether it gives the clock of the subgroup.
    pub reads_clock: bool,
    /// Whether it compares a value with that which `OpExpectKHR` expects.
    pub expects: bool,
    /// What changes where its subnormal operands are flushed to 0.
    pub flushed: Option<FlushedUse>,
    /// What an operation on floats is promised of its operands and its result.
    pub fast_math: FastMath,
    /// What must be the same in all lanes of a subgroup.
    pub uniformity: Option<Uniformity>,
    /// Of a kernel whose operands say how large or where an array is: what is looked at.
    pub watched: Option<Watched>,
    /// The variable whose life begins.
    pub variable: Option<Id>,
    /// The specialization constant that it computes.
    pub constant: Option<Id>,
}

impl OpPlan {
    /// Finds out whether it is plain.
    fn finished(self) -> Self {
        let is_plain = self.checks.is_empty()
            && self.fast_math.is_none()
            && self.counter.is_none()
            && !self.expects
            && self.flushed.is_none()
            && !self.watches_special
            && self.uniformity.is_none()
            && self.watched.is_none();
        Self { is_plain, ..self }
    }
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
    /// The kinds of values that go stale and are followed.
    pub stale: Vec<StalePlan>,
    /// The blocks that have barriers of scope Subgroup, each with the word offset of one.
    pub subgroup_barriers: Vec<(BlockIndex, u32)>,
}

impl ProgramPlan {
    /// Whether something is checked that lanes must have in common.
    pub fn compares_lanes(&self) -> bool {
        self.steps.iter().any(|step| step.uniformity.is_some())
    }

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
        let counters = float_counters(&program.module);
        let steps = program.ops.iter().zip(origins).enumerate().map(|(at, (op, origin))| {
            if let Some(&word) = program.constant_operations.get(&OpIndex::new(at)) {
                let instruction = InstructionWords::at(&program.module, word).computed_constant();
                let step = step(&program.module, instruction, op, &constants, &preserved);
                return OpPlan { constant: instruction.result(&program.module), ..step }.finished();
            }
            let instruction = InstructionWords::at(&program.module, origin.offset);
            let uniformity = uniformity.of(op, instruction);
            let result = instruction.words.get(2).map(|&id| Id(id));
            let ignores_result = proceeds(op) && result.is_some_and(|id| !used.contains(&id));
            let step = step(&program.module, instruction, op, &constants, &preserved);
            let watched = watched(&program.module, instruction, op, &values);
            let counter = counters.get(&origin.offset).copied();
            let reads_clock = reads_clock(&program.module, origin.offset);
            OpPlan { uniformity, ignores_result, watched, counter, reads_clock, ..step }.finished()
        });
        Self {
            program: program.clone(),
            steps: steps.collect(),
            stale: stale_plans(program),
            subgroup_barriers: subgroup_barriers(program),
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
            let flow = Flow::of(kernel);
            let known = instruction.known(module);
            let operation = Operation { kernel, from, result_width, constants };
            let checks = known.into_iter().flat_map(|known| operation.open_checks(known));
            let is_open = |open: &OpenCheck| {
                let check = open.check;
                let tests_nan = check.rule == &arithmetic::NAN_TEST_FOLDED;
                let holds = tests_nan && preserved.tests(module, instruction, kernel.float_operands[0]);
                !holds && check.decoration.is_none_or(|number| instruction.is_decorated(module, number))
            };
            let compares = comparison(instruction.opcode).is_some() && from[0] != from[1];
            let flushed = preserved.flushed_use(instruction, kernel);
            let is_normal = |at: usize| operation.is_normal_constant(at);
            OpPlan {
                flow,
                specials: Specials::of(kernel, flow),
                checks: checks.filter(is_open).collect(),
                result_width,
                preserves_special: preserved.specials(module, instruction, kernel.float_result),
                watches_special: compares && kernel.float_operands[0] > 0 && kernel.float_result == 0,
                expects: kernel.is(&observed::Expectation),
                flushed: flushed.filter(|_| !is_normal(1) && !is_normal(0)),
                fast_math: FastMath::of(instruction, module, kernel),
                ..OpPlan::default()
            }
        }
        Op::Subgroup(subgroup) => {
            let preserves_special = match subgroup.kind {
                SubgroupKind::Reduce { kernel, .. } => {
                    preserved.specials(module, instruction, kernel.float_result)
                }
                _ => false,
            };
            let inactive = inactive_rule(instruction.opcode, subgroup.kind);
            OpPlan { inactive, preserves_special, ..OpPlan::default() }
        }
        _ if op.undefines().is_some() => OpPlan { variable: instruction.variable(), ..OpPlan::default() },
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
    if kernel.is(&address::kernels::AddressElement) {
        return Some(Watched::Address { is_chain: true });
    }
    let operand = |at: usize| instruction.words.get(3 + at).map(|&id| Id(id));
    let is_allocated = |at: usize| operand(at).is_some_and(|id| values.is_allocated(id));
    match instruction.opcode {
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
fn inactive_rule(opcode: Opcode, kind: SubgroupKind) -> Option<&'static Rule> {
    let SubgroupKind::Read(source) = kind else { return None };
    match (source, opcode) {
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
    let barriers = module.instructions().filter(|one| {
        let scope = module.operands(one).first().and_then(|&scope| module.scalar_value(Id(scope)));
        one.opcode.is_control_barrier() && scope == Some(Scope::Subgroup as u64)
    });
    let spans = |offset: u32| {
        let holds = move |span: &&InstructionSpan| (span.first..=span.last).contains(&offset);
        program.instruction_spans.iter().filter(holds).map(move |span| (span.block, offset))
    };
    barriers.flat_map(|barrier| spans(barrier.offset)).collect()
}

/// The ids that instructions of functions use.
fn used_ids(module: &Module) -> FxHashSet<Id> {
    module.instructions().flat_map(|one| module.operand_ids(one)).collect()
}
