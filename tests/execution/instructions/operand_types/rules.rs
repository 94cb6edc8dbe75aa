//! The table: for each instruction, which types its result and its operands may have, from the
//! sections of the specification that are named after it.
//!
//! A line is `names | result | operands`. A type is a set of scalar types and a shape:
//!
//! ```text
//! int    a scalar or vector             int.   a scalar              int:   a vector
//! =0     the type of position 0 (the result; operands count from 1)
//! int~0  with the components and bits of position 0, of any sign
//! int#0  with the components of position 0, of any bits
//! int!0  the same, but of other bits
//! ^0     a component of position 0      @0     a vector of position 0
//! ?0     position 0, or a vector of it  int:3  a vector of three
//! pair   (as a result) a struct of two members, each of the type behind it
//! ```

use crate::execution::instructions::operand_types::types::{KINDS, Kind, Ty};

/// SPIR-V's own instructions.
pub const CORE: &str = "
FNegate                                                | float      | =0
FAdd FSub FMul FDiv FRem FMod                          | float      | =0 =0
FmaKHR                                                 | float      | =0 =0 =0
SNegate Not                                            | int        | int~0
IAdd ISub IMul SDiv SMod SRem                          | int        | int~0 int~0
BitwiseOr BitwiseXor BitwiseAnd                        | int        | int~0 int~0
UDiv UMod                                              | uint       | =0 =0
IAddCarry ISubBorrow UMulExtended                      | pair uint  | =0 =0
SMulExtended                                           | pair int   | =0 =0
Dot                                                    | float.     | @0 =1
VectorTimesScalar                                      | float:     | =0 ^0
ShiftRightLogical ShiftRightArithmetic ShiftLeftLogical | int       | int~0 int#0
BitFieldInsert                                         | int        | =0 =0 int. int.
BitFieldSExtract BitFieldUExtract                      | int        | =0 int. int.
BitReverse                                             | int        | =0
BitCount                                               | int        | int#0
Any All                                                | bool.      | bool:
IsNan IsInf                                            | bool       | float#0
FOrdEqual FUnordEqual FOrdNotEqual FUnordNotEqual      | bool       | float#0 =1
FOrdLessThan FUnordLessThan FOrdGreaterThan            | bool       | float#0 =1
FUnordGreaterThan FOrdLessThanEqual                    | bool       | float#0 =1
FUnordLessThanEqual FOrdGreaterThanEqual               | bool       | float#0 =1
FUnordGreaterThanEqual LessOrGreater Ordered Unordered | bool       | float#0 =1
LogicalEqual LogicalNotEqual LogicalOr LogicalAnd      | bool       | =0 =0
LogicalNot                                             | bool       | =0
IEqual INotEqual                                       | bool       | int#0 int~1
UGreaterThan UGreaterThanEqual ULessThan ULessThanEqual | bool      | int#0 int~1
SGreaterThan SGreaterThanEqual SLessThan SLessThanEqual | bool      | int#0 int~1
Select                                                 | any        | cond0 =0 =0
ConvertFToU                                            | uint       | float#0
ConvertFToS                                            | int        | float#0
ConvertSToF ConvertUToF                                | float      | int#0
UConvert                                               | uint       | int!0
SConvert                                               | int        | int!0
FConvert                                               | float      | float!0
QuantizeToF16                                          | f32        | =0
CopyObject FreezeKHR                                   | any        | =0
VectorExtractDynamic                                   | any.       | @0 int.
VectorInsertDynamic                                    | any:       | =0 ^0 int.
ExpectKHR                                              | intbool    | =0 =0
UCountLeadingZerosINTEL UCountTrailingZerosINTEL       | int        | int~0
AbsISubINTEL AbsUSubINTEL IAddSatINTEL UAddSatINTEL    | int        | int~0 int~0
ISubSatINTEL USubSatINTEL IAverageINTEL UAverageINTEL  | int        | int~0 int~0
IAverageRoundedINTEL UAverageRoundedINTEL              | int        | int~0 int~0
IMul32x16INTEL UMul32x16INTEL                          | i32        | int~0 int~0
";

