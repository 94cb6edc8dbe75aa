//! Which types the operands of an instruction may have (SPIR-V 3.3 and `GLSL.std.450`, section 2,
//! as spirv-val reads them): checked before an instruction is translated, so that its translation
//! may rely on them.
//!
//! Types that are opaque to this crate, and floats of another encoding, are left to the
//! translation.

mod rays;
mod rules;

use std::borrow::Cow;

use crate::module::names::ext_inst_name;
use crate::module::ty::{CooperativeMatrix, Type, TypeId};
use crate::module::{Definition, Id, Instruction, Module, Opcode};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

use rays::ray;
pub use rules::{OperandTypeRule, core, glsl};

/// Sets of scalar types.
pub mod kinds {
    /// `OpTypeBool`
    pub const BOOL: u32 = 1;
    /// `OpTypeInt` with a sign.
    pub const SINT: u32 = 2;
    /// `OpTypeInt` without a sign.
    pub const UINT: u32 = 4;
    /// `OpTypeFloat`
    pub const FLOAT: u32 = 8;
    /// `OpTypeInt`
    pub const INT: u32 = SINT | UINT;
    /// Integers and floats.
    pub const NUMBER: u32 = INT | FLOAT;
    /// Any scalar.
    pub const SCALAR: u32 = NUMBER | BOOL;
}

/// A constraint on the type of a position. Positions count from the result, 0; the first operand is
/// 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TypeConstraint {
    /// Anything, or a literal.
    Any,
    /// A scalar or vector of these kinds.
    OfKind(u32),
    /// A scalar of these kinds.
    Scalar(u32),
    /// A vector of these kinds.
    Vector(u32),
    /// A scalar or vector of these kinds and so many bits.
    Bits(u32, u32),
    /// A scalar of these kinds and so many bits.
    ScalarBits(u32, u32),
    /// A vector of so many components of these kinds and so many bits: kinds, bits, components.
    VectorBits(u32, u32, u32),
    /// The type of a position.
    SameAs(usize),
    /// Of these kinds, with the components and bits of a position.
    SameShape(u32, usize),
    /// Of these kinds, with as many components as a position.
    SameCount(u32, usize),
    /// Of these kinds, with as many components as a position, but with other bits.
    OtherWidth(u32, usize),
    /// The component type of a position, which is a vector or matrix.
    ComponentOf(usize),
    /// A vector with components of the type of a position.
    VectorOf(usize),
    /// A scalar or vector with components of the type of a position.
    ScalarOrVectorOf(usize),
    /// A struct of two members of one type, of these kinds.
    Pair(u32),
    /// The type of the first member of a position, which is a struct.
    MemberOf(usize),
    /// A pointer to the type of a position.
    PointerTo(usize),
    /// What a position points to.
    Pointee(usize),
    /// Scalar conditions for any composite, or one for each component of the position.
    Condition(usize),
}

/// A scalar type as rules see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Scalar {
    kind: u32,
    width: u32,
}

/// A scalar (`vector` is false, `count` 1) or vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Numeric {
    scalar: Scalar,
    component: TypeId,
    count: u32,
    vector: bool,
}

/// Rejects an instruction whose result or operands have types that it is not defined for.
///
/// # Errors
/// `InvalidModule`
pub fn check(translator: &Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let operands = translator.operands(instruction);
    let (rule, operands, name) = match (opcode, operands) {
        (Opcode::ExtInst, &[set, number, ref operands @ ..]) => {
            let Some(Definition::InstructionSet(at)) = translator.module.definition(Id(set)) else {
                return Ok(());
            };
            let set = translator.module.instruction_sets[at as usize].as_str();
            if set != "GLSL.std.450" {
                return Ok(());
            }
            let Some(rule) = glsl(number) else { return Ok(()) };
            let name = InstructionName::Extended { set, number };
            if operands.len() != rule.operands.len() {
                let (name, count) = (name.text(), rule.operands.len());
                return Err(
                    translator.invalid(format!("{name} requires {count} operands, not {}", operands.len()))
                );
            }
            (rule, operands, name)
        }
        _ => {
            let Some(rule) = core(opcode).or_else(|| ray(opcode)) else { return Ok(()) };
            (rule, operands, InstructionName::Opcode(opcode))
        }
    };
    check_cooperative(translator, instruction, operands, name)?;
    let mut checker = PositionChecker { translator, name, types: [None; MAX_POSITIONS], count: 0 };
    if rule.result != TypeConstraint::Any {
        let ty = translator.result_type(instruction)?;
        checker.position(rule.result, ty)?;
    } else {
        checker.types[0] = instruction.result_type.and_then(|id| translator.module.type_with_id(id));
        checker.count = 1;
    }
    for (&constraint, &operand) in rule.operands.iter().zip(operands) {
        match constraint {
            TypeConstraint::Any => {
                checker.push(translator.module.type_of(Id(operand)));
            }
            _ => {
                let ty = translator.type_of(Id(operand))?;
                checker.position(constraint, ty)?;
            }
        }
    }
    Ok(())
}

