//! `OpSpecConstantOp`: an instruction on constants, folded by running its own kernel.

use crate::machine::OpIndex;
use crate::module::constant::ConstantValue;
use crate::module::ty::TypeId;
use crate::module::{Definition, Id, Instruction, Opcode};
use crate::ops::translate::{IdValue, Translator};
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// Executes the operations that a constant is made of, each once in a block, for an observer of
/// their operands. What uses the constant reads the words that were folded, not these results.
///
/// # Errors
/// Those of folding.
pub fn execute(translator: &mut Translator<'_>, id: Id) -> Result<()> {
    let module = translator.module;
    let mut open = vec![id];
    while let Some(id) = open.pop() {
        let Some(Definition::Constant(index)) = module.definition(id) else { continue };
        let constant = &module.constants[index as usize];
        match &constant.value {
            ConstantValue::Composite(parts) if translator.executed_constants.insert(id) => {
                open.extend(parts);
            }
            ConstantValue::Operation { opcode, operands } if translator.executed_constants.insert(id) => {
                let folded = translator.words(id)?;
                let instruction = tail(translator, id, constant.ty, *opcode, constant.offset, operands.len());
                let first = translator.ops.len();
                crate::ops::translate_instruction(translator, &instruction)?;
                translator.define(id, IdValue::Words(folded));
                let emitted = (first..translator.ops.len()).map(|op| (OpIndex::new(op), constant.offset));
                translator.constant_operations.extend(emitted);
                open.extend(module.operand_ids(&instruction));
            }
            _ => {}
        }
    }
    Ok(())
}

/// The operation of a constant at a word offset. In the module, the operands follow the opcode: the
/// instruction is the tail of `OpSpecConstantOp`.
fn tail(
    translator: &Translator<'_>,
    id: Id,
    ty: TypeId,
    opcode: Opcode,
    constant: u32,
    operands: usize,
) -> Instruction {
    let start = constant + 4;
    Instruction {
        opcode,
        offset: constant,
        result_type: translator.module.id_of_type(ty),
        result: Some(id),
        operands: start..start + operands as u32,
    }
}

/// The words of an operation on constants.
pub fn operation(
    translator: &mut Translator<'_>,
    id: Id,
    ty: TypeId,
    opcode: Opcode,
    operands: &[u32],
) -> Result<Words> {
    let instruction = tail(translator, id, ty, opcode, translator.origin.offset, operands.len());
    debug_assert_eq!(translator.module.operands(&instruction), operands);
    if !opcode.is_known() {
        return Err(translator.unsupported(format!("{opcode} in OpSpecConstantOp is not supported")));
    }
    let emitted = translator.ops.len();
    crate::ops::translate_instruction(translator, &instruction)?;
    if translator.ops.len() != emitted {
        return Err(
            translator.unsupported(format!("{opcode} on operands that are not constant is not supported"))
        );
    }
    match translator.local(id) {
        Some(IdValue::Words(words)) => Ok(words.clone()),
        _ => Err(translator.invalid(format!("the result of {opcode} is not a constant"))),
    }
}
