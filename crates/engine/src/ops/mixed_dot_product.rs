//! Dot products of small floats with an accumulator (`SPV_VALVE_mixed_float_dot_product`).
//!
//! "Exact order and precision of these operations is implementation defined": components are
//! converted to f32, where products of them are exact but for bfloat16 and E5M2 beyond its range;
//! products are added in their order, then the accumulator. f16 with an accumulator of f16 stays in
//! f16, and a result of bfloat16 is rounded once.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::math::float_format::FloatFormat;
use crate::module::ty::{Type, TypeId};
use crate::module::{Instruction, Opcode};
use crate::ops::arithmetic::{FAdd, FMul};
use crate::ops::conversion::{self, Conversion, encoded};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] =
    &[Opcode::FDot2MixAcc32VALVE, Opcode::FDot2MixAcc16VALVE, Opcode::FDot4MixAcc32VALVE];

/// Translates the instructions of this file; `false` for any other.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    if !OPCODES.contains(&instruction.opcode) {
        return Ok(false);
    }
    let ty = translator.result_type(instruction)?;
    let ids = [0, 1, 2].map(|at| translator.id(instruction, at));
    let [left, right, accumulator] = ids;
    let [left, right, accumulator] = [left?, right?, accumulator?];
    check(translator, instruction, ty)?;
    let own_format = translator.float_format(ty);
    let format = translator.type_of(left).map(|ty| translator.float_format(ty))?;
    let width = if own_format == Some(FloatFormat::Binary16) { 16 } else { 32 };
    let mut sum: Option<Reg> = None;
    for (a, b) in translator.components(left)?.into_iter().zip(translator.components(right)?) {
        let (a, b) = (widened(translator, format, width, a)?, widened(translator, format, width, b)?);
        let product = translator.emit_family(&FMul, width, &[a, b])?;
        sum = Some(match sum {
            Some(sum) => translator.emit_family(&FAdd, width, &[sum, product])?,
            None => product,
        });
    }
    let sum = sum.ok_or_else(|| translator.invalid("a dot product of empty vectors"))?;
    let addend = translator.components(accumulator)?[0];
    let addend = widened(translator, own_format, width, addend)?;
    let mut result = translator.emit_family(&FAdd, width, &[sum, addend])?;
    if own_format == Some(FloatFormat::BFloat16) {
        result = translator.emit_family(&encoded::ToBFloat16, 32, &[result])?;
    }
    translator.define_result(instruction, SmallVec::from_slice(&[result]));
    Ok(true)
}

/// A float in the width of the sum.
fn widened(
    translator: &mut Translator<'_>,
    format: Option<FloatFormat>,
    width: u32,
    value: Reg,
) -> Result<Reg> {
    match format {
        Some(FloatFormat::Binary16) => match conversion::kernel(Conversion::F, 16, width) {
            Some(kernel) => translator.emit_kernel(kernel, &[value]),
            None => Ok(value),
        },
        Some(format) => Ok(encoded::widen(translator, format, value)?.0),
        None => Ok(value),
    }
}

/// Checks the types of operands, and the capability for them.
fn check(translator: &Translator<'_>, instruction: &Instruction, ty: TypeId) -> Result<()> {
    /// `DotProductFloat16AccFloat32VALVE`
    const TO_FLOAT: u32 = 6912;
    /// `DotProductFloat16AccFloat16VALVE`
    const TO_HALF: u32 = 6913;
    /// `DotProductBFloat16AccVALVE`
    const OF_BFLOAT16: u32 = 6914;
    /// `DotProductFloat8AccFloat32VALVE`
    const OF_FLOAT8: u32 = 6915;
    let opcode = instruction.opcode;
    let type_of = |at| translator.id(instruction, at).and_then(|id| translator.type_of(id));
    let (vectors, others, accumulator) = (type_of(0)?, type_of(1)?, type_of(2)?);
    let invalid = |what: &str| {
        Err(translator.invalid(format!("{opcode}: {what}")).note("SPV_VALVE_mixed_float_dot_product"))
    };
    let Type::Vector { component, count } = *translator.module.ty(vectors) else {
        return invalid("the operands must be vectors");
    };
    if vectors != others || accumulator != ty {
        return invalid("the vectors must have one type, and the accumulator that of the result");
    }
    use FloatFormat::{BFloat16, Binary16, Binary32, E4M3, E5M2};
    let formats = [component, ty].map(|ty| translator.module.ty(ty).float_format());
    let capability = match (opcode, count, formats) {
        (Opcode::FDot2MixAcc32VALVE, 2, [Some(Binary16), Some(Binary32)]) => TO_FLOAT,
        (Opcode::FDot2MixAcc16VALVE, 2, [Some(Binary16), Some(Binary16)]) => TO_HALF,
        (Opcode::FDot2MixAcc32VALVE, 2, [Some(BFloat16), Some(Binary32)])
        | (Opcode::FDot2MixAcc16VALVE, 2, [Some(BFloat16), Some(BFloat16)]) => OF_BFLOAT16,
        (Opcode::FDot4MixAcc32VALVE, 4, [Some(E4M3 | E5M2), Some(Binary32)]) => OF_FLOAT8,
        _ => return invalid("no such types are multiplied"),
    };
    match translator.module.capabilities.contains(&capability) {
        true => Ok(()),
        false => invalid(&format!(
            "the capability {} is required",
            crate::module::names::capability_name(capability)
        )),
    }
}
