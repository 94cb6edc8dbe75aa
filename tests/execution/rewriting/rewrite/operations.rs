//! Operations: which are pure, which work by component, and what they may be written as instead.

use anyhit_engine::module::Opcode as Op;

use super::build::{Code, Index, Rng};
use super::places::choose;
use super::words::{Inst, Module};

/// Whether an operation works on each component by itself, results and operands alike in shape.
pub fn is_by_component(op: Op) -> bool {
    matches!(
        op,
        Op::SNegate
            | Op::FNegate
            | Op::Not
            | Op::LogicalNot
            | Op::ConvertFToU
            | Op::ConvertFToS
            | Op::ConvertSToF
            | Op::ConvertUToF
            | Op::UConvert
            | Op::SConvert
            | Op::FConvert
            | Op::IsNan
            | Op::IsInf
            | Op::BitReverse
            | Op::BitCount
            | Op::QuantizeToF16
            | Op::Bitcast
            | Op::Select
    ) || is_binary(op)
}

fn is_binary(op: Op) -> bool {
    matches!(
        op,
        Op::IAdd
            | Op::FAdd
            | Op::ISub
            | Op::FSub
            | Op::IMul
            | Op::FMul
            | Op::UDiv
            | Op::SDiv
            | Op::FDiv
            | Op::UMod
            | Op::SRem
            | Op::SMod
            | Op::FRem
            | Op::FMod
            | Op::ShiftRightLogical
            | Op::ShiftRightArithmetic
            | Op::ShiftLeftLogical
            | Op::BitwiseOr
            | Op::BitwiseXor
            | Op::BitwiseAnd
            | Op::LogicalOr
            | Op::LogicalAnd
            | Op::LogicalEqual
            | Op::LogicalNotEqual
    ) || turned(op).is_some()
}

/// A comparison, and which it is with operands exchanged; operations that commute, too.
fn turned(op: Op) -> Option<Op> {
    Some(match op {
        Op::IAdd
        | Op::FAdd
        | Op::IMul
        | Op::FMul
        | Op::BitwiseOr
        | Op::BitwiseXor
        | Op::BitwiseAnd
        | Op::LogicalOr
        | Op::LogicalAnd
        | Op::LogicalEqual
        | Op::LogicalNotEqual
        | Op::IEqual
        | Op::INotEqual
        | Op::FOrdEqual
        | Op::FUnordEqual
        | Op::FOrdNotEqual
        | Op::FUnordNotEqual
        | Op::Dot => op,
        Op::UGreaterThan => Op::ULessThan,
        Op::ULessThan => Op::UGreaterThan,
        Op::SGreaterThan => Op::SLessThan,
        Op::SLessThan => Op::SGreaterThan,
        Op::UGreaterThanEqual => Op::ULessThanEqual,
        Op::ULessThanEqual => Op::UGreaterThanEqual,
        Op::SGreaterThanEqual => Op::SLessThanEqual,
        Op::SLessThanEqual => Op::SGreaterThanEqual,
        Op::FOrdGreaterThan => Op::FOrdLessThan,
        Op::FOrdLessThan => Op::FOrdGreaterThan,
        Op::FUnordGreaterThan => Op::FUnordLessThan,
        Op::FUnordLessThan => Op::FUnordGreaterThan,
        Op::FOrdGreaterThanEqual => Op::FOrdLessThanEqual,
        Op::FOrdLessThanEqual => Op::FOrdGreaterThanEqual,
        Op::FUnordGreaterThanEqual => Op::FUnordLessThanEqual,
        Op::FUnordLessThanEqual => Op::FUnordGreaterThanEqual,
        _ => return None,
    })
}

/// Whether an instruction only calculates: it touches no memory and may be made again or elsewhere.
pub fn is_pure(inst: &Inst, glsl: Option<u32>) -> bool {
    is_by_component(inst.op)
        || matches!(
            inst.op,
            Op::VectorTimesScalar | Op::MatrixTimesScalar | Op::VectorTimesMatrix | Op::MatrixTimesVector
                | Op::MatrixTimesMatrix | Op::Transpose | Op::OuterProduct | Op::Dot | Op::Any | Op::All | Op::CompositeConstruct
                | Op::CompositeExtract | Op::CompositeInsert | Op::VectorShuffle | Op::VectorExtractDynamic
                | Op::VectorInsertDynamic | Op::CopyObject | Op::CopyLogical | Op::BitFieldInsert | Op::BitFieldSExtract
                | Op::BitFieldUExtract
        )
        // Modf, Frexp and the interpolations take pointers.
        || (inst.op == Op::ExtInst
            && glsl == Some(inst.rest[0])
            && !matches!(inst.rest[1], 35 | 51 | 76..=78))
}

/// Whether an operand may be any value, and need not be a constant.
pub fn takes_any(inst: &Inst, position: usize) -> bool {
    match inst.op {
        Op::Store => position == 1,
        Op::BranchConditional | Op::Switch | Op::ReturnValue => position == 0,
        Op::FunctionCall => position > 0,
        Op::Phi => position.is_multiple_of(2),
        Op::ExtInst => false,
        _ => is_pure(inst, None),
    }
}

/// Component by component.
pub fn scalarised(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let index = Index::of(module);
    let wanted = |inst: &Inst| {
        let shape = index.vector(inst.ty).1;
        let alike = |id: u32| index.types.get(&id).is_some_and(|ty| index.vector(*ty).1 == shape);
        is_by_component(inst.op) && shape > 1 && inst.operands().all(alike) && !index.is_decorated(inst.id)
    };
    let (function, block, at) = *choose(module, rng, wanted).first()?;
    let inst = module.functions[function].blocks[block].body[at].clone();
    let (component, count) = index.vector(inst.ty);
    let mut code = Code::new(module, &inst.place);
    let mut all = Vec::new();
    for lane in 0..count {
        let mut operands = Vec::new();
        for operand in inst.operands() {
            let part = index.vector(index.types[&operand]).0;
            operands.push(code.op(module, Op::CompositeExtract, part, &[operand, lane]));
        }
        all.push(code.op(module, inst.op, component, &operands));
    }
    let body = &mut module.functions[function].blocks[block].body;
    body[at] = Inst::new(Op::CompositeConstruct, inst.ty, inst.id, &all, &inst.place);
    code.insert(module, function, block, at);
    Some(())
}

/// Operands exchanged.
pub fn commuted(module: &mut Module, rng: &mut Rng) -> Option<()> {
    let sites = choose(module, rng, |inst| turned(inst.op).is_some() && inst.rest[0] != inst.rest[1]);
    let (function, block, at) = *sites.first()?;
    let inst = &mut module.functions[function].blocks[block].body[at];
    inst.op = turned(inst.op)?;
    inst.rest.swap(0, 1);
    Some(())
}
