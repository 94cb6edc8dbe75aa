//! What the ids of a module stand for while its instructions are translated.

use crate::module::ty::Type;
use crate::module::{Definition, Id};
use crate::ops::pointer::{self, Pointer};
use crate::ops::pointer_layout::{self, ends_in_matrix};
use crate::ops::translate::budget::WORDS_OF_A_STEP;
use crate::ops::translate::{IdValue, Translator};
use crate::ops::value_registers::{Words, words_from};
use anyhit_base::error::Result;

impl Translator<'_> {
    /// What an id stands for.
    pub fn value(&mut self, id: Id) -> Result<IdValue> {
        if let Some(value) = self.values.find(id) {
            return Ok(value.clone());
        }
        let value = match self.module.definition(id) {
            Some(Definition::Constant(index)) => return self.constant_value(index),
            Some(Definition::Variable(index)) => IdValue::Pointer(pointer::variable(self, index)?.into()),
            // Where control never comes, what is computed there has no value, and nobody sees it.
            Some(Definition::Result(function, block, _)) if !self.module.reaches(function, block) => {
                let ty = self.type_of(id)?;
                return Ok(IdValue::Words(self.undefined(ty)?));
            }
            Some(Definition::Result(..) | Definition::Parameter(..)) => {
                return Err(self.invalid(format!("%{} is used before it has a value", id.0)));
            }
            _ => return Err(self.invalid(format!("%{} is not a value", id.0))),
        };
        self.values.define_global(id, value.clone());
        Ok(value)
    }

    /// The words of an id; a pointer is converted to words.
    ///
    /// # Errors
    /// `UnsupportedModule` for a pointer into a matrix in memory or a composite, as the
    /// matrix's layout is not known there.
    pub fn words(&mut self, id: Id) -> Result<Words> {
        if let Some(IdValue::Words(words)) = self.values.find(id) {
            let words = words_from(words);
            self.charge(words.len() / WORDS_OF_A_STEP);
            return Ok(words);
        }
        if let IdValue::Pointer(pointer) = self.value(id)?
            && matches!(pointer.base, pointer::PointerBase::Buffer(_))
            && !pointer.is_packed(self)
            && (pointer.layout.component_stride.is_some() || ends_in_matrix(self.module, pointer.pointee))
        {
            return Err(self.unsupported(
                "a pointer into a matrix, stored in memory or in a composite, is not supported",
            ));
        }
        self.words_unchecked(id)
    }

    /// The words of an id, without the check of [`Translator::words`]: for operands of a phi,
    /// select or call, through which [`Translator::pointer`] traces a pointer back to its layout.
    pub fn words_unchecked(&mut self, id: Id) -> Result<Words> {
        match self.value(id)? {
            IdValue::Words(words) => Ok(words),
            IdValue::Pointer(pointer) => pointer::pointer_words(self, &pointer),
        }
    }

    /// The pointer that an id stands for.
    pub fn pointer(&mut self, id: Id) -> Result<Pointer> {
        if let Some(IdValue::Pointer(pointer)) = self.values.find(id) {
            return Ok(Pointer::clone(pointer));
        }
        match self.value(id)? {
            IdValue::Pointer(pointer) => Ok(*pointer),
            IdValue::Words(words) => {
                let ty = self.type_of(id)?;
                let mut pointer = pointer::pointer_from_words(self, ty, &words)?;
                let steps = pointer_layout::infer_layout(self, id, &mut pointer)?;
                self.charge(steps);
                Ok(pointer)
            }
        }
    }

    /// The value of a constant id that must be an integer known before running.
    pub fn constant_integer(&mut self, id: Id) -> Result<u64> {
        let words = self.words(id)?;
        let mut bits = 0;
        for (at, &reg) in words.iter().enumerate().take(2) {
            let word = self.constant_word(reg);
            let word = word.ok_or_else(|| self.invalid(format!("%{} must be a constant", id.0)))?;
            bits |= u64::from(word) << (32 * at);
        }
        Ok(bits)
    }

    /// The length of an array type.
    pub fn array_length(&mut self, length: Id) -> Result<u32> {
        let bits = self.constant_integer(length)?;
        let ty = self.type_of(length)?;
        let Type::Int { width, signed } = *self.module.ty(ty) else {
            let name = self.module.describe_type(ty);
            return Err(
                self.invalid(format!("the length of an array is of type {name} instead of an integer type"))
            );
        };
        if signed && bits >> (width - 1) & 1 == 1 {
            return Err(self.invalid("the length of an array is negative"));
        }
        match u32::try_from(bits) {
            Ok(length) if length > 0 => Ok(length),
            _ => Err(self.invalid(format!("the length of an array is {bits}"))),
        }
    }
}
