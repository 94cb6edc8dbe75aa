//! Describes ids and types in error messages and listings.

use crate::math::float_format::FloatFormat;
use crate::module::grammar::id_operands;
use crate::module::names::{ext_inst_name, storage_class_name};
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Module, Opcode};

impl Module {
    /// Describes an id in an error: `%7 (a label)`, `%12 (the constant "scale")`.
    #[doc(hidden)]
    pub fn describe_id(&self, id: Id) -> String {
        let what = match self.definition(id) {
            None => return format!("%{}, which is not defined", id.0),
            Some(Definition::Type(ty)) => {
                return format!("%{} (the type {})", id.0, self.describe_type(ty));
            }
            Some(Definition::Constant(_)) => "a constant",
            Some(Definition::Variable(_)) => "a variable",
            Some(Definition::Function(_)) => "a function",
            Some(Definition::Parameter(..)) => "a parameter",
            Some(Definition::Label(..)) => "a label",
            Some(Definition::Result(..)) => "a result",
            Some(Definition::InstructionSet(_)) => "an instruction set",
            Some(Definition::Other) => "no value",
        };
        match self.name(id) {
            Some(name) => format!("%{} ({what} `{name}`)", id.0),
            None => format!("%{} ({what})", id.0),
        }
    }

    /// The instruction at an offset, in words from the start of the module, as a disassembler
    /// writes it: `%12 (normal) = OpFMul vec3 %10 (direction) %11`. Constants are told by their
    /// values.
    #[doc(hidden)]
    pub fn describe_instruction(&self, offset: u32) -> String {
        let Some(instruction) = self.instruction_at(offset) else {
            let first = self.words.get(offset as usize).copied().unwrap_or(0);
            return Opcode::of_word(first).to_string();
        };
        let named = |id: Id| match (self.scalar_text(id), self.name(id)) {
            (Some(value), _) => value,
            (None, Some(name)) => format!("%{} ({name})", id.0),
            (None, None) => format!("%{}", id.0),
        };
        let mut text = match instruction.result {
            Some(id) => format!("{} = ", named(id)),
            None => String::new(),
        };
        text += &instruction.opcode.to_string();
        if let Some(ty) = instruction.result_type.and_then(|_| self.type_of(instruction.result?)) {
            text += " ";
            text += &self.describe_type(ty);
        }
        let mut ids = Vec::new();
        let operands = instruction.operands.start as usize..instruction.operands.end as usize;
        let literal_words = self.switch_literal_words(instruction);
        id_operands(&self.words, instruction.opcode, operands.clone(), literal_words, &mut |at| ids.push(at));
        let set = match instruction.opcode {
            Opcode::ExtInst => self.words.get(operands.start).and_then(|&id| match self.definition(Id(id)) {
                Some(Definition::InstructionSet(at)) => Some(&self.instruction_sets[at as usize]),
                _ => None,
            }),
            _ => None,
        };
        for at in operands.clone() {
            let word = self.words[at];
            text += " ";
            text += &match set {
                Some(set) if at == operands.start => set.to_string(),
                Some(set) if at == operands.start + 1 => ext_inst_name(set, word).into_owned(),
                _ if ids.contains(&at) => named(Id(word)),
                _ => word.to_string(),
            };
        }
        text
    }

    /// The value of a scalar constant.
    fn scalar_text(&self, id: Id) -> Option<String> {
        let bits = self.constant_scalar(id)?;
        let Some(Definition::Constant(index)) = self.definition(id) else { return None };
        Some(match *self.ty(self.constants[index as usize].ty) {
            Type::Bool => (bits != 0).to_string(),
            Type::Int { width: 32, signed: true } => (bits as u32).cast_signed().to_string(),
            Type::Int { signed: false, .. } => bits.to_string(),
            Type::Float { width: 32, encoding: None } => format!("{:?}", f32::from_bits(bits as u32)),
            Type::Float { width: 64, encoding: None } => format!("{:?}", f64::from_bits(bits)),
            _ => return None,
        })
    }

    /// Describes a type in GLSL's notation: `vec3`, `float[2]`, `struct Payload`.
    #[doc(hidden)]
    pub fn describe_type(&self, ty: TypeId) -> String {
        let mut text = String::new();
        self.write_type(ty, 4, &mut text);
        text
    }

