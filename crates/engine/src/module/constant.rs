//! Constants and specialization constants of module scope.

use std::sync::OnceLock;

use crate::module::scalar_value::ScalarValue;
use crate::module::ty::{CooperativeMatrix, Type, TypeId};
use crate::module::{Definition, Id, Module, Opcode};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_base::sorted::sort;

/// A constant with its type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Constant {
    /// Its result id.
    pub id: Id,
    /// Its type.
    pub ty: TypeId,
    /// Its value.
    pub value: ConstantValue,
    /// The `SpecId` decoration.
    pub spec_id: Option<u32>,
    /// Whether one of the `OpSpecConstant*` defines it: a specialization may change it, directly or
    /// through its constituents.
    pub specializable: bool,
    /// The word offset of its instruction.
    pub offset: u32,
}

/// The value of a constant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ConstantValue {
    /// A bool (0 or 1), an integer (its low `width` bits, zero-extended) or a float's bits.
    Scalar(u64),
    /// Ids of the constituents.
    Composite(Vec<Id>),
    /// The bytes of an array of integers (`OpConstantDataKHR`), packed and little-endian.
    Data(Vec<u8>),
    /// `OpConstantNull`.
    Null,
    /// `OpUndef` at module scope.
    Undef,
    /// `OpSpecConstantOp`: the opcode and its operand words.
    Operation {
        /// The opcode.
        opcode: Opcode,
        /// The words after the opcode.
        operands: Vec<u32>,
    },
    /// A kind that this crate does not evaluate (`OpConstantSampler`, ...).
    Other(Opcode),
}

impl Module {
    /// Overrides the specialization constants with this `SpecId`: a `bool`, an integer that the
    /// constant's type holds, or a float for a float, which is rounded once.
    ///
    /// ```
    /// use anyhit::Module;
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// let module = Module::open("spirv-fixtures/pass/harness/conversions/types.comp.spv")?;
    /// let mut module = (*module).clone();
    /// module.specialize(3, 7)?; // uint
    /// module.specialize(4, 0.25)?; // float
    /// module.specialize(5, false)?; // bool
    /// assert!(module.specialize(3, -1).is_err() && module.specialize(4, 2).is_err());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `InvalidArgument` where the module has no scalar specialization constant with this id, with
    /// a list of those that it has, and where the value is none of the constant's type.
    pub fn specialize(&mut self, spec_id: u32, value: impl Into<ScalarValue>) -> Result<()> {
        let bits = match self.specialization_type(spec_id) {
            Some(ty) => value.into().bits(self.ty(ty)).map_err(|why| {
                let message = format!("the specialization constant {spec_id}: {why}");
                Error::new(ErrorKind::InvalidArgument, message)
            })?,
            None => 0,
        };
        self.specialize_bits(spec_id, bits)
    }

    /// Overrides the specialization constants with this `SpecId` by the bits of a value: a bool (0
    /// is false), an integer or a float. Bits above the type's width are dropped.
    ///
    /// # Errors
    /// `InvalidArgument` where the module has no scalar specialization constant with this id; a
    /// note lists those that it has.
    #[doc(hidden)]
    pub fn specialize_bits(&mut self, spec_id: u32, bits: u64) -> Result<()> {
        let mut found = false;
        for constant in &mut self.constants {
            if constant.spec_id != Some(spec_id) || !constant.specializable {
                continue;
            }
            let ConstantValue::Scalar(value) = &mut constant.value else { continue };
            *value = match self.types[constant.ty.0 as usize] {
                Type::Int { width, .. } | Type::Float { width, .. } => bits & (u64::MAX >> (64 - width)),
                _ => u64::from(bits != 0),
            };
            found = true;
        }
        if found {
            self.count_components(spec_id)?;
            // Layouts may depend on it.
            self.faults = OnceLock::new();
            return Ok(());
        }
        Err(Error::new(
            ErrorKind::InvalidArgument,
            format!("the module has no specialization constant {spec_id}"),
        )
        .note(self.list_specializations()))
    }

    /// Sets the number of components of vector and cooperative matrix types whose counts are
    /// specialization constants.
    fn count_components(&mut self, spec_id: u32) -> Result<()> {
        let most = self.limits.get(InputLimit::TypeParts);
        for at in 0..self.vector_counts.len() {
            let (ty, length) = self.vector_counts[at];
            let (Some(found), Type::Vector { component, .. }) = (self.scalar_value(length), self.ty(ty))
            else {
                continue;
            };
            let (component, count) = (*component, u32::try_from(found).unwrap_or(u32::MAX));
            if count == 0 || u64::from(count) > most {
                let message = format!(
                    "the specialization constant {spec_id}: a vector of {count} components; 1 to {most} are supported"
                );
                return Err(Error::new(ErrorKind::InvalidArgument, message));
            }
            self.types[ty.0 as usize] = Type::Vector { component, count };
        }
        for at in 0..self.cooperative_matrices.len() {
            let matrix = self.cooperative_matrices[at];
            let [rows, columns] = [matrix.rows, matrix.columns].map(|id| self.scalar_value(id).unwrap_or(0));
            let found = CooperativeMatrix::components_of_invocation(rows, columns);
            if u64::from(found) > most {
                let message = format!(
                    "the specialization constant {spec_id}: a cooperative matrix of {rows} rows and {columns} columns"
                );
                return Err(Error::new(ErrorKind::InvalidArgument, message));
            }
            if let Type::Vector { count, .. } = &mut self.types[matrix.ty.0 as usize] {
                *count = found;
            }
        }
        Ok(())
    }

