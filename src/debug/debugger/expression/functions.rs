//! Functions and constructors of the shading languages.

use crate::debug::debugger::expression::arithmetic::{
    Calculated, binary, by_components, calculated, common_type, multiply, scalar, sum,
};
use crate::debug::debugger::expression::numbers::{
    CalculatedValue, ComponentBits, NumberShape, ScalarType, convert, float, float_bits, signed,
};
use crate::debug::debugger::expression::syntax::BinaryOperator as Operator;
use crate::debug::debugger::expression::type_names::numeric_type;

/// A function: its names, how many arguments it takes, and what it does.
type Function = (&'static [&'static str], usize, fn(&[CalculatedValue]) -> Calculated);

const FUNCTIONS: &[Function] = &[
    (&["length"], 1, |of| length(&of[0])),
    (&["distance"], 2, |of| length(&calculated(Operator::Subtract, &of[0], &of[1])?)),
    (&["dot"], 2, |of| dot(&of[0], &of[1])),
    (&["normalize"], 1, |of| calculated(Operator::Divide, &of[0], &length(&of[0])?)),
    (&["cross"], 2, |of| cross(&of[0], &of[1])),
    (&["abs"], 1, |of| abs(&of[0])),
    (&["min"], 2, |of| extreme(&of[0], &of[1], false)),
    (&["max"], 2, |of| extreme(&of[0], &of[1], true)),
    (&["clamp"], 3, |of| extreme(&extreme(&of[0], &of[1], true)?, &of[2], false)),
    (&["mix"], 3, mix),
    (&["lerp"], 3, |of| {
        let span = calculated(Operator::Subtract, &of[1], &of[0])?;
        calculated(Operator::Add, &of[0], &calculated(Operator::Multiply, &span, &of[2])?)
    }),
    (&["sqrt"], 1, |of| map_floats(&of[0], f64::sqrt)),
    (&["floor"], 1, |of| map_floats(&of[0], f64::floor)),
    (&["ceil"], 1, |of| map_floats(&of[0], f64::ceil)),
    (&["fract", "frac"], 1, |of| calculated(Operator::Subtract, &of[0], &map_floats(&of[0], f64::floor)?)),
    (&["any"], 1, |of| Ok(CalculatedValue::of_bool(of[0].converted(ScalarType::Bool).bits().contains(&1)))),
    (&["all"], 1, |of| Ok(CalculatedValue::of_bool(!of[0].converted(ScalarType::Bool).bits().contains(&0)))),
    (&["isnan"], 1, |of| test(&of[0], f64::is_nan)),
    (&["isinf"], 1, |of| test(&of[0], f64::is_infinite)),
    // HLSL multiplies matrices whose rows are the columns of SPIR-V's.
    (&["mul"], 2, |of| multiply(&of[1], &of[0])),
    (&["floatBitsToUint", "asuint"], 1, |of| reinterpret(&of[0], ScalarType::Uint(32))),
    (&["floatBitsToInt", "asint"], 1, |of| reinterpret(&of[0], ScalarType::Int(32))),
    (&["uintBitsToFloat", "intBitsToFloat", "asfloat"], 1, |of| reinterpret(&of[0], ScalarType::Float(32))),
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
    let (_, count, function) = FUNCTIONS.iter().find(|(names, ..)| names.contains(&name))?;
    Some(match arguments.len() == *count {
        true => function(arguments),
        false => Err(format!("`{name}` takes {count} arguments, not {}", arguments.len())),
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
        (all, _) => return Err(format!("`{name}` is made of {count} components, not {all}")),
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

/// The value as floats, for functions that GLSL has for floats only.
fn floats(of: &CalculatedValue) -> CalculatedValue {
    match of.ty() {
        ScalarType::Float(_) => of.clone(),
        _ => of.converted(ScalarType::Float(32)),
    }
}

fn map_floats(of: &CalculatedValue, function: fn(f64) -> f64) -> Calculated {
    let of = floats(of);
    let width = of.ty().width();
    // Rounding these in f64 first changes nothing: floor and ceil are exact, and a square root has
    // more than twice as many bits in f64 as in f32.
    let bits = of.bits().iter().map(|&bits| float_bits(function(float(bits, width)), width)).collect();
    Ok(CalculatedValue::new(of.ty(), of.shape(), bits))
}

fn test(of: &CalculatedValue, function: fn(f64) -> bool) -> Calculated {
    let of = floats(of);
    let bits = of.bits().iter().map(|&bits| u64::from(function(float(bits, of.ty().width())))).collect();
    Ok(CalculatedValue::new(ScalarType::Bool, of.shape(), bits))
}

fn dot(a: &CalculatedValue, b: &CalculatedValue) -> Calculated {
    let products = binary_by_components(a, b)?;
    let bits = sum(products.ty(), products.bits().iter().map(|&bits| Ok(bits)))?;
    Ok(CalculatedValue::scalar(products.ty(), bits))
}

fn binary_by_components(a: &CalculatedValue, b: &CalculatedValue) -> Calculated {
    match (a.shape(), b.shape()) {
        (NumberShape::Scalar | NumberShape::Vector(_), shape) if shape == a.shape() => {
            calculated(Operator::Multiply, a, b)
        }
        _ => Err(format!("no `dot` of {} and {}", a.type_name(), b.type_name())),
    }
}

fn length(of: &CalculatedValue) -> Calculated {
    let of = floats(of);
    map_floats(&dot(&of, &of)?, f64::sqrt)
}

fn cross(a: &CalculatedValue, b: &CalculatedValue) -> Calculated {
    let ty = common_type(a.ty(), b.ty())
        .filter(|_| a.shape() == NumberShape::Vector(3) && b.shape() == NumberShape::Vector(3));
    let ty = ty.ok_or_else(|| format!("no `cross` of {} and {}", a.type_name(), b.type_name()))?;
    let (a, b) = (a.converted(ty), b.converted(ty));
    let product = |i: usize, j: usize| scalar(Operator::Multiply, ty, a.bits()[i], b.bits()[j]);
    let component = |i: usize, j: usize| scalar(Operator::Subtract, ty, product(i, j)?, product(j, i)?);
    let bits: Result<ComponentBits, String> =
        [(1, 2), (2, 0), (0, 1)].into_iter().map(|(i, j)| component(i, j)).collect();
    Ok(CalculatedValue::new(ty, NumberShape::Vector(3), bits?))
}

fn abs(of: &CalculatedValue) -> Calculated {
    let positive = |&bits: &u64| match of.ty() {
        ScalarType::Int(width) => signed(bits, width).unsigned_abs(),
        ScalarType::Float(width) => bits & (u64::MAX >> (65 - width)),
        _ => bits,
    };
    Ok(CalculatedValue::new(of.ty(), of.shape(), of.bits().iter().map(positive).collect()))
}

/// The greater or the lesser of each pair of components.
fn extreme(a: &CalculatedValue, b: &CalculatedValue, greatest: bool) -> Calculated {
    let operator = Operator::Less;
    by_components(operator, a, b, &|ty, a, b| {
        let (x, y) = (CalculatedValue::scalar(ty, a), CalculatedValue::scalar(ty, b));
        // GLSL: max is y if x < y, min is y if y < x; else both are x.
        let takes_second = match greatest {
            true => binary(operator, &x, &y)?,
            false => binary(operator, &y, &x)?,
        };
        Ok(if takes_second.as_bool() == Some(true) { b } else { a })
    })
}

/// `x * (1 - a) + y * a`, or the components of y where a is true.
fn mix(of: &[CalculatedValue]) -> Calculated {
    let [x, y, by] = of else { return Err("`mix` takes 3 arguments".into()) };
    if by.ty() == ScalarType::Bool {
        if x.shape() != by.shape() || x.shape() != y.shape() || x.ty() != y.ty() {
            return Err("`mix` by bools takes three values of one shape".into());
        }
        let chosen = by.bits().iter().zip(x.bits().iter().zip(y.bits()));
        let bits = chosen.map(|(&by, (&x, &y))| if by != 0 { y } else { x }).collect();
        return Ok(CalculatedValue::new(x.ty(), x.shape(), bits));
    }
    let one = CalculatedValue::scalar(by.ty(), convert(1, ScalarType::Uint(32), by.ty()));
    let rest = calculated(Operator::Subtract, &one, by)?;
    let first = calculated(Operator::Multiply, x, &rest)?;
    calculated(Operator::Add, &first, &calculated(Operator::Multiply, y, by)?)
}

/// The value whose components have the same 32 bits.
fn reinterpret(of: &CalculatedValue, ty: ScalarType) -> Calculated {
    match of.ty().width() {
        32 => Ok(CalculatedValue::new(ty, of.shape(), of.bits().into())),
        _ => Err(format!("{} has no components of 32 bits", of.type_name())),
    }
}