/// Those of `GLSL.std.450`, section 2. The elementary functions are for f16 and f32; that this
/// crate has them in f64 too is an addition.
pub const GLSL: &str = "
Round RoundEven Trunc FAbs FSign Floor Ceil Fract      | float      | =0
Radians Degrees Sin Cos Tan Asin Acos Atan             | short      | =0
Sinh Cosh Tanh Asinh Acosh Atanh Exp Log Exp2 Log2     | short      | =0
Sqrt InverseSqrt Normalize                             | float      | =0
Atan2 Pow                                              | short      | =0 =0
FMin FMax NMin NMax Step Reflect                       | float      | =0 =0
FClamp NClamp FMix SmoothStep Fma FaceForward          | float      | =0 =0 =0
SAbs SSign                                             | int        | int~0
UMin SMin UMax SMax                                    | int        | int~0 int~0
UClamp SClamp                                          | int        | int~0 int~0 int~0
Ldexp                                                  | float      | =0 int#0
FindILsb FindSMsb FindUMsb                             | i32        | int~0
Length                                                 | float.     | ?0
Distance                                               | float.     | ?0 =1
Cross                                                  | float:3    | =0 =0
Refract                                                | float      | =0 =0 float.
ModfStruct                                             | pair float | =0
PackSnorm4x8 PackUnorm4x8                              | i32.       | f32:4
PackSnorm2x16 PackUnorm2x16 PackHalf2x16               | i32.       | f32:2
PackDouble2x32                                         | f64.       | i32:2
UnpackSnorm4x8 UnpackUnorm4x8                          | f32:4      | i32.
UnpackSnorm2x16 UnpackUnorm2x16 UnpackHalf2x16         | f32:2      | i32.
UnpackDouble2x32                                       | i32:2      | f64.
";

/// Subgroup instructions, behind whose result stand a scope and (of the arithmetic ones) what is
/// done.
pub const GROUP: &str = "
GroupNonUniformAll GroupNonUniformAny                  | bool.      | bool.
GroupNonUniformAllEqual                                | bool.      | any
GroupNonUniformBroadcastFirst                          | any        | =0
GroupNonUniformShuffle GroupNonUniformShuffleXor       | any        | =0 uint.
GroupNonUniformIAdd GroupNonUniformIMul                | int        | =0
GroupNonUniformSMin GroupNonUniformSMax                | int        | =0
GroupNonUniformUMin GroupNonUniformUMax                | uint       | =0
GroupNonUniformFAdd GroupNonUniformFMul                | float      | =0
GroupNonUniformFMin GroupNonUniformFMax                | float      | =0
GroupNonUniformBitwiseAnd GroupNonUniformBitwiseOr     | int        | =0
GroupNonUniformBitwiseXor                              | int        | =0
GroupNonUniformLogicalAnd GroupNonUniformLogicalOr     | bool       | =0
GroupNonUniformLogicalXor                              | bool       | =0
";

/// A line of the table.
pub struct Rule {
    pub name: &'static str,
    /// Whether the result is a struct of two of the type of position 0.
    pub pair: bool,
    /// The result, then the operands.
    positions: Vec<Position>,
}

struct Position {
    kinds: Vec<Kind>,
    shape: Shape,
}

#[derive(Clone, Copy)]
enum Shape {
    Free,
    Scalar,
    Vector,
    VectorOf(usize),
    Same(usize),
    Like(usize),
    Count(usize),
    Other(usize),
    Component(usize),
    Of(usize),
    Parts(usize),
    Condition(usize),
}

/// The rules of a table.
pub fn parse(table: &'static str) -> Vec<Rule> {
    let mut rules = Vec::new();
    for line in table.lines().filter(|line| !line.is_empty()) {
        let [names, result, operands] = line.split('|').collect::<Vec<_>>()[..] else {
            panic!("three columns: {line}")
        };
        let (pair, result) = match result.trim().strip_prefix("pair") {
            Some(member) => (true, member.trim()),
            None => (false, result.trim()),
        };
        for name in names.split_whitespace() {
            let positions = [result].into_iter().chain(operands.split_whitespace()).map(position).collect();
            rules.push(Rule { name, pair, positions });
        }
    }
    rules
}

