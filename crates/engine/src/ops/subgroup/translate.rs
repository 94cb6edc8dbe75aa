//! Translates subgroup instructions to operations.

use rspirv::spirv::GroupOperation;

use crate::machine::Reg;
use crate::module::ty::Type;
use crate::module::{Id, Instruction, Opcode};
use crate::ops::conversion::{self, Conversion};
use crate::ops::integer_operand::ReadAs;
use crate::ops::lane_kernel::OpFamily;
use crate::ops::op::Op as Operation;
use crate::ops::subgroup::{BallotCount, OPCODES, ReadSource, ReductionKind, SubgroupKind, SubgroupOp};
use crate::ops::translate::Translator;
use crate::ops::value_registers::{Words, registers_from};
use crate::ops::{arithmetic, bit, glsl, relational_logical};
use anyhit_base::error::Result;

/// Translates subgroup instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    use Opcode as O;
    if !OPCODES.contains(&opcode) {
        return Ok(false);
    }
    // The instructions of the older extensions have no scope operand.
    let first = match opcode {
        O::SubgroupBallotKHR
        | O::SubgroupFirstInvocationKHR
        | O::SubgroupAllKHR
        | O::SubgroupAnyKHR
        | O::SubgroupAllEqualKHR
        | O::SubgroupReadInvocationKHR
        | O::GroupNonUniformQuadAllKHR
        | O::GroupNonUniformQuadAnyKHR
        | O::GroupNonUniformPartitionEXT => 0,
        _ => 1,
    };
    let kind = match opcode {
        O::GroupNonUniformElect => SubgroupKind::Elect,
        O::GroupNonUniformAll | O::SubgroupAllKHR => SubgroupKind::All(0),
        O::GroupNonUniformAny | O::SubgroupAnyKHR => SubgroupKind::Any(0),
        O::GroupNonUniformQuadAllKHR => SubgroupKind::All(4),
        O::GroupNonUniformQuadAnyKHR => SubgroupKind::Any(4),
        O::GroupNonUniformAllEqual | O::SubgroupAllEqualKHR => SubgroupKind::AllEqual,
        O::GroupNonUniformBallot | O::SubgroupBallotKHR => SubgroupKind::Ballot,
        O::GroupNonUniformPartitionEXT => SubgroupKind::Partition,
        O::GroupNonUniformBroadcastFirst | O::SubgroupFirstInvocationKHR => {
            SubgroupKind::Read(ReadSource::First)
        }
        O::GroupNonUniformBroadcast | O::GroupNonUniformShuffle | O::SubgroupReadInvocationKHR => {
            SubgroupKind::Read(ReadSource::Index)
        }
        O::GroupNonUniformShuffleXor => SubgroupKind::Read(ReadSource::Xor),
        O::GroupNonUniformShuffleUp => SubgroupKind::Read(ReadSource::Up),
        O::GroupNonUniformShuffleDown => SubgroupKind::Read(ReadSource::Down),
        O::GroupNonUniformQuadBroadcast => SubgroupKind::Read(ReadSource::Quad),
        O::GroupNonUniformQuadSwap => SubgroupKind::Read(ReadSource::QuadSwap),
        O::GroupNonUniformRotateKHR => {
            SubgroupKind::Read(ReadSource::Rotate(cluster(translator, instruction, 3)?))
        }
        O::GroupNonUniformInverseBallot => SubgroupKind::BallotBit { own: true },
        O::GroupNonUniformBallotBitExtract => SubgroupKind::BallotBit { own: false },
        O::GroupNonUniformBallotFindLSB => SubgroupKind::BallotCount(BallotCount::FindLsb),
        O::GroupNonUniformBallotFindMSB => SubgroupKind::BallotCount(BallotCount::FindMsb),
        O::GroupNonUniformBallotBitCount => {
            let operation = translator.literal(instruction, 1)?;
            let bits = match GroupOperation::from_u32(operation) {
                Some(GroupOperation::Reduce) => BallotCount::Count,
                Some(GroupOperation::InclusiveScan) => BallotCount::CountInclusive,
                Some(GroupOperation::ExclusiveScan) => BallotCount::CountExclusive,
                _ => return Err(translator.invalid("the group operation cannot count bits")),
            };
            let value = translator.id(instruction, 2)?;
            emit(translator, instruction, SubgroupKind::BallotCount(bits), Some(value), None)?;
            return Ok(true);
        }
        _ => return reduction(translator, instruction).map(|()| true),
    };
    let count = translator.operands(instruction).len();
    let id = |translator: &Translator<'_>, at: usize| {
        if at < count { translator.id(instruction, at).map(Some) } else { Ok(None) }
    };
    let value = if kind == SubgroupKind::Elect { None } else { id(translator, first)? };
    let operand = if kind == SubgroupKind::Elect { None } else { id(translator, first + 1)? };
    emit(translator, instruction, kind, value, operand)?;
    Ok(true)
}

