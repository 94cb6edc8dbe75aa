//! Dot products of integers (SPIR-V 3.3.13, `SPV_KHR_integer_dot_product`): components are widened
//! to the result, multiplied and summed modulo 2^width; the accumulator is added with saturation.

use crate::machine::Reg;
use crate::module::ty::Type;
use crate::module::{Id, Instruction, Opcode};
use crate::ops::arithmetic::{IAdd, IMul};
use crate::ops::conversion::{self, Conversion};
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// Kernels of packed components and of saturating sums.
pub mod kernels {
    use crate::ops::lane_kernel::lane_kernels;

    lane_kernels! {
        /// The byte at a bit offset, with its sign.
        SByte Internal [u32] (a: u32, shift: u32) -> i32 { i32::from((a >> shift) as i8) }
        /// The byte at a bit offset.
        UByte Internal [u32] (a: u32, shift: u32) -> u32 { u32::from((a >> shift) as u8) }
        /// The sum, or the nearest number that there is.
        SSaturatingAdd Internal [i8 i16 i32 i64] (a: T, b: T) -> T { a.saturating_add(b) }
        /// The sum, or the largest number that there is.
        USaturatingAdd Internal [u8 u16 u32 u64] (a: T, b: T) -> T { a.saturating_add(b) }
    }
}

/// Opcodes translated here.
pub const OPCODES: &[Opcode] =
    &[Opcode::SDot, Opcode::UDot, Opcode::SUDot, Opcode::SDotAccSat, Opcode::UDotAccSat, Opcode::SUDotAccSat];

/// Translates dot products of integers; `false` for any other instruction.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    // Signs of the components of both operands, and whether there is an accumulator.
    let ([left, right], accumulates) = match opcode {
        Opcode::SDot => ([true, true], false),
        Opcode::UDot => ([false, false], false),
        Opcode::SUDot => ([true, false], false),
        Opcode::SDotAccSat => ([true, true], true),
        Opcode::UDotAccSat => ([false, false], true),
        Opcode::SUDotAccSat => ([true, false], true),
        _ => return Ok(false),
    };
    check(translator, instruction, [left, right], accumulates)?;
    let ty = translator.result_type(instruction)?;
    let width = translator.scalar_width(ty)?;
    let (a, b) = (translator.id(instruction, 0)?, translator.id(instruction, 1)?);
    let a = components(translator, a, left, width)?;
    let b = components(translator, b, right, width)?;
    if a.len() != b.len() || a.is_empty() {
        return Err(translator.invalid("the vectors of a dot product differ in size"));
    }
    let mut sum = translator.emit_family(&IMul, width, &[a[0], b[0]])?;
    for (&a, &b) in a.iter().zip(&b).skip(1) {
        let product = translator.emit_family(&IMul, width, &[a, b])?;
        sum = translator.emit_family(&IAdd, width, &[sum, product])?;
    }
    if accumulates {
        let accumulator = translator.operand(instruction, 2)?[0];
        let family = if left { &kernels::SSaturatingAdd } else { &kernels::USaturatingAdd };
        sum = translator.emit_family(family, width, &[sum, accumulator])?;
    }
    let words = translator.expand_components(&[sum], width);
    translator.define_result(instruction, words);
    Ok(true)
}

/// Checks the types against the rules of the extension: vectors of integers, or 32-bit integers
/// with packed components; unsigned where the instruction takes unsigned components.
fn check(
    translator: &Translator<'_>,
    instruction: &Instruction,
    signs: [bool; 2],
    accumulates: bool,
) -> Result<()> {
    let module = translator.module;
    let result = translator.result_type(instruction)?;
    let invalid = |what: &str| {
        let opcode = instruction.opcode;
        Err(translator.invalid(format!("{opcode}: {what} (SPV_KHR_integer_dot_product)")))
    };
    let Type::Int { width: result_width, signed: result_signed } = *module.ty(result) else {
        return invalid("the result must be an integer");
    };
    if signs == [false, false] && result_signed {
        return invalid("the result must be an unsigned integer");
    }
    let mut vectors = [None; 2];
    for (at, signed) in signs.into_iter().enumerate() {
        let ty = translator.type_of(translator.id(instruction, at)?)?;
        let (scalar, count) = match *module.ty(ty) {
            Type::Vector { component, count } => (component, count),
            _ => (ty, 1),
        };
        let Type::Int { width, signed: own } = *module.ty(scalar) else {
            return invalid(
                "the operands must be vectors of integers, or 32-bit integers with packed components",
            );
        };
        if count == 1
            && (width != 32 || translator.operands(instruction).len() < 3 + usize::from(accumulates))
        {
            return invalid("a scalar operand must have 32 bits and a packed vector format");
        }
        if count > 1 && !signed && own {
            return invalid("an unsigned operand must be a vector of unsigned integers");
        }
        let component_width = if count == 1 { 8 } else { width };
        if result_width < component_width {
            return invalid("the result must be at least as wide as the operands' components");
        }
        vectors[at] = Some((width, count));
    }
    if vectors[0] != vectors[1] {
        return invalid("the operands must have the same component width and count");
    }
    if accumulates && translator.type_of(translator.id(instruction, 2)?)? != result {
        return invalid("the accumulator must have the type of the result");
    }
    Ok(())
}

/// The components of a vector, or of four bytes packed in a scalar, in the width of the result.
fn components(translator: &mut Translator<'_>, id: Id, signed: bool, width: u32) -> Result<Words> {
    let ty = translator.type_of(id)?;
    let mut parts = translator.components(id)?;
    let mut from = translator.scalar_width(ty)?;
    if let Type::Int { width: 32, .. } = translator.module.ty(ty) {
        let family = if signed { &kernels::SByte } else { &kernels::UByte };
        let packed = parts[0];
        parts.clear();
        for at in 0..4 {
            let shift = translator.constant(8 * at)?;
            parts.push(translator.emit_family(family, 32, &[packed, shift])?);
        }
        from = 32;
    }
    let kind = if signed { Conversion::S } else { Conversion::U };
    let mut widened = Words::new();
    for part in parts {
        let component: Reg = match conversion::kernel(kind, from, width) {
            Some(kernel) => translator.emit_kernel(kernel, &[part])?,
            None => part,
        };
        widened.push(component);
    }
    Ok(widened)
}

#[cfg(test)]
mod tests {
    use super::kernels::{SByte, SSaturatingAdd, UByte, USaturatingAdd};
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn vectors() {
        check(&SByte, 32, &[0x0080_FF7F, 16], 0xFFFF_FF80);
        check(&SByte, 32, &[0x0080_FF7F, 0], 0x7F);
        check(&UByte, 32, &[0x0080_FF7F, 8], 0xFF);
        check(&SSaturatingAdd, 8, &[0x7F, 1], 0x7F);
        check(&SSaturatingAdd, 32, &[0x8000_0000, 0xFFFF_FFFF], 0x8000_0000);
        check(&SSaturatingAdd, 64, &[5, u64::MAX], 4);
        check(&USaturatingAdd, 16, &[0xFFFF, 1], 0xFFFF);
        check(&USaturatingAdd, 64, &[u64::MAX, 1], u64::MAX);
    }
}
