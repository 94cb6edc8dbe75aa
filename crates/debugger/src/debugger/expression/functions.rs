//! Functions and constructors of the shading languages. Where a function is an instruction of
//! SPIR-V, the interpreter runs that.

use crate::debugger::expression::arithmetic::{common_type, multiply};
use crate::debugger::expression::numbers::{
    Calculated, CalculatedValue, ComponentBits, NumberShape, ScalarType, convert,
};
use crate::debugger::expression::shader_code::{self, Instruction, spread};
use crate::debugger::expression::type_names::numeric_type;
use anyhit_engine::module::Opcode;

/// A function: its names, how many arguments it takes, and what it does.
type Function = (&'static [&'static str], usize, Kind);

/// What a function does with its arguments. Scalars among arguments that must have one shape are
/// spread over it.
#[derive(Clone, Copy)]
enum Kind {
    /// An instruction on floats of one shape; its result has this shape.
    Floats(Instruction),
    /// Instructions of `GLSL.std.450` for floats, signed and unsigned integers of one shape.
    Numbers([u32; 3]),
    /// An instruction on floats of one shape that results in a scalar.
    ToScalar(Instruction),
    /// A question about each component of a float.
    Test(Instruction),
    /// An instruction on a matrix.
    Matrix(Instruction, fn(u32, u32) -> NumberShape),
    /// Anything else.
    Other(fn(&[CalculatedValue]) -> Calculated),
}

/// An instruction of `GLSL.std.450`, by its number.
const fn glsl(number: u32) -> Instruction {
    Instruction::Extended(number)
}

const FUNCTIONS: &[Function] = &[
    (&["round"], 1, Kind::Floats(glsl(1))),
    (&["roundEven"], 1, Kind::Floats(glsl(2))),
    (&["trunc"], 1, Kind::Floats(glsl(3))),
    (&["abs"], 1, Kind::Other(|of| without_sign(of, "abs", [4, 5]))),
    (&["sign"], 1, Kind::Other(|of| without_sign(of, "sign", [6, 7]))),
    (&["floor"], 1, Kind::Floats(glsl(8))),
    (&["ceil"], 1, Kind::Floats(glsl(9))),
    (&["fract", "frac"], 1, Kind::Floats(glsl(10))),
    (&["radians"], 1, Kind::Floats(glsl(11))),
    (&["degrees"], 1, Kind::Floats(glsl(12))),
    (&["sin"], 1, Kind::Floats(glsl(13))),
    (&["cos"], 1, Kind::Floats(glsl(14))),
    (&["tan"], 1, Kind::Floats(glsl(15))),
    (&["asin"], 1, Kind::Floats(glsl(16))),
    (&["acos"], 1, Kind::Floats(glsl(17))),
    (&["atan"], 1, Kind::Floats(glsl(18))),
    (&["sinh"], 1, Kind::Floats(glsl(19))),
    (&["cosh"], 1, Kind::Floats(glsl(20))),
    (&["tanh"], 1, Kind::Floats(glsl(21))),
    (&["asinh"], 1, Kind::Floats(glsl(22))),
    (&["acosh"], 1, Kind::Floats(glsl(23))),
    (&["atanh"], 1, Kind::Floats(glsl(24))),
    (&["atan", "atan2"], 2, Kind::Floats(glsl(25))),
    (&["pow"], 2, Kind::Floats(glsl(26))),
    (&["exp"], 1, Kind::Floats(glsl(27))),
    (&["log"], 1, Kind::Floats(glsl(28))),
    (&["exp2"], 1, Kind::Floats(glsl(29))),
    (&["log2"], 1, Kind::Floats(glsl(30))),
    (&["sqrt"], 1, Kind::Floats(glsl(31))),
    (&["inversesqrt", "rsqrt"], 1, Kind::Floats(glsl(32))),
    (&["determinant"], 1, Kind::Matrix(glsl(33), |_, _| NumberShape::Scalar)),
    (&["inverse"], 1, Kind::Matrix(glsl(34), |columns, rows| NumberShape::Matrix { columns, rows })),
    (&["transpose"], 1, {
        Kind::Matrix(Instruction::Core(Opcode::Transpose), |rows, columns| NumberShape::Matrix {
            columns,
            rows,
        })
    }),
    (&["min"], 2, Kind::Numbers([37, 39, 38])),
    (&["max"], 2, Kind::Numbers([40, 42, 41])),
    (&["clamp"], 3, Kind::Numbers([43, 45, 44])),
    (&["saturate"], 1, Kind::Other(saturate)),
    (&["mix", "lerp"], 3, Kind::Other(mix)),
    (&["step"], 2, Kind::Floats(glsl(48))),
    (&["smoothstep"], 3, Kind::Floats(glsl(49))),
    (&["fma", "mad"], 3, Kind::Floats(glsl(50))),
    (&["mod"], 2, Kind::Floats(Instruction::Core(Opcode::FMod))),
    (&["fmod"], 2, Kind::Floats(Instruction::Core(Opcode::FRem))),
    (&["length"], 1, Kind::ToScalar(glsl(66))),
    (&["distance"], 2, Kind::ToScalar(glsl(67))),
    (&["dot"], 2, Kind::Other(dot)),
    (&["cross"], 2, Kind::Floats(glsl(68))),
    (&["normalize"], 1, Kind::Floats(glsl(69))),
    (&["faceforward"], 3, Kind::Floats(glsl(70))),
    (&["reflect"], 2, Kind::Floats(glsl(71))),
    (&["refract"], 3, Kind::Other(refract)),
    (&["any"], 1, Kind::Other(|of| of_bools(&of[0], Instruction::Core(Opcode::Any)))),
    (&["all"], 1, Kind::Other(|of| of_bools(&of[0], Instruction::Core(Opcode::All)))),
    (&["isnan"], 1, Kind::Test(Instruction::Core(Opcode::IsNan))),
    (&["isinf"], 1, Kind::Test(Instruction::Core(Opcode::IsInf))),
    // HLSL multiplies matrices whose rows are the columns of SPIR-V's.
    (&["mul"], 2, Kind::Other(|of| multiply(&of[1], &of[0]))),
    (&["floatBitsToUint", "asuint"], 1, Kind::Other(|of| reinterpret(&of[0], ScalarType::Uint(32)))),
    (&["floatBitsToInt", "asint"], 1, Kind::Other(|of| reinterpret(&of[0], ScalarType::Int(32)))),
    (&["uintBitsToFloat", "intBitsToFloat", "asfloat"], 1, {
        Kind::Other(|of| reinterpret(&of[0], ScalarType::Float(32)))
    }),
];