fn cluster(translator: &mut Translator<'_>, instruction: &Instruction, at: usize) -> Result<u32> {
    match translator.operands(instruction).get(at) {
        None => Ok(0),
        Some(&id) => match translator.constant_integer(Id(id))? {
            size @ 1..=128 if size.is_power_of_two() => Ok(size as u32),
            // Undefined where it is executed, not a broken rule.
            size => Err(translator.unsupported(format!("a cluster of {size} invocations is not supported"))),
        },
    }
}

fn emit(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    kind: SubgroupKind,
    value: Option<Id>,
    operand: Option<Id>,
) -> Result<()> {
    let mut registers = [(Reg(0), 0); 2];
    if let Some(id) = value {
        let words = translator.words(id)?;
        registers[0] = (translator.consecutive(&words)?, words.len() as u32);
    }
    if let Some(id) = operand {
        // The id of an invocation, or the index of a bit: an integer of any width.
        registers[1] = match kind {
            SubgroupKind::Read(_) | SubgroupKind::BallotBit { .. } => {
                (translator.integer(id, ReadAs::Unsigned)?, 1)
            }
            _ => {
                let words = translator.words(id)?;
                (translator.consecutive(&words)?, words.len() as u32)
            }
        };
    }
    let ty = translator.result_type(instruction)?;
    let results = translator.word_count(ty)?;
    if let SubgroupKind::BallotCount(_) = kind {
        // The count has 32 bits, and is converted to the width of the result.
        let counted = emit_op(translator, kind, 1, registers)?;
        let width = translator.scalar_width(ty)?;
        let first = match conversion::kernel(Conversion::U, 32, width) {
            Some(kernel) => translator.emit_kernel(kernel, &[counted])?,
            None => counted,
        };
        translator.define_result(instruction, registers_from(first, results));
        return Ok(());
    }
    let fits = match kind {
        SubgroupKind::Read(_) => registers[0].1 == results,
        SubgroupKind::Ballot | SubgroupKind::Partition => results == 4,
        _ => results == 1,
    };
    if !fits {
        return Err(translator.invalid("the result of a subgroup instruction has the wrong type"));
    }
    let to = emit_op(translator, kind, results, registers)?;
    translator.define_result(instruction, registers_from(to, results));
    Ok(())
}

/// Appends an operation on a value and a second operand, each its first register and how many there
/// are, and gives the first register of the result.
fn emit_op(
    translator: &mut Translator<'_>,
    kind: SubgroupKind,
    results: u32,
    from: [(Reg, u32); 2],
) -> Result<Reg> {
    let to = translator.fresh(results)?;
    let [(value, values), (operand, operands)] = from;
    translator.emit(Operation::Subgroup(Box::new(SubgroupOp {
        kind,
        to,
        results,
        value,
        values,
        operand,
        operands,
    })));
    Ok(to)
}

/// Appends a read of a value of some words from another invocation, which depends on this
/// invocation's id alone.
pub fn read(translator: &mut Translator<'_>, from: ReadSource, value: Reg, words: u32) -> Result<Reg> {
    emit_op(translator, SubgroupKind::Read(from), words, [(value, words), (Reg(0), 0)])
}

/// Appends a read of a value of some words from an invocation that an operand determines.
pub fn read_from_index(
    translator: &mut Translator<'_>,
    from: ReadSource,
    value: Reg,
    words: u32,
    operand: Reg,
) -> Result<Reg> {
    emit_op(translator, SubgroupKind::Read(from), words, [(value, words), (operand, 1)])
}

