//! Reads type declarations into the arena of types.
//!
//! SPIR-V specification, sections 2.8 "Types and Variables" and 3.3.6 "Type-Declaration
//! Instructions".

use rspirv::spirv::Capability;

use crate::module::constant::ConstantValue;
use crate::module::grammar::InstructionGrammar;
use crate::module::load::Loader;
use crate::module::names::storage_class_name;
use crate::module::span::{Span, invalid};
use crate::module::ty::{
    BFLOAT16, CooperativeMatrix, FLOAT8_E4M3, FLOAT8_E5M2, ImageType, Member, Type, TypeExtent, TypeId,
};
use crate::module::validate::explicit_layout::{STORAGE_BUFFER, UNIFORM};
use crate::module::{Definition, Id, Module, Opcode};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::InputLimit;

impl Loader<'_> {
    /// Reads `OpTypeForwardPointer`: a pointer type whose pointee is declared later.
    pub(super) fn declare_forward_pointer(&mut self, span: Span) -> Result<()> {
        let at = span.start + 1;
        let storage_class = self.words[at + 1];
        let ty = TypeId(self.module.types.len() as u32);
        self.define(at, Definition::Type(ty))?;
        self.push_type(
            self.id(at),
            Type::Pointer { storage_class, pointee: None, stride: None },
            TypeExtent::LEAF,
        );
        self.forward.insert(self.id(at), at);
        Ok(())
    }

    /// Reads any other type declaration.
    pub(super) fn declare_type(&mut self, span: Span, known: &InstructionGrammar) -> Result<()> {
        if !known.has_result {
            return Err(unsupported_continuation(span));
        }
        let at = span.start + 1;
        let (ty, extent) = self.type_of_words(span, span.opcode)?;
        // Every kind of nesting is limited, so that recursion over a type has a bounded depth.
        self.within(InputLimit::TypeNesting, extent.depth.into(), span.start)?;
        self.within(InputLimit::TypeParts, extent.parts, span.start)?;
        if must_be_unique(&ty) {
            let mut key = self.words[at + 1..span.end].to_vec();
            key.push(span.opcode.0.into());
            if let Some(first) = self.unique_types.insert(key, span.start) {
                return Err(invalid(
                    span.start,
                    format!("{} repeats the declaration of a type", span.opcode),
                )
                .at_with(Place::Word(first), "the first declaration"));
            }
        }
        if span.opcode == Opcode::TypePointer && self.forward.contains_key(&self.id(at)) {
            return self.define_forward_pointer(span, ty);
        }
        let id = TypeId(self.module.types.len() as u32);
        self.define(at, Definition::Type(id))?;
        self.push_type(self.id(at), ty, extent);
        if span.opcode == Opcode::TypeVectorIdEXT && known_vector(&self.module, id) {
            self.module.vector_counts.push((id, self.id(at + 2)));
        }
        if span.opcode == Opcode::TypeCooperativeMatrixKHR && known_vector(&self.module, id) {
            let [scope, rows, columns, usage] = [2, 3, 4, 5].map(|operand| self.id(at + operand));
            self.module.cooperative_matrices.push(CooperativeMatrix { ty: id, scope, rows, columns, usage });
        }
        Ok(())
    }

    fn define_forward_pointer(&mut self, span: Span, ty: Type) -> Result<()> {
        let id = self.id(span.start + 1);
        let Some(Definition::Type(forward)) = self.module.definition(id) else {
            panic!("bug in anyhit: a forward pointer is not a type");
        };
        let declared = &mut self.module.types[forward.0 as usize];
        let same_storage_class = match (&*declared, &ty) {
            (Type::Pointer { storage_class: first, .. }, Type::Pointer { storage_class: second, .. }) => {
                first == second
            }
            _ => false,
        };
        if !same_storage_class {
            return Err(invalid(
                span.start + 2,
                format!(
                    "OpTypePointer: the storage class of %{} differs from its OpTypeForwardPointer",
                    id.0
                ),
            ));
        }
        *declared = ty;
        self.forward.remove(&id);
        Ok(())
    }

    /// Parses a type; returns it with its extent.
    fn type_of_words(&mut self, span: Span, op: Opcode) -> Result<(Type, TypeExtent)> {
        let at = span.start + 2;
        let words = self.words;
        let ty = match op {
            Opcode::TypeVoid => Type::Void,
            Opcode::TypeBool => Type::Bool,
            Opcode::TypeInt => {
                let (width, signed) = (words[at], words[at + 1]);
                if width == 0 || signed > 1 {
                    let message =
                        format!("OpTypeInt: width {width}, signedness {signed} (0 or 1 is expected)");
                    return Err(invalid(at, message).note("SPIR-V, 3.3.6, OpTypeInt"));
                }
                match width {
                    8 | 16 | 32 | 64 => Type::Int { width, signed: signed == 1 },
                    _ => Type::Other(span.opcode),
                }
            }
            Opcode::TypeFloat => {
                let width = words[at];
                let ty = Type::Float { width, encoding: words[at + 1..span.end].first().copied() };
                match (ty.float_format(), &ty) {
                    (Some(_), _) => ty,
                    (None, Type::Float { width: 0, .. }) => {
                        return Err(invalid(at, "OpTypeFloat: a width above 0 is expected, found 0"));
                    }
                    // SPV_EXT_float8 adds 8 bits with an encoding alone.
                    (None, Type::Float { width: 8, encoding: None }) => {
                        let message = "OpTypeFloat: 8 bits without an FP Encoding (SPIR-V 2.16.1: floats of 16, \
                                       32 and 64 bits)";
                        return Err(invalid(at, message));
                    }
                    (None, Type::Float { width, encoding: Some(BFLOAT16 | FLOAT8_E4M3 | FLOAT8_E5M2) }) => {
                        let message = format!(
                            "OpTypeFloat: {width} bits with an FP Encoding of another width (SPV_KHR_bfloat16 and \
                             SPV_EXT_float8, FP Encoding)"
                        );
                        return Err(invalid(at, message));
                    }
                    (None, _) => Type::Other(span.opcode),
                }
            }
            Opcode::TypeVector => {
                let component = self.type_at(span, at)?;
                if !is_scalar(self.module.ty(component)) {
                    return Err(self.expected(span, at, "a scalar type"));
                }
                let count = self.component_count(span, at + 1)?;
                return Ok((Type::Vector { component, count }, self.extent(component).around(count)));
            }
            // OpTypeCooperativeVectorNV has the same number.
            Opcode::TypeVectorIdEXT
                if [Capability::LongVectorEXT, Capability::CooperativeVectorNV]
                    .iter()
                    .any(|&capability| self.module.capabilities.contains(&(capability as u32))) =>
            {
                let component = self.type_at(span, at)?;
                if !is_scalar(self.module.ty(component)) {
                    return Err(self.expected(span, at, "a scalar type"));
                }
                let length = self.array_length(span, at + 1)?;
                let ty = self.long_vector(span, component, length)?;
                let count = if let Type::Vector { count, .. } = ty { count } else { 1 };
                return Ok((ty, self.extent(component).around(count)));
            }
            Opcode::TypeCooperativeMatrixKHR
                if self.module.capabilities.contains(&(Capability::CooperativeMatrixKHR as u32)) =>
            {
                let component = self.type_at(span, at)?;
                if !is_scalar(self.module.ty(component)) {
                    return Err(self.expected(span, at, "a numerical type"));
                }
                let [rows, columns] = [at + 2, at + 3].map(|at| self.module.scalar_value(self.id(at)));
                let (Some(rows), Some(columns)) = (rows, columns) else {
                    return Ok((Type::Other(span.opcode), TypeExtent::LEAF));
                };
                let count = CooperativeMatrix::components_of_invocation(rows, columns);
                return Ok((Type::Vector { component, count }, self.extent(component).around(count)));
            }
            Opcode::TypeMatrix => {
                let column = self.type_at(span, at)?;
                if !matches!(self.module.ty(column), Type::Vector { .. }) {
                    return Err(self.expected(span, at, "a vector type"));
                }
                let count = self.column_count(span, at + 1)?;
                return Ok((Type::Matrix { column, count }, self.extent(column).around(count)));
            }
            Opcode::TypeArray => {
                let element = self.data_type(span, at)?;
                let length = self.array_length(span, at + 1)?;
                return Ok((Type::Array { element, length, stride: None }, self.extent(element).around(1)));
            }
            Opcode::TypeRuntimeArray => {
                let element = self.data_type(span, at)?;
                return Ok((Type::RuntimeArray { element, stride: None }, self.extent(element).around(1)));
            }
            Opcode::TypeStruct => {
                let mut members = Vec::with_capacity(span.end - at);
                let mut extent = TypeExtent { depth: 0, parts: 0 };
                for member in at..span.end {
                    let ty = self.data_type(span, member)?;
                    let part = self.extent(ty);
                    extent.depth = extent.depth.max(part.depth);
                    extent.parts = extent.parts.saturating_add(part.parts);
                    members.push(Member {
                        ty,
                        name: String::new(),
                        offset: None,
                        matrix: None,
                        builtin: None,
                    });
                }
                return Ok((Type::Struct { members, block: false, buffer_block: false }, extent.around(1)));
            }
            Opcode::TypePointer => {
                let pointee = self.type_at(span, at + 1)?;
                let depth = self.extent(pointee).depth + 1;
                return Ok((
                    Type::Pointer { storage_class: words[at], pointee: Some(pointee), stride: None },
                    TypeExtent { depth, ..TypeExtent::LEAF },
                ));
            }
            Opcode::TypeUntypedPointerKHR => {
                Type::Pointer { storage_class: words[at], pointee: None, stride: None }
            }
            Opcode::TypeFunction => {
                let return_type = self.type_at(span, at)?;
                let mut parameters = Vec::with_capacity(span.end - at - 1);
                for parameter in at + 1..span.end {
                    parameters.push(self.data_type(span, parameter)?);
                }
                return Ok((Type::Function { return_type, parameters }, TypeExtent::LEAF));
            }
            Opcode::TypeImage => Type::Image(ImageType {
                sampled_type: self.type_at(span, at)?,
                dim: words[at + 1],
                depth: words[at + 2],
                arrayed: words[at + 3] != 0,
                multisampled: words[at + 4] != 0,
                sampled: words[at + 5],
                format: words[at + 6],
            }),
            Opcode::TypeSampledImage => {
                let image = self.type_at(span, at)?;
                if !matches!(self.module.ty(image), Type::Image(_) | Type::Other(_)) {
                    return Err(self.expected(span, at, "an image type"));
                }
                Type::SampledImage(image)
            }
            Opcode::TypeSampler => Type::Sampler,
            Opcode::TypeAccelerationStructureKHR => Type::AccelerationStructure,
            Opcode::TypeBufferEXT => match words[at] {
                storage_class @ (UNIFORM | STORAGE_BUFFER) => Type::Buffer { storage_class },
                found => {
                    let name = storage_class_name(found);
                    let message = format!("OpTypeBufferEXT: expected Uniform or StorageBuffer, found {name}");
                    return Err(invalid(at, message).note("SPV_EXT_descriptor_heap, OpTypeBufferEXT"));
                }
            },
            Opcode::TypeRayQueryKHR => Type::RayQuery,
            Opcode::TypeHitObjectNV => Type::HitObject { ext: false },
            Opcode::TypeHitObjectEXT => Type::HitObject { ext: true },
            _ => Type::Other(span.opcode),
        };
        Ok((ty, TypeExtent::LEAF))
    }

    fn extent(&self, ty: TypeId) -> TypeExtent {
        self.extents[ty.0 as usize]
    }

    /// Reads the number of a vector's components: 2, 3 or 4, 8 or 16 with `Vector16`, and any above
    /// with `LongVectorEXT`.
    fn component_count(&self, span: Span, at: usize) -> Result<u32> {
        let has = |capability: Capability| self.module.capabilities.contains(&(capability as u32));
        match self.words[at] {
            count @ 2..=4 => Ok(count),
            count @ (8 | 16) if has(Capability::Vector16) => Ok(count),
            count @ 2.. if has(Capability::LongVectorEXT) => Ok(count),
            count => Err(wrong_count(span, at, "2, 3 or 4 components", count)),
        }
    }

    /// The number of a matrix's columns: 2, 3 or 4.
    fn column_count(&self, span: Span, at: usize) -> Result<u32> {
        match self.words[at] {
            count @ 2..=4 => Ok(count),
            count => Err(wrong_count(span, at, "2, 3 or 4 columns", count)),
        }
    }

    /// Makes a vector type whose count is a constant (`SPV_EXT_long_vector`,
    /// `SPV_NV_cooperative_vector`); [`Module::specialize_bits`] changes it.
    fn long_vector(&mut self, span: Span, component: TypeId, length: Id) -> Result<Type> {
        match self.module.scalar_value(length).map(u32::try_from) {
            Some(Ok(count)) => Ok(Type::Vector { component, count }),
            _ => Err(Error::new(
                ErrorKind::UnsupportedModule,
                "OpTypeVectorIdEXT: a count of components that OpSpecConstantOp computes is not supported",
            )
            .at(Place::Word(span.start))),
        }
    }

    /// Reads the id of a type that values can have: neither void nor a function.
    fn data_type(&mut self, span: Span, at: usize) -> Result<TypeId> {
        let ty = self.type_at(span, at)?;
        match self.module.ty(ty) {
            Type::Void | Type::Function { .. } => Err(self.expected(span, at, "a type of values")),
            _ => Ok(ty),
        }
    }

    /// Reads the id of an array's length: a constant integer, at least 1 if its value is known.
    fn array_length(&self, span: Span, at: usize) -> Result<Id> {
        let id = self.id(at);
        let constant = match self.module.definition(id) {
            Some(Definition::Constant(index)) => &self.module.constants[index as usize],
            None if self.unknown.contains_key(&id) => return Ok(id),
            _ => return Err(self.expected(span, at, "a constant integer")),
        };
        let (width, signed) = match *self.module.ty(constant.ty) {
            Type::Int { width, signed } => (width, signed),
            Type::Other(_) => return Ok(id),
            _ => return Err(self.expected(span, at, "a constant integer")),
        };
        let too_small = match constant.value {
            ConstantValue::Scalar(value) => value == 0 || (signed && value >> (width - 1) == 1),
            ConstantValue::Null => true,
            _ => false,
        };
        if too_small {
            return Err(invalid(at, format!("OpTypeArray: the length %{} is not at least 1", id.0)));
        }
        Ok(id)
    }
}

