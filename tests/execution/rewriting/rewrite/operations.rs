//! Operations: which are pure, which work by component, and what they may be written as instead.

use rspirv::spirv::Op;

use super::build::{Code, Index, Rng};
use super::places::choose;
use super::words::{Inst, Module};

/// Whether an operation works on each component by itself, results and operands alike in shape.
pub fn is_by_component(op: Op) -> bool {
    use Op::*;
    matches!(
        op,
        SNegate
            | FNegate
            | Not
            | LogicalNot
            | ConvertFToU
            | ConvertFToS
            | ConvertSToF
            | ConvertUToF
            | UConvert
            | SConvert
            | FConvert
            | IsNan
            | IsInf
            | BitReverse
            | BitCount
            | QuantizeToF16
            | Bitcast
            | Select
    ) || is_binary(op)
}

fn is_binary(op: Op) -> bool {
    use Op::*;
    matches!(
        op,
        IAdd | FAdd
            | ISub
            | FSub
            | IMul
            | FMul
            | UDiv
            | SDiv
            | FDiv
            | UMod
            | SRem
            | SMod
            | FRem
            | FMod
            | ShiftRightLogical
            | ShiftRightArithmetic
            | ShiftLeftLogical
            | BitwiseOr
            | BitwiseXor
            | BitwiseAnd
            | LogicalOr
            | LogicalAnd
            | LogicalEqual
            | LogicalNotEqual
    ) || turned(op).is_some()
}

/// A comparison, and which it is with operands exchanged; operations that commute, too.
fn turned(op: Op) -> Option<Op> {
    use Op::*;
    Some(match op {
        IAdd | FAdd | IMul | FMul | BitwiseOr | BitwiseXor | BitwiseAnd | LogicalOr | LogicalAnd
        | LogicalEqual | LogicalNotEqual | IEqual | INotEqual | FOrdEqual | FUnordEqual | FOrdNotEqual
        | FUnordNotEqual | Dot => op,
        UGreaterThan => ULessThan,
        ULessThan => UGreaterThan,
        SGreaterThan => SLessThan,
        SLessThan => SGreaterThan,
        UGreaterThanEqual => ULessThanEqual,
        ULessThanEqual => UGreaterThanEqual,
        SGreaterThanEqual => SLessThanEqual,
        SLessThanEqual => SGreaterThanEqual,
        FOrdGreaterThan => FOrdLessThan,
        FOrdLessThan => FOrdGreaterThan,
        FUnordGreaterThan => FUnordLessThan,
        FUnordLessThan => FUnordGreaterThan,
        FOrdGreaterThanEqual => FOrdLessThanEqual,
        FOrdLessThanEqual => FOrdGreaterThanEqual,
        FUnordGreaterThanEqual => FUnordLessThanEqual,
        FUnordLessThanEqual => FUnordGreaterThanEqual,
        _ => return None,
    })
}

/// Whether an instruction only calculates: it touches no memory and may be made again or elsewhere.
pub fn is_pure(inst: &Inst, glsl: Option<u32>) -> bool {
    use Op::*;
    is_by_component(inst.op)
        || matches!(
            inst.op,
            VectorTimesScalar | MatrixTimesScalar | VectorTimesMatrix | MatrixTimesVector
                | MatrixTimesMatrix | Transpose | OuterProduct | Dot | Any | All | CompositeConstruct
                | CompositeExtract | CompositeInsert | VectorShuffle | VectorExtractDynamic
                | VectorInsertDynamic | CopyObject | CopyLogical | BitFieldInsert | BitFieldSExtract
                | BitFieldUExtract
        )
        // Modf, Frexp and the interpolations take pointers.
        || (inst.op == ExtInst
            && glsl == Some(inst.rest[0])
            && !matches!(inst.rest[1], 35 | 51 | 76..=78))
}

/// Whether an operand may be any value, and need not be a constant.
pub fn takes_any(inst: &Inst, position: usize) -> bool {
    use Op::*;
    match inst.op {
        Store => position == 1,
        BranchConditional | Switch | ReturnValue => position == 0,
        FunctionCall => position > 0,
        Phi => position.is_multiple_of(2),
        ExtInst => false,
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