/// Reductions and scans, component by component.
fn reduction(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    use Opcode as O;
    let (family, identity): (&'static OpFamily, fn(u32) -> u64) = match opcode {
        O::GroupNonUniformIAdd | O::GroupIAddNonUniformAMD => (&arithmetic::IAdd, |_| 0),
        O::GroupNonUniformFAdd | O::GroupFAddNonUniformAMD => (&arithmetic::FAdd, |_| 0),
        O::GroupNonUniformIMul => (&arithmetic::IMul, |_| 1),
        O::GroupNonUniformFMul => (&arithmetic::FMul, |width| float(width, 1.0)),
        O::GroupNonUniformSMin | O::GroupSMinNonUniformAMD => (&glsl::SMin, |width| u64::MAX >> (65 - width)),
        O::GroupNonUniformUMin | O::GroupUMinNonUniformAMD => (&glsl::UMin, |width| u64::MAX >> (64 - width)),
        O::GroupNonUniformFMin | O::GroupFMinNonUniformAMD => {
            (&glsl::NMin, |width| float(width, f64::INFINITY))
        }
        O::GroupNonUniformSMax | O::GroupSMaxNonUniformAMD => (&glsl::SMax, |width| 1 << (width - 1)),
        O::GroupNonUniformUMax | O::GroupUMaxNonUniformAMD => (&glsl::UMax, |_| 0),
        O::GroupNonUniformFMax | O::GroupFMaxNonUniformAMD => {
            (&glsl::NMax, |width| float(width, f64::NEG_INFINITY))
        }
        O::GroupNonUniformBitwiseAnd => (&bit::BitwiseAnd, |width| u64::MAX >> (64 - width)),
        O::GroupNonUniformBitwiseOr => (&bit::BitwiseOr, |_| 0),
        O::GroupNonUniformBitwiseXor => (&bit::BitwiseXor, |_| 0),
        O::GroupNonUniformLogicalAnd => (&relational_logical::LogicalAnd, |_| 1),
        O::GroupNonUniformLogicalOr => (&relational_logical::LogicalOr, |_| 0),
        _ => (&relational_logical::LogicalNotEqual, |_| 0),
    };
    let ty = translator.result_type(instruction)?;
    let width = translator.scalar_width(ty)?;
    let kernel = family.kernel(width);
    let kernel = kernel.ok_or_else(|| {
        translator.unsupported(format!("{} on {width}-bit operands is not supported", family.name))
    })?;
    let operation = translator.literal(instruction, 1)?;
    let identity = {
        let bits = identity(width);
        if kernel.words == 2 { translator.wide_constant(bits)? } else { translator.constant(bits as u32)? }
    };
    let (reduction, partitioned) = match GroupOperation::from_u32(operation) {
        Some(GroupOperation::Reduce) => (ReductionKind::Reduce(0), false),
        Some(GroupOperation::InclusiveScan) => (ReductionKind::InclusiveScan, false),
        Some(GroupOperation::ExclusiveScan) => (ReductionKind::ExclusiveScan(identity), false),
        Some(GroupOperation::ClusteredReduce) => {
            (ReductionKind::Reduce(cluster(translator, instruction, 3)?), false)
        }
        Some(GroupOperation::PartitionedReduceEXT) => (ReductionKind::Reduce(0), true),
        Some(GroupOperation::PartitionedInclusiveScanEXT) => (ReductionKind::InclusiveScan, true),
        Some(GroupOperation::PartitionedExclusiveScanEXT) => (ReductionKind::ExclusiveScan(identity), true),
        _ => {
            return Err(translator
                .invalid(format!("group operation {operation} does not exist for this instruction")));
        }
    };
    let kind = SubgroupKind::Reduce { kernel, reduction, partitioned };
    let partition = if partitioned {
        let words = translator.operand(instruction, 3)?;
        if words.len() != 4 {
            return Err(translator.invalid("the partition is not a vector of four components"));
        }
        (translator.consecutive(&words)?, 4)
    } else {
        (Reg(0), 0)
    };
    let id = translator.id(instruction, 2)?;
    if !matches!(
        translator.module.ty(translator.type_of(id)?),
        Type::Bool | Type::Int { .. } | Type::Float { .. } | Type::Vector { .. }
    ) {
        return Err(translator.invalid("the operand of a group operation is not a scalar or vector"));
    }
    let mut words = Words::new();
    for value in translator.components(id)? {
        let to = emit_op(translator, kind, kernel.words, [(value, kernel.words), partition])?;
        words.extend((0..kernel.words).map(|word| to.plus(word)));
    }
    translator.define_result(instruction, words);
    Ok(())
}

fn float(width: u32, value: f64) -> u64 {
    match width {
        16 => crate::math::float::f64_to_f16(value).to_bits().into(),
        32 => (value as f32).to_bits().into(),
        _ => value.to_bits(),
    }
}
