//! Derivative instructions (SPIR-V 3.3.16), in compute shaders with a derivative group
//! (`SPV_KHR_compute_shader_derivatives`).
//!
//! A quad is four consecutive invocations in the order from which subgroups are formed: two by two,
//! x first. Every derivative is the fine one, the difference of the two invocations of the own row
//! or column; the specification allows that for coarse and unqualified derivatives, too. The value
//! of an inactive invocation of the quad counts as 0, as the specification leaves it undefined.

use crate::machine::Reg;
use crate::module::{Instruction, Opcode};
use crate::ops::arithmetic::{FAdd, FSub};
use crate::ops::glsl::FAbs;
use crate::ops::subgroup::{self, ReadSource};
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

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
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    if !OPCODES.contains(&opcode) {
        return Ok(false);
    }
    if !translator.derivatives {
        return Err(translator.invalid(format!(
            "{opcode} requires a fragment stage, or compute with a derivative group \
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
                let derivatives =
                    [derivative(translator, value, width, 0)?, derivative(translator, value, width, 1)?];
                let x = translator.emit_family(&FAbs, width, &derivatives[..1])?;
                let y = translator.emit_family(&FAbs, width, &derivatives[1..])?;
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
    let above = subgroup::read(translator, ReadSource::QuadSet(1 << axis), value, words)?;
    let below = subgroup::read(translator, ReadSource::QuadClear(1 << axis), value, words)?;
    translator.emit_family(&FSub, width, &[above, below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::module::Id;
    use crate::module::assemble::Assembler;
    use crate::module::interface::Stage;
    use anyhit_base::error::ErrorKind;

    /// What comes of each derivative of a float constant, in a compute shader with or without a
    /// derivative group.
    fn translated(derivatives: bool) -> Vec<Result<bool>> {
        let mut a = Assembler::new();
        a.types();
        a.op(Opcode::Constant, &[6, 20, 0]);
        let at = a.op(Opcode::DPdx, &[6, 21, 20]);
        let module = Assembler { words: a.words[..at].to_vec() }.loaded();
        let of = |&opcode: &Opcode| {
            let mut with_operand = module.clone();
            with_operand.words.push(20);
            let end = with_operand.words.len() as u32;
            let instruction = Instruction {
                opcode,
                offset: 0,
                result_type: Some(Id(6)),
                result: Some(Id(21)),
                operands: end - 1..end,
            };
            let mut translator = Translator::new(&with_operand, Stage::Compute);
            translator.derivatives = derivatives;
            translate(&mut translator, &instruction)
        };
        OPCODES.iter().map(of).collect()
    }

    #[test]
    fn derivatives_need_a_derivative_group() {
        assert!(translated(true).iter().all(|found| matches!(found, Ok(true))), "{:?}", translated(true));
        for found in translated(false) {
            let error = found.expect_err("nothing forms quads");
            assert_eq!(error.kind(), ErrorKind::InvalidModule);
            assert!(error.message().contains("compute with a derivative group"), "{error}");
        }
    }
}