    /// Appends the description of a type; `pointers` bounds how many pointers are followed, as they
    /// may form a cycle.
    fn write_type(&self, ty: TypeId, pointers: u32, out: &mut String) {
        match self.ty(ty) {
            Type::Void => out.push_str("void"),
            Type::Bool => out.push_str("bool"),
            Type::Int { width, signed } => out.push_str(&int_name(*width, *signed)),
            ty @ Type::Float { .. } => out.push_str(float_names(ty)[0]),
            Type::Vector { component, .. } if self.cooperative_matrix(ty).is_some() => {
                out.push_str("coopmat<");
                self.write_type(*component, pointers, out);
                if let Some(matrix) = self.cooperative_matrix(ty) {
                    let [rows, columns] =
                        [matrix.rows, matrix.columns].map(|id| self.scalar_value(id).unwrap_or(0));
                    out.push_str(&format!(", {rows}, {columns}"));
                }
                out.push('>');
            }
            Type::Vector { component, count } if self.is_cooperative_vector(ty) => {
                out.push_str("coopvecNV<");
                self.write_type(*component, pointers, out);
                out.push_str(&format!(", {count}>"));
            }
            Type::Vector { component, count } => {
                match self.ty(*component) {
                    Type::Bool => out.push('b'),
                    Type::Int { width: 32, signed: true } => out.push('i'),
                    Type::Int { width: 32, signed: false } => out.push('u'),
                    Type::Int { width, signed } => {
                        out.push_str(if *signed { "i" } else { "u" });
                        out.push_str(&width.to_string());
                    }
                    ty @ Type::Float { .. } => out.push_str(float_names(ty)[1]),
                    _ => {
                        self.write_type(*component, pointers, out);
                        out.push_str(" vector of ");
                        out.push_str(&count.to_string());
                        return;
                    }
                }
                out.push_str("vec");
                out.push_str(&count.to_string());
            }
            Type::Matrix { column, count } => {
                let (component, rows) = match self.ty(*column) {
                    Type::Vector { component, count } => (self.ty(*component), *count),
                    _ => (&Type::Void, 0),
                };
                if let Type::Float { .. } = component {
                    out.push_str(float_names(component)[1]);
                }
                out.push_str("mat");
                out.push_str(&count.to_string());
                if *count != rows {
                    out.push_str(&format!("x{rows}"));
                }
            }
            Type::Array { .. } | Type::RuntimeArray { .. } => {
                // The outermost array's length is first, as in GLSL.
                let mut lengths = String::new();
                let mut inner = ty;
                loop {
                    match self.ty(inner) {
                        Type::Array { element, length, .. } => {
                            match self.constant_scalar(*length) {
                                Some(length) => lengths.push_str(&format!("[{length}]")),
                                None => match self.name(*length) {
                                    Some(name) => lengths.push_str(&format!("[{name}]")),
                                    None => lengths.push_str(&format!("[%{}]", length.0)),
                                },
                            }
                            inner = *element;
                        }
                        Type::RuntimeArray { element, .. } => {
                            lengths.push_str("[]");
                            inner = *element;
                        }
                        _ => break,
                    }
                }
                self.write_type(inner, pointers, out);
                out.push_str(&lengths);
            }
            Type::Struct { .. } => match self.id_of_type(ty) {
                Some(id) => match self.name(id) {
                    Some(name) => out.push_str(&format!("struct {name}")),
                    None => out.push_str(&format!("struct %{}", id.0)),
                },
                None => out.push_str("struct"),
            },
            Type::Pointer { storage_class, pointee, .. } => {
                out.push_str("pointer to ");
                out.push_str(&storage_class_name(*storage_class));
                if let Some(pointee) = pointee {
                    out.push(' ');
                    if pointers == 0 {
                        out.push_str("...");
                    } else {
                        self.write_type(*pointee, pointers - 1, out);
                    }
                }
            }
            Type::Function { return_type, parameters } => {
                out.push_str("function of ");
                out.push_str(&parameters.len().to_string());
                out.push_str(" parameters returning ");
                if pointers == 0 {
                    out.push_str("...");
                } else {
                    self.write_type(*return_type, pointers - 1, out);
                }
            }
            Type::Image(_) => out.push_str("image"),
            Type::Sampler => out.push_str("sampler"),
            Type::SampledImage(_) => out.push_str("sampled image"),
            Type::AccelerationStructure => out.push_str("accelerationStructureEXT"),
            Type::Buffer { .. } => out.push_str("buffer"),
            Type::RayQuery => out.push_str("rayQueryEXT"),
            Type::HitObject { ext: true } => out.push_str("hitObjectEXT"),
            Type::HitObject { ext: false } => out.push_str("hitObjectNV"),
            Type::Other(opcode) => out.push_str(&opcode.to_string()),
        }
    }
}