/// Rejects cooperative vectors and matrices in instructions that take other vectors only, and
/// conversions between matrices of different shapes.
fn check_cooperative(
    translator: &Translator<'_>,
    instruction: &Instruction,
    operands: &[u32],
    name: InstructionName<'_>,
) -> Result<()> {
    let module = translator.module;
    if module.vector_counts.is_empty() && module.cooperative_matrices.is_empty() {
        return Ok(());
    }
    let number = name.number();
    let result = instruction.result_type.and_then(|id| module.type_with_id(id));
    for ty in operands.iter().filter_map(|&id| module.type_of(Id(id))).chain(result) {
        let refused = |what: &str, extension: &str| {
            let (name, ty) = (name.text(), module.describe_type(ty));
            let message = format!("{name} is not defined for cooperative {what}, such as {ty}");
            Err(translator.invalid(message).note(extension.to_owned()))
        };
        if module.is_cooperative_vector(ty) && !rules::takes_cooperative_vectors(number) {
            return refused("vectors", "SPV_NV_cooperative_vector");
        }
        let Some(matrix) = module.cooperative_matrix(ty) else { continue };
        if !rules::takes_cooperative_matrices(number) {
            return refused("matrices", "SPV_KHR_cooperative_matrix");
        }
        // SPV_NV_cooperative_matrix2 converts between uses, too.
        let converts_use = module.capabilities.contains(&CONVERSIONS);
        let shape = |matrix: &CooperativeMatrix| {
            let CooperativeMatrix { scope, rows, columns, usage, .. } = *matrix;
            [scope, rows, columns, if converts_use { scope } else { usage }].map(|id| module.scalar_value(id))
        };
        // The result of a composite's part is no matrix.
        if let Some(own) = result.filter(|&own| own != ty)
            && module.cooperative_matrix(own).is_none_or(|own| shape(own) != shape(matrix))
        {
            let (name, own, ty) = (name.text(), module.describe_type(own), module.describe_type(ty));
            let message = format!("{name} from {ty} to {own}, which differ in scope, shape or use");
            return Err(translator.invalid(message).note("SPV_KHR_cooperative_matrix, 3.42.11"));
        }
    }
    Ok(())
}

/// `CooperativeMatrixConversionsNV`
const CONVERSIONS: u32 = 5431;

/// Section of a specification about the operands of an instruction.
fn section_of(name: InstructionName<'_>) -> String {
    let text = name.text();
    match name {
        InstructionName::Extended { .. } => format!("GLSL.std.450, {text}"),
        InstructionName::Opcode(opcode) => match opcode.extensions() {
            [] => format!("SPIR-V, 3.3, {text}"),
            extensions => format!("{}, {text}", extensions.join(", ")),
        },
    }
}

/// The name of an instruction, which only errors need.
#[derive(Clone, Copy)]
enum InstructionName<'m> {
    Opcode(Opcode),
    Extended { set: &'m str, number: u32 },
}

impl InstructionName<'_> {
    /// The opcode, or the number in `GLSL.std.450`.
    fn number(self) -> rules::Numbered {
        match self {
            Self::Opcode(opcode) => rules::Numbered::Core(opcode),
            Self::Extended { number, .. } => rules::Numbered::Glsl(number),
        }
    }

    fn text(self) -> Cow<'static, str> {
        match self {
            Self::Opcode(opcode) => opcode.to_string().into(),
            Self::Extended { set, number } => ext_inst_name(set, number),
        }
    }
}

/// The most positions that a rule has.
const MAX_POSITIONS: usize = 12;

/// The positions so far of an instruction that is checked.
struct PositionChecker<'a, 'm> {
    translator: &'a Translator<'m>,
    name: InstructionName<'m>,
    types: [Option<TypeId>; MAX_POSITIONS],
    count: usize,
}

impl PositionChecker<'_, '_> {
    fn push(&mut self, ty: Option<TypeId>) {
        if let Some(slot) = self.types.get_mut(self.count) {
            *slot = ty;
        }
        self.count += 1;
    }

