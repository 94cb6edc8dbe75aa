//! The arena of types.

use crate::module::names::{opcode_name, storage_class_name};
use crate::module::{Id, Module};

/// A handle of a type: an index into [`Module::types`](crate::module::Module::types).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TypeId(pub u32);

/// A type. Decorations that shape memory (offsets, strides, matrix layout) are folded in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Type {
    Void,
    Bool,
    /// Width in bits: 8, 16, 32 or 64.
    Int {
        width: u32,
        signed: bool,
    },
    /// Width in bits: 16, 32 or 64; `encoding` is the optional operand (bfloat16, ...).
    Float {
        width: u32,
        encoding: Option<u32>,
    },
    Vector {
        component: TypeId,
        count: u32,
    },
    /// `column` is a vector.
    Matrix {
        column: TypeId,
        count: u32,
    },
    /// `length` is the id of a constant: a specialization may change it. `stride` in bytes.
    Array {
        element: TypeId,
        length: Id,
        stride: Option<u32>,
    },
    RuntimeArray {
        element: TypeId,
        stride: Option<u32>,
    },
    Struct {
        members: Vec<Member>,
        /// Decorated `Block` or `BufferBlock`.
        block: bool,
        /// Decorated `BufferBlock`.
        buffer_block: bool,
    },
    Pointer {
        storage_class: u32,
        /// `None` between `OpTypeForwardPointer` and its definition, and for untyped pointers.
        pointee: Option<TypeId>,
        /// `ArrayStride` of the pointer type, in bytes (`OpPtrAccessChain`).
        stride: Option<u32>,
    },
    Function {
        return_type: TypeId,
        parameters: Vec<TypeId>,
    },
    Image(ImageType),
    Sampler,
    /// The image type.
    SampledImage(TypeId),
    AccelerationStructure,
    RayQuery,
    /// `OpTypeHitObjectNV` (`ext` false) or `OpTypeHitObjectEXT`.
    HitObject {
        ext: bool,
    },
    /// A type that this crate carries without knowing: opcode's number.
    Other(u16),
}

/// The operands of `OpTypeImage`, numbers as in the specification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageType {
    pub sampled_type: TypeId,
    /// `Dim`.
    pub dim: u32,
    /// 0 no depth, 1 depth, 2 unknown.
    pub depth: u32,
    pub arrayed: bool,
    pub multisampled: bool,
    /// 0 unknown, 1 sampled, 2 storage.
    pub sampled: u32,
    /// `Image Format`; 0 is unknown.
    pub format: u32,
}

/// A member of a struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    pub ty: TypeId,
    /// `OpMemberName`, or empty.
    pub name: String,
    /// `Offset` in bytes, where decorated.
    pub offset: Option<u32>,
    /// `MatrixStride` in bytes and `RowMajor`, where decorated.
    pub matrix: Option<MatrixLayout>,
    /// The `BuiltIn` number, where decorated.
    pub builtin: Option<u32>,
}

/// How a matrix (or an array of matrices) in a struct lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MatrixLayout {
    /// Bytes between columns (or rows, where row-major).
    pub stride: u32,
    pub row_major: bool,
}

impl Module {
    /// A type in GLSL's words, for people: `vec3`, `float[2]`, `struct Payload`.
    pub fn describe_type(&self, ty: TypeId) -> String {
        let mut text = String::new();
        self.write_type(ty, 4, &mut text);
        text
    }

    /// `pointers` bounds how many pointers are followed: they may lead round in a circle.
    fn write_type(&self, ty: TypeId, pointers: u32, out: &mut String) {
        match self.ty(ty) {
            Type::Void => out.push_str("void"),
            Type::Bool => out.push_str("bool"),
            Type::Int { width, signed } => out.push_str(&int_name(*width, *signed)),
            Type::Float { width, encoding } => out.push_str(&float_name(*width, *encoding)),
            Type::Vector { component, count } => {
                match self.ty(*component) {
                    Type::Bool => out.push('b'),
                    Type::Int { width: 32, signed: true } => out.push('i'),
                    Type::Int { width: 32, signed: false } => out.push('u'),
                    Type::Int { width, signed } => {
                        out.push_str(if *signed { "i" } else { "u" });
                        out.push_str(&width.to_string());
                    }
                    Type::Float { width: 32, encoding: None } => {}
                    Type::Float { width: 64, encoding: None } => out.push('d'),
                    Type::Float { width: 16, encoding: None } => out.push_str("f16"),
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
                match component {
                    Type::Float { width: 64, .. } => out.push('d'),
                    Type::Float { width: 16, .. } => out.push_str("f16"),
                    _ => {}
                }
                out.push_str("mat");
                out.push_str(&count.to_string());
                if *count != rows {
                    out.push_str(&format!("x{rows}"));
                }
            }
            Type::Array { .. } | Type::RuntimeArray { .. } => {
                // The outermost array's length stands first, as GLSL writes it.
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
            Type::RayQuery => out.push_str("rayQueryEXT"),
            Type::HitObject { ext: true } => out.push_str("hitObjectEXT"),
            Type::HitObject { ext: false } => out.push_str("hitObjectNV"),
            Type::Other(opcode) => out.push_str(&opcode_name(*opcode)),
        }
    }

    /// The id that declares a type.
    pub fn id_of_type(&self, ty: TypeId) -> Option<Id> {
        self.type_ids.get(ty.0 as usize).copied()
    }
}

fn int_name(width: u32, signed: bool) -> String {
    let base = if signed { "int" } else { "uint" };
    if width == 32 { base.to_owned() } else { format!("{base}{width}_t") }
}

fn float_name(width: u32, encoding: Option<u32>) -> String {
    match (width, encoding) {
        (32, None) => "float".to_owned(),
        (64, None) => "double".to_owned(),
        (16, Some(0)) => "bfloat16_t".to_owned(),
        (width, None) => format!("float{width}_t"),
        (width, Some(encoding)) => format!("float{width}_t of encoding {encoding}"),
    }
}