fn int_name(width: u32, signed: bool) -> String {
    let base = if signed { "int" } else { "uint" };
    if width == 32 { base.to_owned() } else { format!("{base}{width}_t") }
}

/// The names of a float and, before `vec` and `mat`, of its vectors and matrices: GLSL's own, and
/// those of `GL_EXT_bfloat16`, `GL_EXT_float_e4m3` and `GL_EXT_float_e5m2`.
fn float_names(ty: &Type) -> [&'static str; 2] {
    match ty.float_format() {
        Some(FloatFormat::Binary16) => ["float16_t", "f16"],
        Some(FloatFormat::Binary32) | None => ["float", ""],
        Some(FloatFormat::Binary64) => ["double", "d"],
        Some(FloatFormat::BFloat16) => ["bfloat16_t", "bf16"],
        Some(FloatFormat::E4M3) => ["floate4m3_t", "fe4m3"],
        Some(FloatFormat::E5M2) => ["floate5m2_t", "fe5m2"],
    }
}

#[cfg(test)]
mod tests {
    use crate::module::Opcode;
    use pretty_assertions::assert_eq;

    use crate::module::Id;
    use crate::module::assemble::Assembler;

    #[test]
    fn types_are_described_in_the_notation_of_glsl() {
        let mut a = Assembler::new();
        a.with_string(Opcode::Name, &[30], "Payload", &[]);
        a.types();
        a.op(Opcode::TypeFloat, &[10, 64]);
        a.op(Opcode::TypeVector, &[11, 10, 2]);
        a.op(Opcode::TypeVector, &[12, 3, 4]);
        a.op(Opcode::TypeVector, &[13, 5, 3]);
        a.op(Opcode::TypeMatrix, &[14, 7, 4]);
        a.op(Opcode::TypeMatrix, &[15, 7, 3]);
        a.op(Opcode::SpecConstant, &[5, 16, 2]);
        a.op(Opcode::TypeArray, &[17, 6, 8]);
        a.op(Opcode::TypeArray, &[18, 17, 16]);
        a.op(Opcode::TypeRuntimeArray, &[19, 18]);
        a.op(Opcode::TypeStruct, &[30, 6]);
        a.op(Opcode::TypeStruct, &[31, 6]);
        a.op(Opcode::TypePointer, &[32, 12, 30]);
        a.op(Opcode::TypeInt, &[33, 16, 0]);
        a.op(Opcode::TypeAccelerationStructureKHR, &[34]);
        a.op(Opcode::TypeFloat, &[35, 16, 0]);
        a.op(Opcode::TypeVector, &[36, 35, 3]);
        a.op(Opcode::TypeFloat, &[37, 8, 4214]);
        a.op(Opcode::TypeFloat, &[38, 8, 4215]);
        a.op(Opcode::TypeVector, &[39, 38, 2]);
        let module = a.loaded();
        let described = [11, 12, 13, 14, 15, 18, 19, 30, 31, 32, 33, 34, 35, 36, 37, 39]
            .map(|id| module.describe_type(module.type_with_id(Id(id)).unwrap()));
        assert_eq!(
            described,
            [
                "dvec2",
                "bvec4",
                "uvec3",
                "mat4x3",
                "mat3",
                "float[%16][3]",
                "float[][%16][3]",
                "struct Payload",
                "struct %31",
                "pointer to StorageBuffer struct Payload",
                "uint16_t",
                "accelerationStructureEXT",
                "bfloat16_t",
                "bf16vec3",
                "floate4m3_t",
                "fe5m2vec2",
            ]
        );
        assert_eq!(module.describe_id(Id(8)), "%8 (a constant)");
        assert_eq!(module.describe_id(Id(30)), "%30 (the type struct Payload)");
        assert_eq!(module.describe_id(Id(99)), "%99, which is not defined");
    }

    #[test]
    fn a_cycle_of_pointers_has_a_finite_description() {
        let mut a = Assembler::new();
        a.op(Opcode::TypeForwardPointer, &[1, 5349]);
        a.op(Opcode::TypePointer, &[1, 5349, 1]);
        let module = a.loaded();
        let described = module.describe_type(module.type_with_id(Id(1)).unwrap());
        assert!(described.ends_with("pointer to PhysicalStorageBuffer ..."), "{described}");
    }
}
