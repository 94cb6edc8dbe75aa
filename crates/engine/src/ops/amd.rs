//! Instruction sets of AMD for which Vulkan has extensions: `SPV_AMD_shader_trinary_minmax`, and of
//! `SPV_AMD_shader_ballot` what its instruction set adds to the subgroup instructions.
//!
//! A minimum or maximum of three is that of the first and that of the others; the middle of three
//! is `max(min(x, y), min(max(x, y), z))`, each by the instruction of `GLSL.std.450`.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::module::{Id, Instruction};
use crate::ops::arithmetic::IAdd;
use crate::ops::bit::{BitCount, BitwiseAnd, BitwiseOr, BitwiseXor};
use crate::ops::builtin;
use crate::ops::glsl::{FMax, FMin, SMax, SMin, UMax, UMin};
use crate::ops::lane_kernel::OpFamily;
use crate::ops::relational_logical::{IEqual, select::SelectWord};
use crate::ops::subgroup::{self, ReadSource};
use crate::ops::translate::{InputRegisters, Translator};
use crate::ops::value_registers::{Words, registers_from};
use anyhit_base::error::Result;

/// `SPV_AMD_shader_trinary_minmax`
pub const TRINARY: &str = "SPV_AMD_shader_trinary_minmax";
/// `SPV_AMD_shader_ballot`
pub const BALLOT: &str = "SPV_AMD_shader_ballot";

/// Translates an instruction of these sets, whose operands begin behind set and number; `false` for
/// any other.
///
/// # Errors
/// `InvalidModule` where it breaks a rule.
pub fn translate(
    translator: &mut Translator<'_>,
    set: &str,
    number: u32,
    instruction: &Instruction,
) -> Result<bool> {
    match set {
        TRINARY => trinary(translator, number, instruction),
        BALLOT => ballot(translator, number, instruction),
        _ => Ok(false),
    }
}

fn trinary(translator: &mut Translator<'_>, number: u32, instruction: &Instruction) -> Result<bool> {
    let (least, greatest): (&'static OpFamily, &'static OpFamily) = match number {
        1 | 4 | 7 => (&FMin, &FMax),
        2 | 5 | 8 => (&UMin, &UMax),
        3 | 6 | 9 => (&SMin, &SMax),
        _ => return Ok(false),
    };
    let mut operands: [Words; 3] = Default::default();
    for (at, operand) in operands.iter_mut().enumerate() {
        let id = translator.id(instruction, 2 + at)?;
        *operand = translator.components(id)?;
    }
    let ty = translator.result_type(instruction)?;
    let width = translator.scalar_width(ty)?;
    let count = translator.component_count(ty) as usize;
    if operands.iter().any(|operand| operand.len() != count) {
        return Err(translator.invalid("the operands of a three-operand minimum or maximum differ in size"));
    }
    let mut found = Words::new();
    let [first, second, third] = operands;
    for ((&x, &y), &z) in first.iter().zip(&second).zip(&third) {
        found.push(match number {
            1..=3 => {
                let others = translator.emit_family(least, width, &[y, z])?;
                translator.emit_family(least, width, &[x, others])?
            }
            4..=6 => {
                let others = translator.emit_family(greatest, width, &[y, z])?;
                translator.emit_family(greatest, width, &[x, others])?
            }
            _ => {
                let low = translator.emit_family(least, width, &[x, y])?;
                let high = translator.emit_family(greatest, width, &[x, y])?;
                let inner = translator.emit_family(least, width, &[high, z])?;
                translator.emit_family(greatest, width, &[low, inner])?
            }
        });
    }
    let words = translator.expand_components(&found, width);
    translator.define_result(instruction, words);
    Ok(true)
}