/// The names of all functions.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    FUNCTIONS.iter().flat_map(|(names, ..)| names.iter().copied())
}

/// Calls a function or a constructor; `None` if there is none of that name.
pub(super) fn call(name: &str, arguments: &[CalculatedValue]) -> Option<Calculated> {
    if let Some((ty, shape)) = numeric_type(name) {
        return Some(construct(name, ty, shape, arguments));
    }
    let named = || FUNCTIONS.iter().filter(|(names, ..)| names.contains(&name));
    let first = named().next()?;
    Some(match named().find(|(_, count, _)| *count == arguments.len()) {
        Some((.., kind)) => kind.call(name, arguments),
        None => Err(format!("`{name}` takes {} arguments, not {}", first.1, arguments.len())),
    })
}

/// Constructs a value (GLSL 4.60, 5.4).
fn construct(name: &str, ty: ScalarType, shape: NumberShape, arguments: &[CalculatedValue]) -> Calculated {
    let count = shape.components() as usize;
    let given: ComponentBits = arguments
        .iter()
        .flat_map(|argument| argument.bits().iter().map(|&bits| convert(bits, argument.ty(), ty)))
        .collect();
    if let ([only], NumberShape::Matrix { columns, rows }) = (arguments, shape)
        && let Some(bits) = matrix_from_one(only, ty, columns, rows)
    {
        return Ok(CalculatedValue::new(ty, shape, bits));
    }
    let bits: ComponentBits = match (given.len(), arguments.len()) {
        (1, 1) => std::iter::repeat_n(given[0], count).collect(),
        // The last argument may have more than is needed.
        (all, _) if all >= count && all - count < arguments.last().map_or(0, |last| last.bits().len()) => {
            given[..count].into()
        }
        (all, _) => return Err(format!("`{name}` has {count} components, not {all}")),
    };
    Ok(CalculatedValue::new(ty, shape, bits))
}

/// A matrix from a scalar on its diagonal, or from another matrix in its upper left corner.
fn matrix_from_one(of: &CalculatedValue, ty: ScalarType, columns: u32, rows: u32) -> Option<ComponentBits> {
    let one = convert(1, ScalarType::Uint(32), ty);
    let place = |value: &dyn Fn(u32, u32) -> u64| {
        (0..columns)
            .flat_map(|column| (0..rows).map(move |row| (column, row)))
            .map(|at| value(at.0, at.1))
            .collect()
    };
    let value = |at: u32| convert(of.bits()[at as usize], of.ty(), ty);
    match of.shape() {
        NumberShape::Scalar => Some(place(&|column, row| if column == row { value(0) } else { 0 })),
        NumberShape::Matrix { columns: others, rows: height } => {
            Some(place(&|column, row| match column < others && row < height {
                true => value(column * height + row),
                false if column == row => one,
                false => 0,
            }))
        }
        _ => None,
    }
}

/// Brings arguments to one type and one shape.
fn together(
    name: &str,
    arguments: &[CalculatedValue],
    only_floats: bool,
) -> Result<Vec<CalculatedValue>, String> {
    let unknown = || no_function(name, arguments);
    let mut ty = arguments.first().ok_or_else(unknown)?.ty();
    let mut shape = NumberShape::Scalar;
    for argument in arguments {
        ty = common_type(ty, argument.ty()).ok_or_else(unknown)?;
        shape = match (shape, argument.shape()) {
            (NumberShape::Scalar, other) | (other, NumberShape::Scalar) => other,
            (one, other) if one == other => one,
            _ => return Err(unknown()),
        };
    }
    if ty == ScalarType::Bool || !matches!(shape, NumberShape::Scalar | NumberShape::Vector(_)) {
        return Err(unknown());
    }
    if only_floats && !matches!(ty, ScalarType::Float(_)) {
        ty = ScalarType::Float(32);
    }
    Ok(arguments.iter().map(|argument| spread(&argument.converted(ty), shape)).collect())
}

