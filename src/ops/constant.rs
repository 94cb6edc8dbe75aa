//! `OpSpecConstantOp`: an instruction on constants, folded by running its own kernel.

use rspirv::spirv::Op as Opcode;

use crate::error::Result;
use crate::module::ty::TypeId;
use crate::module::{Id, Instruction};
use crate::ops::decode::{Decoder, Value, Words};

/// The words of an operation on constants.
pub fn operation(
    decoder: &mut Decoder<'_>,
    id: Id,
    ty: TypeId,
    opcode: u16,
    operands: &[u32],
) -> Result<Words> {
    let name = crate::module::names::opcode_name(opcode);
    // The operands lie in the module behind the opcode: the instruction is the tail of this one.
    let constant = decoder.origin.offset;
    let start = constant + 4;
    let instruction = Instruction {
        opcode,
        offset: constant,
        result_type: decoder.module.id_of_type(ty),
        result: Some(id),
        operands: start..start + operands.len() as u32,
    };
    debug_assert_eq!(decoder.module.operands(&instruction), operands);
    if Opcode::from_u32(opcode.into()).is_none() {
        return Err(decoder.unsupported(format!("{name} in OpSpecConstantOp")));
    }
    let emitted = decoder.ops.len();
    crate::ops::decode_instruction(decoder, opcode, &instruction)?;
    if decoder.ops.len() != emitted {
        return Err(decoder.unsupported(format!("{name} on operands that are not constant")));
    }
    match decoder.local(id) {
        Some(Value::Words(words)) => Ok(words.clone()),
        _ => Err(decoder.invalid(format!("{name} gives no constant"))),
    }
}
