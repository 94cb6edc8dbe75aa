//! Operators on numbers, with GLSL's conversions: a scalar meets each component, integers become
//! floats, signed integers unsigned ones.

use anyhit_engine::module::Opcode;
use half::f16;

use crate::debugger::expression::numbers::{
    Calculated, CalculatedValue, ComponentBits, NumberShape, ScalarType, float, mask, signed,
};
use crate::debugger::expression::shader_code::{self, Instruction};
use crate::debugger::expression::syntax::{BinaryOperator as Operator, UnaryOperator};

/// Applies an operator to one operand.
pub(super) fn unary(operator: UnaryOperator, operand: &CalculatedValue) -> Calculated {
    let ty = operand.ty();
    let map = |apply: fn(u64) -> u64| {
        let bits = operand.bits().iter().map(|&bits| apply(bits) & mask(ty)).collect();
        Ok(CalculatedValue::new(ty, operand.shape(), bits))
    };
    match (operator, ty) {
        (UnaryOperator::Plus, ScalarType::Int(_) | ScalarType::Uint(_) | ScalarType::Float(_)) => {
            Ok(operand.clone())
        }
        (UnaryOperator::Minus, ScalarType::Int(_) | ScalarType::Uint(_)) => map(u64::wrapping_neg),
        (UnaryOperator::Minus, ScalarType::Float(width)) => {
            let flipped = operand.bits().iter().map(|&bits| bits ^ 1 << (width - 1));
            Ok(CalculatedValue::new(ty, operand.shape(), flipped.collect()))
        }
        (UnaryOperator::Complement, ScalarType::Int(_) | ScalarType::Uint(_)) => map(|bits| !bits),
        (UnaryOperator::Not, _) => {
            let inverted = operand.converted(ScalarType::Bool);
            let bits = inverted.bits().iter().map(|&bits| 1 - bits).collect();
            Ok(CalculatedValue::new(ScalarType::Bool, operand.shape(), bits))
        }
        _ => {
            let spelling = match operator {
                UnaryOperator::Plus => "+",
                UnaryOperator::Minus => "-",
                UnaryOperator::Complement => "~",
                UnaryOperator::Not => "!",
                UnaryOperator::Dereference => "*",
            };
            Err(format!("`{spelling}` is not defined for {}", operand.type_name()))
        }
    }
}

/// Applies an operator to two operands.
pub(super) fn binary(operator: Operator, a: &CalculatedValue, b: &CalculatedValue) -> Calculated {
    match operator {
        Operator::Multiply => multiply(a, b),
        Operator::ShiftLeft | Operator::ShiftRight => shift(operator, a, b),
        Operator::And | Operator::Or => {
            let (a, b) = a.as_bool().zip(b.as_bool()).ok_or_else(|| mismatch(operator, a, b))?;
            Ok(CalculatedValue::of_bool(if operator == Operator::And { a && b } else { a || b }))
        }
        Operator::Equal | Operator::NotEqual => {
            let equal = by_components(operator, a, b, &|ty, a, b| Ok(u64::from(is_equal(ty, a, b))))?;
            let all = equal.bits().iter().all(|&bits| bits != 0);
            Ok(CalculatedValue::of_bool(all == (operator == Operator::Equal)))
        }
        Operator::Less | Operator::LessEqual | Operator::Greater | Operator::GreaterEqual => {
            let compare = |ty, a, b| Ok(u64::from(is_ordered(operator, ty, a, b)));
            let result = by_components(operator, a, b, &compare)?;
            Ok(CalculatedValue::new(ScalarType::Bool, result.shape(), result.bits().into()))
        }
        Operator::BitAnd | Operator::BitOr | Operator::BitXor => {
            if [a, b].iter().any(|one| matches!(one.ty(), ScalarType::Float(_))) {
                return Err(mismatch(operator, a, b));
            }
            by_components(operator, a, b, &|_, a, b| {
                Ok(match operator {
                    Operator::BitAnd => a & b,
                    Operator::BitOr => a | b,
                    _ => a ^ b,
                })
            })
        }
        Operator::Add | Operator::Subtract | Operator::Divide | Operator::Remainder => {
            calculated(operator, a, b)
        }
    }
}