/// The message that a function takes no such arguments.
fn no_function(name: &str, arguments: &[CalculatedValue]) -> String {
    let types: Vec<String> = arguments.iter().map(CalculatedValue::type_name).collect();
    format!("`{name}` is not defined for {}", types.join(" and "))
}

/// Runs an instruction on arguments of one type and shape.
fn run(name: &str, instruction: Instruction, shape: NumberShape, of: &[CalculatedValue]) -> Calculated {
    shader_code::call(name, instruction, (of[0].ty(), shape), of)
}

impl Kind {
    fn call(self, name: &str, arguments: &[CalculatedValue]) -> Calculated {
        match self {
            Self::Floats(instruction) => {
                let of = together(name, arguments, true)?;
                run(name, instruction, of[0].shape(), &of)
            }
            Self::Numbers([float, signed, unsigned]) => {
                let of = together(name, arguments, false)?;
                let number = match of[0].ty() {
                    ScalarType::Float(_) => float,
                    ScalarType::Int(_) => signed,
                    _ => unsigned,
                };
                run(name, glsl(number), of[0].shape(), &of)
            }
            Self::ToScalar(instruction) => {
                run(name, instruction, NumberShape::Scalar, &together(name, arguments, true)?)
            }
            Self::Test(instruction) => {
                let of = together(name, arguments, true)?;
                shader_code::call(name, instruction, (ScalarType::Bool, of[0].shape()), &of)
            }
            Self::Matrix(instruction, shape) => match arguments[0].shape() {
                NumberShape::Matrix { columns, rows } => {
                    run(name, instruction, shape(columns, rows), arguments)
                }
                _ => Err(no_function(name, arguments)),
            },
            Self::Other(function) => function(arguments),
        }
    }
}

/// `abs` and `sign` by their instructions for floats and for signed integers. Integers without a
/// sign are their own absolute value.
fn without_sign(of: &[CalculatedValue], name: &str, [float, signed]: [u32; 2]) -> Calculated {
    match of[0].ty() {
        ScalarType::Uint(_) if name == "abs" => Ok(of[0].clone()),
        ScalarType::Float(_) => Kind::Floats(glsl(float)).call(name, of),
        _ => Kind::Numbers([float, signed, signed]).call(name, of),
    }
}

fn saturate(of: &[CalculatedValue]) -> Calculated {
    let limit = |value| CalculatedValue::scalar(ScalarType::Float(32), f32::to_bits(value).into());
    Kind::Floats(glsl(43)).call("saturate", &[of[0].clone(), limit(0.0), limit(1.0)])
}

/// The product of scalars; of vectors, the sum of the products.
fn dot(of: &[CalculatedValue]) -> Calculated {
    let of = together("dot", of, true)?;
    match of[0].shape() {
        NumberShape::Scalar => multiply(&of[0], &of[1]),
        _ => run("dot", Instruction::Core(Opcode::Dot), NumberShape::Scalar, &of),
    }
}

/// The ratio of the indices of refraction stays a scalar.
fn refract(of: &[CalculatedValue]) -> Calculated {
    let vectors = together("refract", &of[..2], true)?;
    let ratio = of[2].converted(vectors[0].ty());
    let shape = vectors[0].shape();
    let operands: Vec<CalculatedValue> = vectors.into_iter().chain([ratio]).collect();
    run("refract", glsl(72), shape, &operands)
}

/// Whether any or all components are not zero.
fn of_bools(of: &CalculatedValue, instruction: Instruction) -> Calculated {
    let bools = of.converted(ScalarType::Bool);
    match of.shape() {
        NumberShape::Scalar => Ok(bools),
        shape => {
            let bools = spread(&bools, NumberShape::Vector(shape.components()));
            shader_code::call("any", instruction, (ScalarType::Bool, NumberShape::Scalar), &[bools])
        }
    }
}

/// `x * (1 - a) + y * a`, or the components of y where a is true.
fn mix(of: &[CalculatedValue]) -> Calculated {
    let [x, y, by] = of else { return Err("`mix` takes 3 arguments".into()) };
    if by.ty() != ScalarType::Bool {
        return Kind::Floats(glsl(46)).call("mix", of);
    }
    if x.shape() != by.shape() || x.shape() != y.shape() || x.ty() != y.ty() {
        return Err("`mix` with bools requires three values of the same shape".into());
    }
    let operands = [by.clone(), y.clone(), x.clone()];
    shader_code::call("mix", Instruction::Core(Opcode::Select), (x.ty(), x.shape()), &operands)
}

/// The value whose components have the same 32 bits.
fn reinterpret(of: &CalculatedValue, ty: ScalarType) -> Calculated {
    match of.ty().width() {
        32 => Ok(CalculatedValue::new(ty, of.shape(), of.bits().into())),
        _ => Err(format!("{} has no 32-bit components", of.type_name())),
    }
}
