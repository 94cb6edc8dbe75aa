//! Instruction sets of AMD that Vulkan has extensions for: `SPV_AMD_shader_trinary_minmax`, and of
//! `SPV_AMD_shader_ballot` what its instruction set adds to the subgroup instructions.
//!
//! A minimum or maximum of three is that of the first and that of the others; the middle of three is
//! `max(min(x, y), min(max(x, y), z))`, each by the instruction of `GLSL.std.450`.

use smallvec::SmallVec;

use crate::error::Result;
use crate::machine::Reg;
use crate::module::{Id, Instruction};
use crate::ops::arithmetic::IAdd;
use crate::ops::bit::{BitCount, BitwiseAnd, BitwiseOr, BitwiseXor};
use crate::ops::builtin;
use crate::ops::decode::{Decoder, InputRegisters, Words, registers_from};
use crate::ops::glsl::{FMax, FMin, SMax, SMin, UMax, UMin};
use crate::ops::lane_kernel::OpFamily;
use crate::ops::relational_logical::{IEqual, select::SelectWord};
use crate::ops::subgroup::{self, From};

/// `SPV_AMD_shader_trinary_minmax`
pub const TRINARY: &str = "SPV_AMD_shader_trinary_minmax";
/// `SPV_AMD_shader_ballot`
pub const BALLOT: &str = "SPV_AMD_shader_ballot";

/// Decodes an instruction of these sets, whose operands begin behind set and number; `false` for any
/// other.
///
/// # Errors
/// `InvalidModule` where it breaks a rule.
pub fn decode(decoder: &mut Decoder<'_>, set: &str, number: u32, instruction: &Instruction) -> Result<bool> {
    match set {
        TRINARY => trinary(decoder, number, instruction),
        BALLOT => ballot(decoder, number, instruction),
        _ => Ok(false),
    }
}

fn trinary(decoder: &mut Decoder<'_>, number: u32, instruction: &Instruction) -> Result<bool> {
    let (least, greatest): (&'static OpFamily, &'static OpFamily) = match number {
        1 | 4 | 7 => (&FMin, &FMax),
        2 | 5 | 8 => (&UMin, &UMax),
        3 | 6 | 9 => (&SMin, &SMax),
        _ => return Ok(false),
    };
    let mut operands: [Words; 3] = Default::default();
    for (at, operand) in operands.iter_mut().enumerate() {
        let id = decoder.id(instruction, 2 + at)?;
        *operand = decoder.components(id)?;
    }
    let ty = decoder.result_type(instruction)?;
    let width = decoder.scalar_width(ty)?;
    let count = decoder.component_count(ty) as usize;
    if operands.iter().any(|operand| operand.len() != count) {
        return Err(decoder.invalid("the operands of a minimum or maximum of three differ in size"));
    }
    let mut found = Words::new();
    let [first, second, third] = operands;
    for ((&x, &y), &z) in first.iter().zip(&second).zip(&third) {
        found.push(match number {
            1..=3 => {
                let others = decoder.emit_family(least, width, &[y, z])?;
                decoder.emit_family(least, width, &[x, others])?
            }
            4..=6 => {
                let others = decoder.emit_family(greatest, width, &[y, z])?;
                decoder.emit_family(greatest, width, &[x, others])?
            }
            _ => {
                let low = decoder.emit_family(least, width, &[x, y])?;
                let high = decoder.emit_family(greatest, width, &[x, y])?;
                let inner = decoder.emit_family(least, width, &[high, z])?;
                decoder.emit_family(greatest, width, &[low, inner])?
            }
        });
    }
    let words = decoder.spread(&found, width);
    decoder.result(instruction, words);
    Ok(true)
}

