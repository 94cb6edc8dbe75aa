//! `OpSpecConstantOp`: an instruction on constants, folded by running its own kernel.

use rspirv::spirv::Op as Opcode;

use crate::error::Result;
use crate::module::ty::TypeId;
use crate::module::{Id, Instruction};
use crate::ops::translate::{IdValue, Translator};
use crate::ops::value_registers::Words;

/// The words of an operation on constants.
pub fn operation(
    translator: &mut Translator<'_>,
    id: Id,
    ty: TypeId,
    opcode: u16,
    operands: &[u32],
) -> Result<Words> {
    let name = crate::module::names::opcode_name(opcode);
    // In the module, the operands follow the opcode: the instruction is the tail of this one.
    let constant = translator.origin.offset;
    let start = constant + 4;
    let instruction = Instruction {
        opcode,
        offset: constant,
        result_type: translator.module.id_of_type(ty),
        result: Some(id),
        operands: start..start + operands.len() as u32,
    };
    debug_assert_eq!(translator.module.operands(&instruction), operands);
    if Opcode::from_u32(opcode.into()).is_none() {
        return Err(translator.unsupported(format!("{name} in OpSpecConstantOp")));
    }
    let emitted = translator.ops.len();
    crate::ops::translate_instruction(translator, opcode, &instruction)?;
    if translator.ops.len() != emitted {
        return Err(translator.unsupported(format!("{name} on operands that are not constant")));
    }
    match translator.local(id) {
        Some(IdValue::Words(words)) => Ok(words.clone()),
        _ => Err(translator.invalid(format!("{name} gives no constant"))),
    }
}