    fn position(&mut self, constraint: TypeConstraint, ty: TypeId) -> Result<()> {
        let at = self.count;
        self.push(Some(ty));
        if self.satisfies(constraint, ty) {
            return Ok(());
        }
        let module = self.translator.module;
        let found = module.describe_type(ty);
        let name = self.name.text();
        let needed = self.describe(constraint);
        let which = if at == 0 { "the result".to_owned() } else { format!("operand {at}") };
        let message = format!("{which} of {name} is of type {found} instead of {needed}");
        Err(self.translator.invalid(message).note(section_of(self.name)))
    }

    /// Whether a type satisfies a constraint; unchecked types satisfy all.
    fn satisfies(&self, constraint: TypeConstraint, ty: TypeId) -> bool {
        let module = self.translator.module;
        if is_unchecked(module, ty) {
            return true;
        }
        let other = |at: usize| self.types.get(at).copied().flatten();
        // A position of an unchecked type constrains no other one.
        let unknown = |at: usize| other(at).is_none_or(|ty| is_unchecked(module, ty));
        let own = numeric(module, ty);
        let of = |kinds: u32| own.filter(|own| own.scalar.kind & kinds != 0);
        match constraint {
            TypeConstraint::Any => true,
            TypeConstraint::OfKind(kinds) => of(kinds).is_some(),
            TypeConstraint::Scalar(kinds) => of(kinds).is_some_and(|own| !own.vector),
            TypeConstraint::Vector(kinds) => of(kinds).is_some_and(|own| own.vector),
            TypeConstraint::Bits(kinds, bits) => of(kinds).is_some_and(|own| own.scalar.width == bits),
            TypeConstraint::ScalarBits(kinds, bits) => {
                of(kinds).is_some_and(|own| !own.vector && own.scalar.width == bits)
            }
            TypeConstraint::VectorBits(kinds, bits, count) => {
                of(kinds).is_some_and(|own| own.vector && own.scalar.width == bits && own.count == count)
            }
            TypeConstraint::SameAs(at) => unknown(at) || other(at) == Some(ty),
            TypeConstraint::SameShape(kinds, at) => {
                unknown(at)
                    || of(kinds).zip(self.numeric(at)).is_some_and(|(own, like)| {
                        own.scalar.width == like.scalar.width && own.count == like.count
                    })
            }
            TypeConstraint::SameCount(kinds, at) => {
                unknown(at)
                    || of(kinds).zip(self.numeric(at)).is_some_and(|(own, like)| own.count == like.count)
            }
            TypeConstraint::OtherWidth(kinds, at) => {
                unknown(at)
                    || of(kinds).zip(self.numeric(at)).is_some_and(|(own, like)| {
                        own.scalar.width != like.scalar.width && own.count == like.count
                    })
            }
            TypeConstraint::ComponentOf(at) => {
                unknown(at) || other(at).and_then(|other| component(module, other)) == Some(ty)
            }
            TypeConstraint::VectorOf(at) => {
                unknown(at) || own.is_some_and(|own| own.vector && Some(own.component) == other(at))
            }
            TypeConstraint::ScalarOrVectorOf(at) => {
                unknown(at) || own.is_some_and(|own| Some(own.component) == other(at))
            }
            TypeConstraint::Pair(kinds) => match module.ty(ty) {
                Type::Struct { members, .. } => match members[..] {
                    [ref a, ref b] => {
                        a.ty == b.ty
                            && (is_unchecked(module, a.ty)
                                || numeric(module, a.ty).is_some_and(|own| own.scalar.kind & kinds != 0))
                    }
                    _ => false,
                },
                _ => false,
            },
            TypeConstraint::MemberOf(at) => {
                unknown(at) || other(at).and_then(|other| member(module, other)) == Some(ty)
            }
            TypeConstraint::PointerTo(at) => match *module.ty(ty) {
                Type::Pointer { pointee, .. } => {
                    unknown(at) || pointee.is_none_or(|ty| Some(ty) == other(at))
                }
                _ => false,
            },
            TypeConstraint::Pointee(at) => match other(at).map(|pointer| module.ty(pointer)) {
                Some(&Type::Pointer { pointee: Some(pointee), .. }) => ty == pointee,
                _ => true,
            },
            TypeConstraint::Condition(at) => of(kinds::BOOL).is_some_and(|own| {
                let of_each = |like: Numeric| like.vector && like.count == own.count;
                !own.vector || unknown(at) || self.numeric(at).is_some_and(of_each)
            }),
        }
    }

    fn numeric(&self, at: usize) -> Option<Numeric> {
        numeric(self.translator.module, self.types.get(at).copied().flatten()?)
    }