fn ballot(translator: &mut Translator<'_>, number: u32, instruction: &Instruction) -> Result<bool> {
    let value = translator.id(instruction, 2)?;
    let value_words = |translator: &mut Translator<'_>| -> Result<(Reg, u32)> {
        let words = translator.words(value)?;
        Ok((translator.consecutive(&words)?, words.len() as u32))
    };
    match number {
        // SwizzleInvocationsAMD: each invocation of a quad has an offset of that which it reads.
        1 => {
            let (first, count) = value_words(translator)?;
            let offsets = operand(translator, instruction, 3, 4)?;
            let own = subgroup_local_invocation_id(translator)?;
            let three = translator.constant(3)?;
            let within = translator.emit_family(&BitwiseAnd, 32, &[own, three])?;
            let mut offset = offsets[0];
            for (at, &one) in offsets.iter().enumerate().skip(1) {
                let at = translator.constant(at as u32)?;
                let here = translator.emit_family(&IEqual, 32, &[within, at])?;
                offset = translator.emit_kernel(&SelectWord.kernels[0], &[here, one, offset])?;
            }
            let keep = translator.constant(!3)?;
            let quad = translator.emit_family(&BitwiseAnd, 32, &[own, keep])?;
            let offset = translator.emit_family(&BitwiseAnd, 32, &[offset, three])?;
            let source = translator.emit_family(&IAdd, 32, &[quad, offset])?;
            let to = subgroup::read_from_index(translator, ReadSource::Index, first, count, source)?;
            translator.define_result(instruction, registers_from(to, count));
        }
        // SwizzleInvocationsMaskedAMD: within 32 invocations, ((id & x) | y) ^ z.
        2 => {
            let (first, count) = value_words(translator)?;
            let mask = operand(translator, instruction, 3, 3)?;
            let own = subgroup_local_invocation_id(translator)?;
            let low = translator.constant(31)?;
            let within = translator.emit_family(&BitwiseAnd, 32, &[own, low])?;
            let and = translator.emit_family(&BitwiseAnd, 32, &[within, mask[0]])?;
            let or = translator.emit_family(&BitwiseOr, 32, &[and, mask[1]])?;
            let xor = translator.emit_family(&BitwiseXor, 32, &[or, mask[2]])?;
            let xor = translator.emit_family(&BitwiseAnd, 32, &[xor, low])?;
            let high = translator.constant(!31)?;
            let group = translator.emit_family(&BitwiseAnd, 32, &[own, high])?;
            let source = translator.emit_family(&IAdd, 32, &[group, xor])?;
            let to = subgroup::read_from_index(translator, ReadSource::Index, first, count, source)?;
            translator.define_result(instruction, registers_from(to, count));
        }
        // WriteInvocationAMD: another value in one invocation.
        3 => {
            let input = translator.words(value)?;
            let write = translator.operand(instruction, 3)?;
            let index = operand(translator, instruction, 4, 1)?[0];
            if input.len() != write.len() {
                return Err(translator.invalid("the values of WriteInvocationAMD differ in type"));
            }
            let own = subgroup_local_invocation_id(translator)?;
            let here = translator.emit_family(&IEqual, 32, &[own, index])?;
            let mut words = Words::new();
            for (&before, &after) in input.iter().zip(&write) {
                words.push(translator.emit_kernel(&SelectWord.kernels[0], &[here, after, before])?);
            }
            let first = translator.consecutive(&words)?;
            translator.define_result(instruction, registers_from(first, words.len() as u32));
        }
        // MbcntAMD: the number of bits set in a mask below this invocation's id.
        4 => {
            let mask = operand(translator, instruction, 2, 2)?;
            let below = input(translator, "SubgroupLtMask", 4)?;
            let mut counts = SmallVec::<[Reg; 2]>::new();
            for (at, &word) in mask.iter().enumerate() {
                let bits = translator.emit_family(&BitwiseAnd, 32, &[word, below.plus(at as u32)])?;
                counts.push(translator.emit_family(&BitCount, 32, &[bits])?);
            }
            let sum = translator.emit_family(&IAdd, 32, &counts)?;
            translator.define_result(instruction, SmallVec::from_slice(&[sum]));
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// The words of an operand, which must be `count` many.
fn operand(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    at: usize,
    count: usize,
) -> Result<Words> {
    let id: Id = translator.id(instruction, at)?;
    let words = translator.words(id)?;
    match words.len() {
        found if found == count => Ok(words),
        found => Err(translator.invalid(format!("the operand has {found} words instead of {count}"))),
    }
}

/// `SubgroupLocalInvocationId`
fn subgroup_local_invocation_id(translator: &mut Translator<'_>) -> Result<Reg> {
    input(translator, "SubgroupLocalInvocationId", 1)
}

/// Registers of a builtin that the shader need not declare.
fn input(translator: &mut Translator<'_>, name: &str, count: u32) -> Result<Reg> {
    let builtin = builtin::find_by_name(name).expect("bug in anyhit: a builtin is missing");
    let known = translator.inputs.iter().find(|input| input.builtin.name == name && input.count == count);
    if let Some(known) = known {
        return Ok(known.first);
    }
    let first = translator.fresh(count)?;
    translator.inputs.push(InputRegisters { builtin, first, count });
    Ok(first)
}
