//! Reads constants of module scope.
//!
//! SPIR-V specification, section 3.3.7 "Constant-Creation Instructions".

use crate::module::constant::{Constant, ConstantValue};
use crate::module::declare_type::unsupported_continuation;
use crate::module::grammar::InstructionGrammar;
use crate::module::heap::DESCRIPTOR_BYTES;
use crate::module::load::Loader;
use crate::module::span::{Span, invalid};
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Opcode};
use anyhit_base::error::Result;
use anyhit_base::input::InputLimit;

impl Loader<'_> {
    /// How many words the value of an `OpConstant` or `OpSpecConstant` takes; 1 for anything else.
    pub(super) fn literal_words(&self, span: Span) -> usize {
        if !matches!(span.opcode, Opcode::Constant | Opcode::SpecConstant) || span.end < span.start + 2 {
            return 1;
        }
        match self.module.definition(self.id(span.start + 1)) {
            Some(Definition::Type(ty)) => match *self.module.ty(ty) {
                Type::Int { width: 64, .. } | Type::Float { width: 64, .. } => 2,
                // The width is not known here: all words that there are.
                Type::Other(_) => (span.end - span.start).saturating_sub(3).max(1),
                _ => 1,
            },
            _ => 1,
        }
    }

    pub(super) fn declare_constant(&mut self, span: Span, known: &InstructionGrammar) -> Result<()> {
        if !known.has_result {
            return Err(unsupported_continuation(span));
        }
        let first = span.start + 1;
        let ty = self.type_at(span, first)?;
        if matches!(self.module.ty(ty), Type::Void | Type::Function { .. }) {
            return Err(self.expected(span, first, "a type of values"));
        }
        let value = self.constant_value(span, span.opcode, ty)?;
        let index = self.module.constants.len() as u32;
        self.within(InputLimit::ModuleConstants, u64::from(index) + 1, span.start)?;
        self.define(first + 1, Definition::Constant(index))?;
        self.module.constants.push(Constant {
            id: self.id(first + 1),
            ty,
            value,
            spec_id: None,
            specializable: known.name.starts_with("Spec"),
            offset: span.start as u32,
        });
        Ok(())
    }

    fn constant_value(&mut self, span: Span, op: Opcode, ty: TypeId) -> Result<ConstantValue> {
        let at = span.start + 3;
        Ok(match op {
            Opcode::ConstantTrue
            | Opcode::ConstantFalse
            | Opcode::SpecConstantTrue
            | Opcode::SpecConstantFalse => {
                if *self.module.ty(ty) != Type::Bool {
                    return Err(self.expected(span, span.start + 1, "OpTypeBool"));
                }
                ConstantValue::Scalar(u64::from(matches!(
                    op,
                    Opcode::ConstantTrue | Opcode::SpecConstantTrue
                )))
            }
            Opcode::Constant | Opcode::SpecConstant => match *self.module.ty(ty) {
                Type::Int { width, .. } | Type::Float { width, .. } => {
                    let high = if width == 64 { u64::from(self.words[at + 1]) } else { 0 };
                    let bits = high << 32 | u64::from(self.words[at]);
                    ConstantValue::Scalar(bits & (u64::MAX >> (64 - width)))
                }
                Type::Other(_) => ConstantValue::Other(span.opcode),
                _ => return Err(self.expected(span, span.start + 1, "an integer or float type")),
            },
            Opcode::ConstantComposite | Opcode::SpecConstantComposite => {
                self.check_constituents(span, ty)?;
                ConstantValue::Composite((at..span.end).map(|at| self.id(at)).collect())
            }
            Opcode::ConstantDataKHR | Opcode::SpecConstantDataKHR => {
                ConstantValue::Data(self.constant_data(span, ty)?)
            }
            Opcode::ConstantSizeOfEXT => {
                if !matches!(self.module.ty(ty), Type::Int { width: 32 | 64, .. }) {
                    return Err(self.expected(span, span.start + 1, "an integer type of 32 or 64 bits"));
                }
                let of = self.type_at(span, at)?;
                let ty = self.module.ty(of);
                // A type that is not known may be one.
                if !ty.is_descriptor() && !matches!(ty, Type::Other(_)) {
                    let error = self.expected(span, at, "the type of a descriptor");
                    return Err(error.note("SPV_EXT_descriptor_heap, OpConstantSizeOfEXT"));
                }
                ConstantValue::Scalar(DESCRIPTOR_BYTES.into())
            }
            Opcode::ConstantNull => ConstantValue::Null,
            Opcode::Undef | Opcode::PoisonKHR => ConstantValue::Undef,
            Opcode::SpecConstantOp => ConstantValue::Operation {
                // An opcode that does not fit 16 bits cannot exist: it is refused where it is
                // needed.
                opcode: Opcode::of_operand(self.words[at]),
                operands: self.words[at + 1..span.end].to_vec(),
            },
            _ => ConstantValue::Other(span.opcode),
        })
    }

    /// The bytes of an array of integers, as `SPV_KHR_constant_data` packs them.
    fn constant_data(&self, span: Span, ty: TypeId) -> Result<Vec<u8>> {
        let rule = "SPV_KHR_constant_data: Result Type must be an array of scalar integer type elements";
        let (length, width) = match *self.module.ty(ty) {
            Type::Array { element, length, .. } => match *self.module.ty(element) {
                Type::Int { width, .. } => (length, width),
                _ => return Err(self.expected(span, span.start + 1, "an array of integers").note(rule)),
            },
            _ => return Err(self.expected(span, span.start + 1, "an array of integers").note(rule)),
        };
        let data = &self.words[span.start + 3..span.end];
        let mut bytes: Vec<u8> = data.iter().flat_map(|word| word.to_le_bytes()).collect();
        // The length of an operation is not known here: it is compared where the data is used.
        if let Some(length) = self.module.scalar_value(length) {
            let size = length.saturating_mul(u64::from(width / 8));
            if size.div_ceil(4) != data.len() as u64 {
                let message = format!(
                    "{}: {} words of data for {length} elements of {width} bits, which take {}",
                    span.opcode,
                    data.len(),
                    size.div_ceil(4)
                );
                return Err(invalid(span.start, message));
            }
            bytes.truncate(size as usize);
        }
        Ok(bytes)
    }

    /// Checks that each constituent is a constant of the type that the composite has there.
    fn check_constituents(&self, span: Span, ty: TypeId) -> Result<()> {
        /// What the constituents of a composite must be.
        enum ConstituentTypes<'a> {
            All(TypeId),
            Each(&'a [crate::module::ty::Member]),
            Anything,
        }
        let at = span.start + 3;
        let found = (span.end - at) as u64;
        let (expected, count) = match self.module.ty(ty) {
            // Its one constituent is the value of all components.
            Type::Vector { component, .. } if self.module.cooperative_matrix(ty).is_some() => {
                (ConstituentTypes::All(*component), Some(1))
            }
            Type::Vector { component, count } => (ConstituentTypes::All(*component), Some(u64::from(*count))),
            Type::Matrix { column, count } => (ConstituentTypes::All(*column), Some(u64::from(*count))),
            Type::Array { element, length, .. } => {
                (ConstituentTypes::All(*element), self.module.constant_scalar(*length))
            }
            Type::Struct { members, .. } => (ConstituentTypes::Each(members), Some(members.len() as u64)),
            Type::Other(_) => (ConstituentTypes::Anything, None),
            _ => {
                let error = self.expected(span, span.start + 1, "a composite type");
                return Err(error.note("SPIR-V, 3.3.7: one constituent for each element of the type"));
            }
        };
        if let Some(count) = count
            && count != found
        {
            return Err(invalid(
                span.start,
                format!("{}: expected {count} constituents, found {found}", span.opcode),
            ));
        }
        for at in at..span.end {
            let id = self.id(at);
            let constituent = match self.module.definition(id) {
                Some(Definition::Constant(index)) => self.module.constants[index as usize].ty,
                None if self.unknown.contains_key(&id) => continue,
                _ => return Err(self.expected(span, at, "a constant")),
            };
            let expected = match expected {
                ConstituentTypes::All(ty) => ty,
                ConstituentTypes::Each(members) => members[at - span.start - 3].ty,
                ConstituentTypes::Anything => continue,
            };
            if expected != constituent {
                let what = format!("a constant of type {}", self.module.describe_type(expected));
                return Err(self.expected(span, at, &what));
            }
        }
        Ok(())
    }
}