/// Adds, subtracts, multiplies or divides component by component.
pub(super) fn calculated(operator: Operator, a: &CalculatedValue, b: &CalculatedValue) -> Calculated {
    if a.ty() == ScalarType::Bool || b.ty() == ScalarType::Bool {
        return Err(mismatch(operator, a, b));
    }
    by_components(operator, a, b, &|ty, a, b| scalar(operator, ty, a, b))
}

fn mismatch(operator: Operator, a: &CalculatedValue, b: &CalculatedValue) -> String {
    format!("`{}` is not defined for {} and {}", operator.spelling(), a.type_name(), b.type_name())
}

/// The type in which two operands meet (GLSL 4.60, 4.1.10).
pub(super) fn common_type(a: ScalarType, b: ScalarType) -> Option<ScalarType> {
    use ScalarType::{Bool, Float, Int, Uint};
    Some(match (a, b) {
        (Bool, Bool) => Bool,
        (Bool, _) | (_, Bool) => return None,
        (Float(a), Float(b)) => Float(a.max(b)),
        (Float(float), Int(width) | Uint(width)) | (Int(width) | Uint(width), Float(float)) => {
            Float(if width == 64 { 64 } else { float })
        }
        (Int(a), Int(b)) => Int(a.max(b)),
        (Uint(a), Uint(b)) => Uint(a.max(b)),
        (Int(signed), Uint(unsigned)) | (Uint(unsigned), Int(signed)) => {
            if signed > unsigned {
                Int(signed)
            } else {
                Uint(unsigned)
            }
        }
    })
}

/// Applies a function to each pair of components, of one type; a scalar meets all components of
/// the other operand.
pub(super) fn by_components(
    operator: Operator,
    a: &CalculatedValue,
    b: &CalculatedValue,
    apply: &dyn Fn(ScalarType, u64, u64) -> Result<u64, String>,
) -> Calculated {
    let shape = match (a.shape(), b.shape()) {
        (NumberShape::Scalar, shape) | (shape, NumberShape::Scalar) => shape,
        (one, other) if one == other => one,
        _ => return Err(mismatch(operator, a, b)),
    };
    let ty = common_type(a.ty(), b.ty()).ok_or_else(|| mismatch(operator, a, b))?;
    let (a, b) = (a.converted(ty), b.converted(ty));
    let at = |of: &CalculatedValue, at: usize| of.bits()[if of.bits().len() == 1 { 0 } else { at }];
    let components = 0..shape.components() as usize;
    let bits: Result<ComponentBits, String> =
        components.map(|index| apply(ty, at(&a, index), at(&b, index))).collect();
    Ok(CalculatedValue::new(ty, shape, bits?))
}

/// Calculates with two components of a type.
pub(super) fn scalar(operator: Operator, ty: ScalarType, a: u64, b: u64) -> Result<u64, String> {
    let floats = |a: f32, b: f32| match operator {
        Operator::Add => a + b,
        Operator::Subtract => a - b,
        Operator::Multiply => a * b,
        Operator::Divide => a / b,
        _ => a % b,
    };
    let by_zero = || "division by zero".to_owned();
    Ok(match ty {
        ScalarType::Float(32) => floats(f32::from_bits(a as u32), f32::from_bits(b as u32)).to_bits().into(),
        // Rounding the exact result to f32 first changes nothing: f32 has more than twice as many
        // bits.
        ScalarType::Float(16) => {
            let [a, b] = [a, b].map(|bits| f16::from_bits(bits as u16).to_f32());
            f16::from_f32(floats(a, b)).to_bits().into()
        }
        ScalarType::Float(_) => {
            let [a, b] = [a, b].map(f64::from_bits);
            let value = match operator {
                Operator::Add => a + b,
                Operator::Subtract => a - b,
                Operator::Multiply => a * b,
                Operator::Divide => a / b,
                _ => a % b,
            };
            value.to_bits()
        }
        ScalarType::Bool | ScalarType::Int(_) | ScalarType::Uint(_) => {
            let bits = match (operator, ty) {
                (Operator::Add, _) => a.wrapping_add(b),
                (Operator::Subtract, _) => a.wrapping_sub(b),
                (Operator::Multiply, _) => a.wrapping_mul(b),
                (_, _) if b == 0 => return Err(by_zero()),
                (Operator::Divide, ScalarType::Int(width)) => {
                    signed(a, width).wrapping_div(signed(b, width)) as u64
                }
                (Operator::Divide, _) => a / b,
                (_, ScalarType::Int(width)) => signed(a, width).wrapping_rem(signed(b, width)) as u64,
                _ => a % b,
            };
            bits & mask(ty)
        }
    })
}

