//! The names of numeric types in GLSL, HLSL and Slang.

use crate::debugger::expression::numbers::{NumberShape, ScalarType};

/// Scalar types by name; HLSL's and Slang's vectors and matrices are these with numbers behind.
const SCALARS: &[(&str, ScalarType)] = &[
    ("bool", ScalarType::Bool),
    ("int8_t", ScalarType::Int(8)),
    ("uint8_t", ScalarType::Uint(8)),
    ("int16_t", ScalarType::Int(16)),
    ("uint16_t", ScalarType::Uint(16)),
    ("int32_t", ScalarType::Int(32)),
    ("uint32_t", ScalarType::Uint(32)),
    ("int64_t", ScalarType::Int(64)),
    ("uint64_t", ScalarType::Uint(64)),
    ("int", ScalarType::Int(32)),
    ("uint", ScalarType::Uint(32)),
    ("float16_t", ScalarType::Float(16)),
    ("float32_t", ScalarType::Float(32)),
    ("float64_t", ScalarType::Float(64)),
    ("half", ScalarType::Float(16)),
    ("float", ScalarType::Float(32)),
    ("double", ScalarType::Float(64)),
];

/// What stands before `vec` and `mat` in GLSL.
const PREFIXES: &[(&str, ScalarType)] = &[
    ("", ScalarType::Float(32)),
    ("b", ScalarType::Bool),
    ("i", ScalarType::Int(32)),
    ("u", ScalarType::Uint(32)),
    ("d", ScalarType::Float(64)),
    ("f16", ScalarType::Float(16)),
    ("f32", ScalarType::Float(32)),
    ("f64", ScalarType::Float(64)),
    ("i8", ScalarType::Int(8)),
    ("u8", ScalarType::Uint(8)),
    ("i16", ScalarType::Int(16)),
    ("u16", ScalarType::Uint(16)),
    ("i32", ScalarType::Int(32)),
    ("u32", ScalarType::Uint(32)),
    ("i64", ScalarType::Int(64)),
    ("u64", ScalarType::Uint(64)),
];

/// The numeric type of a name: `vec3`, `float3`, `mat4x3`, `float3x4`, `uint16_t`.
///
/// HLSL counts the rows of a matrix first. Its rows are the columns of SPIR-V's matrix, and are
/// called columns here: `float3x4` is `mat3x4`.
pub(super) fn numeric_type(name: &str) -> Option<(ScalarType, NumberShape)> {
    for &(scalar, ty) in SCALARS {
        if let Some(shape) = name.strip_prefix(scalar).and_then(shape_of_suffix) {
            return Some((ty, shape));
        }
    }
    let prefix = |prefix: &str| PREFIXES.iter().find(|(known, _)| *known == prefix).map(|&(_, ty)| ty);
    if let Some((before, count)) = name.split_once("vec") {
        return Some((prefix(before)?, NumberShape::Vector(size(count)?)));
    }
    let (before, size_text) = name.split_once("mat")?;
    let ty = prefix(before).filter(|ty| matches!(ty, ScalarType::Float(_)))?;
    let (columns, rows) = size_text.split_once('x').unwrap_or((size_text, size_text));
    Some((ty, NumberShape::Matrix { columns: size(columns)?, rows: size(rows)? }))
}

fn shape_of_suffix(suffix: &str) -> Option<NumberShape> {
    match suffix.split_once('x') {
        _ if suffix.is_empty() => Some(NumberShape::Scalar),
        Some((rows, columns)) => Some(NumberShape::Matrix { columns: size(rows)?, rows: size(columns)? }),
        None => Some(NumberShape::Vector(size(suffix)?)),
    }
}

/// A number of components: 2, 3 or 4.
fn size(text: &str) -> Option<u32> {
    text.parse().ok().filter(|size| (2..=4).contains(size))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_named_as_in_each_language() {
        use NumberShape::{Matrix, Scalar, Vector};
        let expected = [
            ("float", Some((ScalarType::Float(32), Scalar))),
            ("float3", Some((ScalarType::Float(32), Vector(3)))),
            ("vec2", Some((ScalarType::Float(32), Vector(2)))),
            ("uvec4", Some((ScalarType::Uint(32), Vector(4)))),
            ("u16vec2", Some((ScalarType::Uint(16), Vector(2)))),
            ("uint16_t", Some((ScalarType::Uint(16), Scalar))),
            ("uint16_t3", Some((ScalarType::Uint(16), Vector(3)))),
            ("mat3", Some((ScalarType::Float(32), Matrix { columns: 3, rows: 3 }))),
            // GLSL: four columns of three rows. HLSL: three rows of four columns.
            ("mat4x3", Some((ScalarType::Float(32), Matrix { columns: 4, rows: 3 }))),
            ("float3x4", Some((ScalarType::Float(32), Matrix { columns: 3, rows: 4 }))),
            ("dmat2", Some((ScalarType::Float(64), Matrix { columns: 2, rows: 2 }))),
            ("vec5", None),
            ("float1", None),
            ("imat2", None),
            ("vector", None),
        ];
        for (name, ty) in expected {
            assert_eq!(numeric_type(name), ty, "{name}");
        }
    }
}
