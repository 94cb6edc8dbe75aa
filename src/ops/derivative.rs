//! Derivative instructions (SPIR-V 3.3.16), in compute shaders with a derivative group
//! (`SPV_KHR_compute_shader_derivatives`).
//!
//! A quad is four invocations that follow each other in the order that subgroups are cut from: two
//! by two, x first. Every derivative is the fine one, the difference of the two invocations of the
//! own row or column, which the coarse ones and those without a word may be too. Where an
//! invocation of the quad does not take part its value counts as 0: the specification leaves that
//! undefined.

use rspirv::spirv::Op as Opcode;

use crate::error::Result;
use crate::machine::Reg;
use crate::module::Instruction;
use crate::ops::arithmetic::{FAdd, FSub};
use crate::ops::glsl::FAbs;
use crate::ops::subgroup::{self, From};
use crate::ops::translate::{Translator, Words};

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::DPdx,
    Opcode::DPdy,
    Opcode::Fwidth,
    Opcode::DPdxFine,
    Opcode::DPdyFine,
    Opcode::FwidthFine,
    Opcode::DPdxCoarse,
    Opcode::DPdyCoarse,
    Opcode::FwidthCoarse,
];

/// Translates derivatives; `false` for an instruction of another section.
///
/// # Errors
/// `InvalidModule` where the entry point declares no derivative group.
pub fn translate(translator: &mut Translator<'_>, opcode: Opcode, instruction: &Instruction) -> Result<bool> {
    if !OPCODES.contains(&opcode) {
        return Ok(false);
    }
    if !translator.derivatives {
        let name = crate::module::names::opcode_name(instruction.opcode);
        return Err(translator.invalid(format!(
            "{name} needs a fragment stage, or compute with a derivative group \
             (SPV_KHR_compute_shader_derivatives)"
        )));
    }
    let id = translator.id(instruction, 0)?;
    let width = translator.type_of(id).and_then(|ty| translator.scalar_width(ty))?;
    let mut result = Words::new();
    for value in translator.components(id)? {
        let first = match opcode {
            Opcode::DPdx | Opcode::DPdxFine | Opcode::DPdxCoarse => derivative(translator, value, width, 0)?,
            Opcode::DPdy | Opcode::DPdyFine | Opcode::DPdyCoarse => derivative(translator, value, width, 1)?,
            _ => {
                let sides =
                    [derivative(translator, value, width, 0)?, derivative(translator, value, width, 1)?];
                let x = translator.emit_family(&FAbs, width, &sides[..1])?;
                let y = translator.emit_family(&FAbs, width, &sides[1..])?;
                translator.emit_family(&FAdd, width, &[x, y])?
            }
        };
        result.push(first);
    }
    let words = translator.expand_components(&result, width);
    translator.define_result(instruction, words);
    Ok(true)
}

/// The derivative of a float along x (0) or y (1).
pub fn derivative(translator: &mut Translator<'_>, value: Reg, width: u32, axis: u32) -> Result<Reg> {
    let words = width.div_ceil(32);
    let above = subgroup::read(translator, From::QuadSet(1 << axis), value, words)?;
    let below = subgroup::read(translator, From::QuadClear(1 << axis), value, words)?;
    translator.emit_family(&FSub, width, &[above, below])
}
