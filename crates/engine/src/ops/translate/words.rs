//! How values of each type lie in registers: how many words they take, and those of constants.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::math::float_format::FloatFormat;
use crate::module::constant::ConstantValue;
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Opcode};
use crate::ops::memory::MemoryOp;
use crate::ops::op::Op;
use crate::ops::pointer;
use crate::ops::translate::{Origin, Translator};
use crate::ops::value_registers::{UndefinedConstant, Words, registers_from};
use anyhit_base::error::Result;
use anyhit_base::input::InputLimit;

impl Translator<'_> {
    /// How many words a value of a type takes in registers.
    #[inline]
    pub fn word_count(&mut self, ty: TypeId) -> Result<u32> {
        if let Some(count) = self.word_counts[ty.0 as usize] {
            return Ok(count);
        }
        let count = self.count_words(ty)?;
        self.word_counts[ty.0 as usize] = Some(count);
        Ok(count)
    }

    fn count_words(&mut self, ty: TypeId) -> Result<u32> {
        let most = self.max_registers;
        let too_big = |translator: &Self| {
            let error = translator.beyond(InputLimit::Registers, None);
            error.context(format!("a value of type {}", translator.module.describe_type(ty)))
        };
        Ok(match self.module.ty(ty).clone() {
            Type::Void => 0,
            Type::Bool | Type::Image(_) | Type::Sampler | Type::RayQuery | Type::HitObject { .. } => 1,
            Type::Int { width, .. } | Type::Float { width, .. } => width.div_ceil(32),
            Type::SampledImage(_) | Type::AccelerationStructure => 2,
            Type::Vector { component: part, count } | Type::Matrix { column: part, count } => {
                let words = self.word_count(part)?;
                words.checked_mul(count).filter(|&words| words < most).ok_or_else(|| too_big(self))?
            }
            Type::Array { element, length, .. } => {
                let words = self.word_count(element)?;
                let length = self.array_length(length)?;
                words.checked_mul(length).filter(|&words| words < most).ok_or_else(|| too_big(self))?
            }
            Type::Struct { members, .. } => {
                let mut sum = 0u32;
                for member in members {
                    let words = self.word_count(member.ty)?;
                    sum = sum.checked_add(words).filter(|&sum| sum < most).ok_or_else(|| too_big(self))?;
                }
                sum
            }
            Type::Pointer { storage_class, .. } => pointer::pointer_word_count(storage_class),
            other => {
                let name = self.module.describe_type(ty);
                return Err(match other {
                    Type::RuntimeArray { .. } => self.invalid(format!("{name} cannot be a value")),
                    _ => self.unsupported(format!("values of type {name} are not supported")),
                });
            }
        })
    }

    /// Bits of a scalar type or of a vector's component; 0 for a bool.
    ///
    /// A module whose arithmetic has operands of another [`FloatFormat`] than IEEE 754's is not
    /// loaded, so that their number of bits tells the formats of all others.
    pub fn scalar_width(&self, ty: TypeId) -> Result<u32> {
        match *self.module.ty(ty) {
            Type::Bool => Ok(0),
            Type::Int { width, .. } | Type::Float { width, .. } => Ok(width),
            Type::Vector { component, .. } => self.scalar_width(component),
            _ => Err(self.invalid(format!(
                "the operand is of type {} instead of a scalar or vector",
                self.module.describe_type(ty)
            ))),
        }
    }

    /// The format of a float type or of a vector's component; `None` for another type.
    pub fn float_format(&self, ty: TypeId) -> Option<FloatFormat> {
        match *self.module.ty(ty) {
            Type::Vector { component, .. } => self.module.ty(component).float_format(),
            ref ty => ty.float_format(),
        }
    }

    /// How many components a scalar (1) or vector has.
    pub fn component_count(&self, ty: TypeId) -> u32 {
        match *self.module.ty(ty) {
            Type::Vector { count, .. } => count,
            _ => 1,
        }
    }

    /// The first register of each component of a scalar or vector.
    pub fn components(&mut self, id: Id) -> Result<Words> {
        Ok(self.components_of_width(id)?.0)
    }

    /// The first register of each component of a scalar or vector, and the bits of a component.
    pub fn components_of_width(&mut self, id: Id) -> Result<(Words, u32)> {
        let ty = self.type_of(id)?;
        let words = self.words(id)?;
        let width = self.scalar_width(ty)?;
        Ok((first_words(words, width), width))
    }

    /// The first register of each component of a scalar or vector whose components have `width`
    /// bits.
    #[inline]
    pub fn components_of(&mut self, id: Id, width: u32) -> Result<Words> {
        Ok(first_words(self.words(id)?, width))
    }

    /// The registers of all words, from the first register of each component.
    pub fn expand_components(&self, components: &[Reg], width: u32) -> Words {
        let each = width.div_ceil(32).max(1);
        components.iter().flat_map(|&reg| (0..each).map(move |word| reg.plus(word))).collect()
    }

    /// Words of a constant of the module.
    pub(super) fn constant_words(&mut self, index: u32) -> Result<Words> {
        let constant = self.module.constants[index as usize].clone();
        let before = self.origin;
        self.origin = Origin { offset: constant.offset, scope: 0 };
        let nested = std::mem::replace(&mut self.in_constant, true);
        let words = match constant.value {
            ConstantValue::Scalar(bits) => match self.scalar_width(constant.ty)? {
                64 => {
                    let reg = self.wide_constant(bits)?;
                    Ok(SmallVec::from_slice(&[reg, reg.plus(1)]))
                }
                _ => Ok(SmallVec::from_slice(&[self.constant(bits as u32)?])),
            },
            ConstantValue::Composite(parts) => {
                let ids: Vec<u32> = parts.iter().map(|part| part.0).collect();
                self.word_count(constant.ty)?;
                crate::ops::composite::check_constituents(self, constant.ty, &ids, false)?;
                match (self.module.cooperative_matrix(constant.ty), &parts[..]) {
                    (Some(_), &[part]) => crate::ops::composite::replicate(self, constant.ty, part),
                    _ => {
                        let mut words = Words::new();
                        for part in parts {
                            words.extend(self.words(part)?);
                        }
                        Ok(words)
                    }
                }
            }
            ConstantValue::Data(bytes) => self.data_words(constant.ty, &bytes),
            ConstantValue::Undef if !self.optimizes => self.undefined_constant(constant.id, constant.ty),
            ConstantValue::Null | ConstantValue::Undef => self.zero(constant.ty),
            ConstantValue::Operation { opcode, operands } => {
                crate::ops::constant::operation(self, constant.id, constant.ty, opcode, &operands)
            }
            ConstantValue::Other(
                Opcode::ConstantCompositeReplicateEXT | Opcode::SpecConstantCompositeReplicateEXT,
            ) => {
                // Opcode, type, result, constituent.
                let part = self.module.words[constant.offset as usize + 3];
                crate::ops::composite::replicate(self, constant.ty, Id(part))
            }
            ConstantValue::Other(opcode) => {
                Err(self.unsupported(format!("{} as a constant is not supported", opcode)))
            }
        };
        self.origin = before;
        self.in_constant = nested;
        let words = words?;
        if self.word_count(constant.ty)? as usize != words.len() {
            let name = self.module.describe_type(constant.ty);
            return Err(self.invalid(format!("the constant %{} is not a {name}", constant.id.0)));
        }
        Ok(words)
    }

    /// The words of an array of integers, from its packed bytes.
    fn data_words(&mut self, ty: TypeId, bytes: &[u8]) -> Result<Words> {
        let &Type::Array { element, .. } = self.module.ty(ty) else { return Ok(Words::new()) };
        let width = self.scalar_width(element)?;
        let mut words = Words::new();
        self.word_count(ty)?;
        for element in bytes.chunks_exact(width as usize / 8) {
            let bits = element.iter().rev().fold(0, |bits, &byte| bits << 8 | u64::from(byte));
            match width {
                64 => {
                    let reg = self.wide_constant(bits)?;
                    words.extend([reg, reg.plus(1)]);
                }
                _ => words.push(self.constant(bits as u32)?),
            }
        }
        Ok(words)
    }

    /// A value of zeros.
    pub fn zero(&mut self, ty: TypeId) -> Result<Words> {
        // 64-bit scalars need their words side by side, so zeros are pairs throughout.
        let zero = self.wide_constant(0)?;
        let mut words = Words::new();
        self.zero_words(ty, zero, &mut words)?;
        Ok(words)
    }

    /// The words of an undefined value of a type: zeros, which without optimization have registers
    /// of their own, so that a sanitizer tells them from the number 0.
    pub fn undefined(&mut self, ty: TypeId) -> Result<Words> {
        if self.optimizes || self.in_constant {
            return self.zero(ty);
        }
        let count = self.word_count(ty)?;
        let first = self.undefined_registers(count)?;
        Ok(registers_from(first, count))
    }

    /// The words of `OpUndef` at module scope where nothing is optimised: zeros in registers of
    /// their own, as [`Translator::undefined`].
    fn undefined_constant(&mut self, id: Id, ty: TypeId) -> Result<Words> {
        let count = self.word_count(ty)?;
        let first = self.fresh(count)?;
        (0..count).for_each(|word| self.set_constant(first.plus(word), 0));
        self.undefined_constants.push(UndefinedConstant { id, ty, first, count });
        Ok(registers_from(first, count))
    }

    /// The register of an undefined component of a vector, and the next one; see
    /// [`Translator::undefined`].
    pub fn undefined_component(&mut self) -> Result<Reg> {
        if self.optimizes || self.in_constant { self.wide_constant(0) } else { self.undefined_registers(2) }
    }

    fn undefined_registers(&mut self, count: u32) -> Result<Reg> {
        let first = self.fresh(count)?;
        self.emit(Op::Memory(MemoryOp::Undefine { first, count }));
        Ok(first)
    }

    fn zero_words(&mut self, ty: TypeId, zero: Reg, words: &mut Words) -> Result<()> {
        // Parts without words are not walked: a few of them nest to any number.
        if self.word_count(ty)? == 0 {
            return Ok(());
        }
        match self.module.ty(ty).clone() {
            Type::Vector { component: part, count } | Type::Matrix { column: part, count } => {
                (0..count).try_for_each(|_| self.zero_words(part, zero, words))
            }
            Type::Array { element, length, .. } => {
                let count = self.word_count(ty)? / self.word_count(element)?.max(1);
                debug_assert_eq!(count, self.array_length(length)?);
                (0..count).try_for_each(|_| self.zero_words(element, zero, words))
            }
            Type::Struct { members, .. } => {
                members.iter().try_for_each(|member| self.zero_words(member.ty, zero, words))
            }
            _ => {
                let count = self.word_count(ty)?;
                words.extend((0..count).map(|word| if word == 1 { zero.plus(1) } else { zero }));
                Ok(())
            }
        }
    }
}

/// The first word of each component.
fn first_words(words: Words, width: u32) -> Words {
    match width {
        0..=32 => words,
        _ => words.chunks(width.div_ceil(32) as usize).map(|chunk| chunk[0]).collect(),
    }
}