fn position(text: &str) -> Position {
    let end = text.find(|letter: char| !letter.is_ascii_alphanumeric()).unwrap_or(text.len());
    let (kinds, rest) = text.split_at(end);
    if let Some(at) = kinds.strip_prefix("cond") {
        return Position { kinds: vec![Kind::Bool], shape: Shape::Condition(at.parse().unwrap()) };
    }
    let of = |holds: &dyn Fn(Kind) -> bool| KINDS.into_iter().filter(|&kind| holds(kind)).collect();
    let kinds = match kinds {
        "" | "any" => of(&|_| true),
        "bool" => of(&|kind| kind == Kind::Bool),
        "int" => of(&Kind::is_integer),
        "uint" => of(&|kind| kind.is_integer() && !kind.is_signed()),
        "intbool" => of(&|kind| !kind.is_float()),
        "i32" => of(&|kind| kind.is_integer() && kind.bits() == 32),
        "float" => of(&Kind::is_float),
        "short" => of(&|kind| kind.is_float() && kind.bits() < 64),
        "f32" => of(&|kind| kind == Kind::F32),
        "f64" => of(&|kind| kind == Kind::F64),
        other => panic!("no kinds are called {other}"),
    };
    let number = || rest[1..].parse().unwrap_or_else(|_| panic!("a number in {text}"));
    let shape = match rest.chars().next() {
        None => Shape::Free,
        Some('.') => Shape::Scalar,
        Some(':') if rest.len() == 1 => Shape::Vector,
        Some(':') => Shape::VectorOf(number()),
        Some('=') => Shape::Same(number()),
        Some('~') => Shape::Like(number()),
        Some('#') => Shape::Count(number()),
        Some('!') => Shape::Other(number()),
        Some('^') => Shape::Component(number()),
        Some('@') => Shape::Of(number()),
        Some('?') => Shape::Parts(number()),
        Some(other) => panic!("no shape {other}"),
    };
    Position { kinds, shape }
}

impl Rule {
    /// Whether a result and operands have types that the instruction exists for.
    pub fn allows(&self, types: &[Ty]) -> bool {
        types.len() == self.positions.len() && (0..types.len()).all(|at| self.fits(at, types))
    }

    fn fits(&self, at: usize, types: &[Ty]) -> bool {
        let (ty, Position { kinds, shape }) = (types[at], &self.positions[at]);
        kinds.contains(&ty.kind)
            && match *shape {
                Shape::Free => true,
                Shape::Scalar => ty.count == 1,
                Shape::Vector => ty.count > 1,
                Shape::VectorOf(count) => ty.count == count,
                Shape::Same(other) => ty == types[other],
                Shape::Like(other) => {
                    ty.count == types[other].count && ty.kind.bits() == types[other].kind.bits()
                }
                Shape::Count(other) => ty.count == types[other].count,
                Shape::Other(other) => {
                    ty.count == types[other].count && ty.kind.bits() != types[other].kind.bits()
                }
                Shape::Component(other) => ty.count == 1 && ty.kind == types[other].kind,
                Shape::Of(other) => ty.count > 1 && types[other].count == 1 && ty.kind == types[other].kind,
                Shape::Parts(other) => ty.kind == types[other].kind,
                Shape::Condition(other) => ty.count == 1 || ty.count == types[other].count,
            }
    }

    /// Every combination of types that the instruction exists for.
    pub fn legal(&self) -> Vec<Vec<Ty>> {
        let mut found = vec![Vec::new()];
        for at in 0..self.positions.len() {
            let mut longer = Vec::new();
            for types in &found {
                for ty in Ty::all() {
                    let types: Vec<Ty> = types.iter().copied().chain([ty]).collect();
                    if self.fits(at, &types) {
                        longer.push(types);
                    }
                }
            }
            found = longer;
        }
        found
    }
}