/// Returns true for vector types.
fn known_vector(module: &Module, ty: TypeId) -> bool {
    matches!(module.ty(ty), Type::Vector { .. })
}

/// The error of a count of components or columns.
fn wrong_count(span: Span, at: usize, expected: &str, found: u32) -> Error {
    let opcode = span.opcode;
    invalid(at, format!("{opcode}: expected {expected}, found {found}")).note("SPIR-V, 2.16.1")
}

/// The error for an instruction that continues another one beyond 65,535 words.
pub(super) fn unsupported_continuation(span: Span) -> Error {
    Error::new(
        ErrorKind::UnsupportedModule,
        format!("{} is not supported: split the aggregate into smaller ones", span.opcode),
    )
    .at(Place::Word(span.start))
}

fn is_scalar(ty: &Type) -> bool {
    matches!(ty, Type::Bool | Type::Int { .. } | Type::Float { .. } | Type::Pointer { .. } | Type::Other(_))
}

/// Types other than aggregates and pointers must not be declared twice (section 2.8).
fn must_be_unique(ty: &Type) -> bool {
    !matches!(
        ty,
        Type::Array { .. }
            | Type::RuntimeArray { .. }
            | Type::Struct { .. }
            | Type::Pointer { .. }
            | Type::Other(_)
    )
}
