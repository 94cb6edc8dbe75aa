//! Banks of push constants (`SPV_NV_push_constant_bank`).
//!
//! Shaders only read a bank. The loader therefore turns the variables in banks other than bank 0
//! into uniform buffers in a reserved descriptor set.

use crate::module::decoration::{Decoration, number};
use crate::module::validate::explicit_layout::UNIFORM;
use crate::module::{Id, Module};

/// The reserved descriptor set; the binding is the number of the bank.
pub const BANK_SET: u32 = u32::MAX - 2;

/// `PushConstant`
const PUSH_CONSTANT: u32 = 9;

/// Makes uniform buffers of the variables in banks.
pub(super) fn bind_banks(module: &mut Module) {
    let Module { variables, decorations, .. } = module;
    for variable in variables.iter_mut().filter(|variable| variable.storage_class == PUSH_CONSTANT) {
        let bank = decorations.literal(variable.id, number::BANK).filter(|bank| *bank > 0);
        let Some(bank) = bank else { continue };
        variable.storage_class = UNIFORM;
        let places = [(number::DESCRIPTOR_SET, BANK_SET), (number::BINDING, bank)];
        let places = places.map(|(number, value)| Decoration { number, operands: vec![value] });
        decorations.of_id.entry(variable.id).or_default().extend(places);
    }
}

impl Module {
    /// Where the block of a variable begins in its bank: `MemberOffsetNV`.
    #[doc(hidden)]
    pub fn offset_in_bank(&self, variable: Id) -> u32 {
        self.decorations.literal(variable, number::MEMBER_OFFSET).unwrap_or(0)
    }
}