    /// A description of a constraint, for messages.
    fn describe(&self, constraint: TypeConstraint) -> String {
        let module = self.translator.module;
        let name = |at: usize| {
            let ty = self.types.get(at).copied().flatten();
            let ty = ty.map_or_else(|| "unknown".to_owned(), |ty| module.describe_type(ty));
            match at {
                0 => format!("the result ({ty})"),
                _ => format!("operand {at} ({ty})"),
            }
        };
        match constraint {
            TypeConstraint::Any => "anything".to_owned(),
            TypeConstraint::OfKind(kinds) => format!("{} scalar or vector", kind_name(kinds)),
            TypeConstraint::Scalar(kinds) => format!("{} scalar", kind_name(kinds)),
            TypeConstraint::Vector(kinds) => format!("{} vector", kind_name(kinds)),
            TypeConstraint::Bits(kinds, bits) => {
                format!("{} scalar or vector of {bits} bits", kind_name(kinds))
            }
            TypeConstraint::ScalarBits(kinds, bits) => format!("{} scalar of {bits} bits", kind_name(kinds)),
            TypeConstraint::VectorBits(kinds, bits, count) => {
                format!("{} vector of {count} components of {bits} bits", kind_name(kinds))
            }
            TypeConstraint::SameAs(at) => format!("the type of {}", name(at)),
            TypeConstraint::SameShape(kinds, at) => {
                format!("{} scalar or vector with the components and bits of {}", kind_name(kinds), name(at))
            }
            TypeConstraint::SameCount(kinds, at) => {
                format!("{} scalar or vector with as many components as {}", kind_name(kinds), name(at))
            }
            TypeConstraint::OtherWidth(kinds, at) => {
                format!(
                    "{} scalar or vector with other bits than {} and as many components",
                    kind_name(kinds),
                    name(at)
                )
            }
            TypeConstraint::ComponentOf(at) => format!("the component type of {}", name(at)),
            TypeConstraint::VectorOf(at) => format!("a vector with components of the type of {}", name(at)),
            TypeConstraint::ScalarOrVectorOf(at) => {
                format!("a scalar or vector with components of the type of {}", name(at))
            }
            TypeConstraint::Pair(kinds) => {
                format!("a struct of two members of one type, {} scalar or vector", kind_name(kinds))
            }
            TypeConstraint::MemberOf(at) => format!("the type of the members of {}", name(at)),
            TypeConstraint::PointerTo(at) => format!("a pointer to the type of {}", name(at)),
            TypeConstraint::Pointee(at) => format!("the type that {} points to", name(at)),
            TypeConstraint::Condition(at) => format!("a bool, or a bool for each component of {}", name(at)),
        }
    }
}

fn kind_name(set: u32) -> &'static str {
    match set {
        kinds::BOOL => "a bool",
        kinds::SINT => "a signed integer",
        kinds::UINT => "an unsigned integer",
        kinds::FLOAT => "a float",
        kinds::INT => "an integer",
        kinds::NUMBER => "a number",
        _ => "any",
    }
}

/// Whether rules do not check a type: opaque types, floats of another encoding, and vectors of
/// them.
fn is_unchecked(module: &Module, ty: TypeId) -> bool {
    match *module.ty(ty) {
        Type::Other(_) | Type::Float { encoding: Some(_), .. } => true,
        Type::Vector { component, .. } => is_unchecked(module, component),
        _ => false,
    }
}

/// A scalar or vector.
fn numeric(module: &Module, ty: TypeId) -> Option<Numeric> {
    let (component, count, vector) = match *module.ty(ty) {
        Type::Vector { component, count } => (component, count, true),
        _ => (ty, 1, false),
    };
    let scalar = match *module.ty(component) {
        Type::Bool => Scalar { kind: kinds::BOOL, width: 0 },
        Type::Int { width, signed } => Scalar { kind: if signed { kinds::SINT } else { kinds::UINT }, width },
        Type::Float { width, .. } => Scalar { kind: kinds::FLOAT, width },
        _ => return None,
    };
    Some(Numeric { scalar, component, count, vector })
}

/// The type of the scalars of a vector or matrix.
fn component(module: &Module, ty: TypeId) -> Option<TypeId> {
    match *module.ty(ty) {
        Type::Vector { component, .. } => Some(component),
        Type::Matrix { column, .. } => self::component(module, column),
        _ => None,
    }
}

/// The type of a struct's first member.
fn member(module: &Module, ty: TypeId) -> Option<TypeId> {
    match module.ty(ty) {
        Type::Struct { members, .. } => members.first().map(|member| member.ty),
        _ => None,
    }
}