    /// Overrides the data of the specialization constants with this `SpecId`
    /// (`OpSpecConstantDataKHR`): the elements of an array of integers, packed and little-endian.
    /// An array of another length needs its own specialization constant set, too
    /// (`SPV_KHR_constant_data`).
    ///
    /// # Errors
    /// `InvalidArgument` where the module has no such constant, with a list of those that it has.
    pub fn specialize_data(&mut self, spec_id: u32, bytes: &[u8]) -> Result<()> {
        let mut found = false;
        for constant in &mut self.constants {
            if constant.spec_id == Some(spec_id)
                && let ConstantValue::Data(data) = &mut constant.value
            {
                *data = bytes.to_vec();
                found = true;
            }
        }
        if found {
            return Ok(());
        }
        let message = format!("the module has no specialization constant {spec_id} of data");
        Err(Error::new(ErrorKind::InvalidArgument, message).note(self.list_specializations()))
    }

    /// Returns true if the specialization constants with this `SpecId` are data.
    #[doc(hidden)]
    pub fn specializes_data(&self, spec_id: u32) -> bool {
        let is_data = |constant: &Constant| matches!(constant.value, ConstantValue::Data(_));
        self.constants.iter().any(|constant| constant.spec_id == Some(spec_id) && is_data(constant))
    }

    /// The type of the scalar specialization constants with this `SpecId`.
    #[doc(hidden)]
    pub fn specialization_type(&self, spec_id: u32) -> Option<TypeId> {
        let has_spec_id = |constant: &&Constant| {
            let is_scalar = matches!(constant.value, ConstantValue::Scalar(_));
            constant.spec_id == Some(spec_id) && constant.specializable && is_scalar
        };
        self.constants.iter().find(has_spec_id).map(|constant| constant.ty)
    }

    /// The current bits of a scalar constant. A specialization constant has its default, or the
    /// value that [`Module::specialize`] has set.
    ///
    /// The bits are encoded as by [`Module::constant_scalar`]. `None` for composites, undefined
    /// values, and results of `OpSpecConstantOp`.
    #[doc(hidden)]
    pub fn scalar_value(&self, id: Id) -> Option<u64> {
        match self.definition(id)? {
            Definition::Constant(index) => match self.constants[index as usize].value {
                ConstantValue::Scalar(bits) => Some(bits),
                _ => self.constant_scalar(id),
            },
            _ => None,
        }
    }

    fn list_specializations(&self) -> String {
        let mut known: Vec<(u32, String)> = self
            .constants
            .iter()
            .filter(|constant| matches!(constant.value, ConstantValue::Scalar(_) | ConstantValue::Data(_)))
            .filter_map(|constant| {
                let name = self.name(constant.id).map(|name| format!(" `{name}`")).unwrap_or_default();
                let spec_id = constant.spec_id?;
                Some((spec_id, format!("{spec_id} ({}{name})", self.describe_type(constant.ty))))
            })
            .collect();
        sort(&mut known);
        if known.is_empty() {
            return "it has no specialization constants".to_owned();
        }
        let known: Vec<String> = known.into_iter().map(|(_, text)| text).collect();
        format!("its specialization constants: {}", known.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use crate::module::Opcode;
    use pretty_assertions::assert_eq;

    use crate::module::Id;
    use crate::module::assemble::Assembler;
    use anyhit_base::error::ErrorKind;

    #[test]
    fn specialization_replaces_the_default_in_the_types_width() {
        let mut a = Assembler::new();
        a.with_string(Opcode::Name, &[20], "samples", &[]);
        a.op(Opcode::Decorate, &[20, 1, 3]);
        a.op(Opcode::Decorate, &[21, 1, 4]);
        a.op(Opcode::Decorate, &[22, 1, 5]);
        a.types();
        a.op(Opcode::SpecConstant, &[5, 20, 16]);
        a.op(Opcode::SpecConstantTrue, &[3, 21]);
        a.op(Opcode::TypeInt, &[23, 64, 0]);
        a.op(Opcode::SpecConstant, &[23, 22, 1, 2]);
        let mut module = a.loaded();
        let value = |module: &crate::module::Module, id| module.scalar_value(Id(id));
        assert_eq!([20, 21, 22].map(|id| value(&module, id)), [Some(16), Some(1), Some(0x2_0000_0001)]);
        module.specialize_bits(3, 0xffff_ffff_0000_0001).unwrap();
        module.specialize_bits(4, 0).unwrap();
        module.specialize_bits(5, u64::MAX).unwrap();
        assert_eq!([20, 21, 22].map(|id| value(&module, id)), [Some(1), Some(0), Some(u64::MAX)]);
        assert_eq!(value(&module, 8), Some(3));

        let error = module.specialize_bits(9, 0).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidArgument);
        assert_eq!(error.message(), "the module has no specialization constant 9");
        assert_eq!(
            error.notes(),
            ["its specialization constants: 3 (uint `samples`), 4 (bool), 5 (uint64_t)"]
        );
    }

    #[test]
    fn a_module_without_specialization_constants_says_so() {
        let error = Assembler::new().loaded().specialize_bits(0, 0).unwrap_err();
        assert_eq!(error.notes(), ["it has no specialization constants"]);
    }

    #[test]
    fn narrow_constants_lose_the_sign_bits_above_their_width() {
        let mut a = Assembler::new();
        a.op(Opcode::TypeInt, &[1, 16, 1]);
        // -2 as a 16-bit integer: sign-extended in its word (specification, section 2.2.1).
        a.op(Opcode::Constant, &[1, 2, 0xffff_fffe]);
        a.op(Opcode::ConstantNull, &[1, 3]);
        a.op(Opcode::Undef, &[1, 4]);
        let module = a.loaded();
        assert_eq!([2, 3, 4].map(|id| module.constant_scalar(Id(id))), [Some(0xfffe), Some(0), None]);
    }
}