fn is_equal(ty: ScalarType, a: u64, b: u64) -> bool {
    match ty {
        ScalarType::Float(width) => float(a, width) == float(b, width),
        _ => a == b,
    }
}

fn is_ordered(operator: Operator, ty: ScalarType, a: u64, b: u64) -> bool {
    let order = match ty {
        ScalarType::Float(width) => float(a, width).partial_cmp(&float(b, width)),
        ScalarType::Int(width) => Some(signed(a, width).cmp(&signed(b, width))),
        _ => Some(a.cmp(&b)),
    };
    order.is_some_and(|order| match operator {
        Operator::Less => order.is_lt(),
        Operator::LessEqual => order.is_le(),
        Operator::Greater => order.is_gt(),
        _ => order.is_ge(),
    })
}

/// Shifts; the result is of the type of the left operand.
fn shift(operator: Operator, a: &CalculatedValue, b: &CalculatedValue) -> Calculated {
    let is_integer = |one: &CalculatedValue| matches!(one.ty(), ScalarType::Int(_) | ScalarType::Uint(_));
    let spread = b.bits().len() == 1;
    if !is_integer(a) || !is_integer(b) || !(spread || a.shape() == b.shape()) {
        return Err(mismatch(operator, a, b));
    }
    let width = a.ty().width();
    let mut shifted = ComponentBits::new();
    for (at, &bits) in a.bits().iter().enumerate() {
        let count = b.bits()[if spread { 0 } else { at }];
        if count >= width.into() {
            return Err(format!("a shift by {count} of a {width}-bit value"));
        }
        shifted.push(
            match (operator, a.ty()) {
                (Operator::ShiftLeft, _) => bits << count,
                (_, ScalarType::Int(width)) => (signed(bits, width) >> count) as u64,
                _ => bits >> count,
            } & mask(a.ty()),
        );
    }
    Ok(CalculatedValue::new(a.ty(), a.shape(), shifted))
}

/// Multiplies: matrices as in linear algebra (GLSL 4.60, 5.9), by the instructions of SPIR-V; all
/// else by components.
pub(super) fn multiply(a: &CalculatedValue, b: &CalculatedValue) -> Calculated {
    use NumberShape::{Matrix, Vector};
    let (opcode, shape) = match (a.shape(), b.shape()) {
        // A vector to the right of a matrix is a column, one to the left of it a row.
        (Matrix { columns, rows }, Vector(count)) if columns == count => {
            (Opcode::MatrixTimesVector, Vector(rows))
        }
        (Vector(count), Matrix { columns, rows }) if rows == count => {
            (Opcode::VectorTimesMatrix, Vector(columns))
        }
        (Matrix { columns: inner, rows }, Matrix { columns, rows: others }) if inner == others => {
            (Opcode::MatrixTimesMatrix, Matrix { columns, rows })
        }
        _ => return calculated(Operator::Multiply, a, b),
    };
    let ty = common_type(a.ty(), b.ty()).filter(|ty| matches!(ty, ScalarType::Float(_)));
    let ty = ty.ok_or_else(|| mismatch(Operator::Multiply, a, b))?;
    let operands = [a.converted(ty), b.converted(ty)];
    shader_code::call("*", Instruction::Core(opcode), (ty, shape), &operands)
}