fn ballot(decoder: &mut Decoder<'_>, number: u32, instruction: &Instruction) -> Result<bool> {
    let value = decoder.id(instruction, 2)?;
    let value_words = |decoder: &mut Decoder<'_>| -> Result<(Reg, u32)> {
        let words = decoder.words(value)?;
        Ok((decoder.consecutive(&words)?, words.len() as u32))
    };
    match number {
        // SwizzleInvocationsAMD: each of a quad names whom it reads, by its place in the quad.
        1 => {
            let (first, count) = value_words(decoder)?;
            let offsets = operand(decoder, instruction, 3, 4)?;
            let own = place(decoder)?;
            let three = decoder.constant(3)?;
            let within = decoder.emit_family(&BitwiseAnd, 32, &[own, three])?;
            let mut offset = offsets[0];
            for (at, &one) in offsets.iter().enumerate().skip(1) {
                let at = decoder.constant(at as u32)?;
                let here = decoder.emit_family(&IEqual, 32, &[within, at])?;
                offset = decoder.emit_kernel(&SelectWord.kernels[0], &[here, one, offset])?;
            }
            let keep = decoder.constant(!3)?;
            let quad = decoder.emit_family(&BitwiseAnd, 32, &[own, keep])?;
            let offset = decoder.emit_family(&BitwiseAnd, 32, &[offset, three])?;
            let source = decoder.emit_family(&IAdd, 32, &[quad, offset])?;
            let to = subgroup::read_at(decoder, From::At, first, count, source)?;
            decoder.result(instruction, registers_from(to, count));
        }
        // SwizzleInvocationsMaskedAMD: within 32, ((place & x) | y) ^ z.
        2 => {
            let (first, count) = value_words(decoder)?;
            let mask = operand(decoder, instruction, 3, 3)?;
            let own = place(decoder)?;
            let low = decoder.constant(31)?;
            let within = decoder.emit_family(&BitwiseAnd, 32, &[own, low])?;
            let and = decoder.emit_family(&BitwiseAnd, 32, &[within, mask[0]])?;
            let or = decoder.emit_family(&BitwiseOr, 32, &[and, mask[1]])?;
            let xor = decoder.emit_family(&BitwiseXor, 32, &[or, mask[2]])?;
            let xor = decoder.emit_family(&BitwiseAnd, 32, &[xor, low])?;
            let high = decoder.constant(!31)?;
            let group = decoder.emit_family(&BitwiseAnd, 32, &[own, high])?;
            let source = decoder.emit_family(&IAdd, 32, &[group, xor])?;
            let to = subgroup::read_at(decoder, From::At, first, count, source)?;
            decoder.result(instruction, registers_from(to, count));
        }
        // WriteInvocationAMD: another value for one place.
        3 => {
            let input = decoder.words(value)?;
            let write = decoder.operand(instruction, 3)?;
            let index = operand(decoder, instruction, 4, 1)?[0];
            if input.len() != write.len() {
                return Err(decoder.invalid("the values of WriteInvocationAMD differ in type"));
            }
            let own = place(decoder)?;
            let here = decoder.emit_family(&IEqual, 32, &[own, index])?;
            let mut words = Words::new();
            for (&before, &after) in input.iter().zip(&write) {
                words.push(decoder.emit_kernel(&SelectWord.kernels[0], &[here, after, before])?);
            }
            let first = decoder.consecutive(&words)?;
            decoder.result(instruction, registers_from(first, words.len() as u32));
        }
        // MbcntAMD: the bits of a mask below the own place.
        4 => {
            let mask = operand(decoder, instruction, 2, 2)?;
            let below = input(decoder, "SubgroupLtMask", 4)?;
            let mut counts = SmallVec::<[Reg; 2]>::new();
            for (at, &word) in mask.iter().enumerate() {
                let bits = decoder.emit_family(&BitwiseAnd, 32, &[word, below.plus(at as u32)])?;
                counts.push(decoder.emit_family(&BitCount, 32, &[bits])?);
            }
            let sum = decoder.emit_family(&IAdd, 32, &counts)?;
            decoder.result(instruction, SmallVec::from_slice(&[sum]));
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// The words of an operand that has so many.
fn operand(decoder: &mut Decoder<'_>, instruction: &Instruction, at: usize, count: usize) -> Result<Words> {
    let id: Id = decoder.id(instruction, at)?;
    let words = decoder.words(id)?;
    match words.len() {
        found if found == count => Ok(words),
        found => Err(decoder.invalid(format!("{found} words where {count} must be"))),
    }
}

/// `SubgroupLocalInvocationId`
fn place(decoder: &mut Decoder<'_>) -> Result<Reg> {
    input(decoder, "SubgroupLocalInvocationId", 1)
}

/// Registers of a builtin that the shader need not declare.
fn input(decoder: &mut Decoder<'_>, name: &str, count: u32) -> Result<Reg> {
    let builtin = builtin::find_by_name(name).expect("bug in anyhit: a builtin is missing");
    let known = decoder.inputs.iter().find(|input| input.builtin.name == name && input.count == count);
    if let Some(known) = known {
        return Ok(known.first);
    }
    let first = decoder.fresh(count)?;
    decoder.inputs.push(InputRegisters { builtin, first, count });
    Ok(first)
}
