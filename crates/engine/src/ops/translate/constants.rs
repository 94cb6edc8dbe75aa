//! The order in which constants of the module are evaluated.
//!
//! A constant is made of others, and so is the length of an array in its type: chains of them are
//! as long as the module. They are evaluated from the first to the last, not by recursion.

use rustc_hash::FxHashSet;

use crate::module::constant::ConstantValue;
use crate::module::interface::Stage;
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Instruction, Module};
use crate::ops::translate::budget::named;
use crate::ops::translate::{IdValue, Translator};
use anyhit_base::error::Result;

/// The length of an array type, from the constant that it names, computed ones included; 0 where
/// that is no number.
pub fn array_length(module: &Module, length: Id) -> usize {
    let known = module.scalar_value(length);
    let computed = || Translator::new(module, Stage::RayGeneration).array_length(length).ok().map(u64::from);
    known.or_else(computed).and_then(|length| length.try_into().ok()).unwrap_or(0)
}

impl Translator<'_> {
    /// The value of a constant of the module, by its index.
    pub(super) fn constant_value(&mut self, index: u32) -> Result<IdValue> {
        // What a constant is made of stands before it in the module (SPIR-V, 2.4).
        for needed in self.needed_constants(index) {
            let value = IdValue::Words(self.constant_words(needed)?);
            self.define_constant(needed, value);
        }
        let value = IdValue::Words(self.constant_words(index)?);
        self.define_constant(index, value.clone());
        Ok(value)
    }

    fn define_constant(&mut self, index: u32, value: IdValue) {
        self.named_registers += named(&value);
        self.values.define_global(self.module.constants[index as usize].id, value);
    }

    /// The constants without a value yet that one needs, ascending, itself left out.
    fn needed_constants(&self, index: u32) -> Vec<u32> {
        let mut found = Vec::new();
        let mut seen = FxHashSet::from_iter([index]);
        let mut seen_types = FxHashSet::default();
        let mut constants = vec![index];
        let mut types: Vec<TypeId> = Vec::new();
        while let Some(at) = constants.pop() {
            let mut need = |id: Id| {
                if let Some(Definition::Constant(part)) = self.module.definition(id)
                    && part < index
                    && self.values.find(id).is_none()
                    && seen.insert(part)
                {
                    found.push(part);
                    constants.push(part);
                }
            };
            let constant = &self.module.constants[at as usize];
            match &constant.value {
                ConstantValue::Composite(parts) => parts.iter().for_each(|&part| need(part)),
                ConstantValue::Operation { opcode, operands } => {
                    let start = constant.offset + 4;
                    let instruction = Instruction {
                        opcode: *opcode,
                        offset: constant.offset,
                        result_type: None,
                        result: None,
                        operands: start..start + operands.len() as u32,
                    };
                    self.module.operand_ids(&instruction).into_iter().for_each(&mut need);
                }
                // A composite of copies of one value: type, result, constituent.
                ConstantValue::Other(_) => {
                    let part = self.module.words.get(constant.offset as usize + 3);
                    part.into_iter().for_each(|&part| need(Id(part)));
                }
                ConstantValue::Scalar(_)
                | ConstantValue::Data(_)
                | ConstantValue::Null
                | ConstantValue::Undef => {}
            }
            types.push(constant.ty);
            while let Some(ty) = types.pop() {
                if self.word_counts[ty.0 as usize].is_some() || !seen_types.insert(ty) {
                    continue;
                }
                match self.module.ty(ty) {
                    Type::Array { element, length, .. } => {
                        types.push(*element);
                        need(*length);
                    }
                    Type::Struct { members, .. } => types.extend(members.iter().map(|member| member.ty)),
                    _ => {}
                }
            }
        }
        found.sort_unstable();
        found
    }
}
