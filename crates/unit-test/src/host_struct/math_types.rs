//! Vectors and matrices of mathematics libraries and of Vulkan's headers, by their names.
//!
//! Only names whose layout does not depend on the library or its settings are here: `float3` has 12
//! bytes in CUDA and 16 in Metal's `simd`, so a file has to declare it.

use crate::host_struct::{HostType, ScalarClass};

/// The language of a host's source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HostLanguage {
    /// Rust source.
    Rust,
    /// C and C++, for 64-bit machines.
    C,
}

/// The layout of a vector or matrix type by its name without namespaces.
pub(super) fn math_type(name: &str, language: HostLanguage) -> Option<HostType> {
    let ty = match language {
        HostLanguage::Rust => glam(name),
        HostLanguage::C => glm(name).or_else(|| other_c(name)),
    };
    ty.map(|ty| ty.named(name))
}

fn vector(class: ScalarClass, size: usize, count: usize) -> HostType {
    HostType::scalar("", class, size).array(count)
}

/// `2`, `3` or `4` as a number.
fn dimension(text: &str) -> Option<usize> {
    text.parse().ok().filter(|count| (2..=4).contains(count) && text.len() == 1)
}

/// Columns and rows: `4` or `4x3`.
fn dimensions(text: &str) -> Option<(usize, usize)> {
    match text.split_once('x') {
        Some((columns, rows)) => Some((dimension(columns)?, dimension(rows)?)),
        None => dimension(text).map(|count| (count, count)),
    }
}

/// glam's types, as built for a processor with vectors of 128 bits (x86-64, AArch64).
fn glam(name: &str) -> Option<HostType> {
    let float3 = || vector(ScalarClass::Float, 4, 3);
    match name {
        "Vec3A" => return Some(float3().aligned(16)),
        "Vec4" | "Quat" => return Some(vector(ScalarClass::Float, 4, 4).aligned(16)),
        "Mat2" => return Some(vector(ScalarClass::Float, 4, 2).array(2).aligned(16)),
        "Mat3" => return Some(float3().array(3)),
        "Mat3A" => return Some(float3().aligned(16).array(3)),
        "Mat4" => return Some(vector(ScalarClass::Float, 4, 4).aligned(16).array(4)),
        "Affine3A" => return Some(float3().aligned(16).array(4)),
        "DQuat" => return Some(vector(ScalarClass::Float, 8, 4)),
        _ => {}
    }
    let prefixes = [
        ("DVec", ScalarClass::Float, 8),
        ("I64Vec", ScalarClass::Integer, 8),
        ("U64Vec", ScalarClass::Integer, 8),
        ("I16Vec", ScalarClass::Integer, 2),
        ("U16Vec", ScalarClass::Integer, 2),
        ("I8Vec", ScalarClass::Integer, 1),
        ("U8Vec", ScalarClass::Integer, 1),
        ("IVec", ScalarClass::Integer, 4),
        ("UVec", ScalarClass::Integer, 4),
        ("Vec", ScalarClass::Float, 4),
    ];
    let found = prefixes.iter().find_map(|(prefix, class, size)| {
        dimension(name.strip_prefix(prefix)?).map(|count| vector(*class, *size, count))
    });
    found.or_else(|| {
        let count = dimension(name.strip_prefix("DMat")?)?;
        Some(vector(ScalarClass::Float, 8, count).array(count))
    })
}

/// GLM's types with their default alignment, that of a component.
fn glm(name: &str) -> Option<HostType> {
    // Names with a precision, such as `highp_vec3`, mean the same.
    let name = ["highp_", "mediump_", "lowp_", "packed_"]
        .iter()
        .find_map(|prefix| name.strip_prefix(prefix))
        .unwrap_or(name);
    if let Some(name) = name.strip_prefix("aligned_") {
        let ty = glm(name)?;
        return name.starts_with("vec").then(|| ty.aligned(if name == "vec2" { 8 } else { 16 }));
    }
    if name == "quat" {
        return Some(vector(ScalarClass::Float, 4, 4));
    }
    let vectors = [
        ("vec", ScalarClass::Float, 4),
        ("fvec", ScalarClass::Float, 4),
        ("dvec", ScalarClass::Float, 8),
        ("f64vec", ScalarClass::Float, 8),
        ("ivec", ScalarClass::Integer, 4),
        ("uvec", ScalarClass::Integer, 4),
        ("i32vec", ScalarClass::Integer, 4),
        ("u32vec", ScalarClass::Integer, 4),
        ("i64vec", ScalarClass::Integer, 8),
        ("u64vec", ScalarClass::Integer, 8),
        ("i16vec", ScalarClass::Integer, 2),
        ("u16vec", ScalarClass::Integer, 2),
        ("i8vec", ScalarClass::Integer, 1),
        ("u8vec", ScalarClass::Integer, 1),
    ];
    let found = vectors.iter().find_map(|(prefix, class, size)| {
        dimension(name.strip_prefix(prefix)?).map(|count| vector(*class, *size, count))
    });
    found.or_else(|| {
        let matrices = [("mat", 4), ("fmat", 4), ("dmat", 8)];
        matrices.iter().find_map(|(prefix, size)| {
            let (columns, rows) = dimensions(name.strip_prefix(prefix)?)?;
            Some(vector(ScalarClass::Float, *size, rows).array(columns))
        })
    })
}

/// DirectXMath, Imath, Eigen, Apple's `simd`, nvmath and Vulkan.
fn other_c(name: &str) -> Option<HostType> {
    let unsigned = || HostType::scalar("uint32_t", ScalarClass::Integer, 4);
    let number = |count| vector(ScalarClass::Float, 4, count);
    Some(match name {
        "VkBool32" | "VkFlags" => unsigned(),
        "VkDeviceAddress" | "VkDeviceSize" | "VkFlags64" => HostType::scalar("", ScalarClass::Integer, 8),
        "VkExtent2D" | "VkOffset2D" => unsigned().array(2),
        "VkExtent3D" | "VkOffset3D" => unsigned().array(3),
        "VkTransformMatrixKHR" => number(4).array(3),
        "XMVECTOR" => number(4).aligned(16),
        "XMMATRIX" => number(4).aligned(16).array(4),
        "V2f" | "vec2f" | "Vector2f" | "XMFLOAT2" => number(2),
        "V3f" | "vec3f" | "Vector3f" | "XMFLOAT3" => number(3),
        "V4f" | "vec4f" | "XMFLOAT4" => number(4),
        "XMFLOAT4A" | "Vector4f" => number(4).aligned(16),
        "XMFLOAT3A" => number(3).aligned(16),
        "XMINT2" | "XMUINT2" => unsigned().array(2),
        "XMINT3" | "XMUINT3" => unsigned().array(3),
        "XMINT4" | "XMUINT4" => unsigned().array(4),
        "M33f" | "mat3f" | "Matrix3f" | "XMFLOAT3X3" => number(3).array(3),
        "M44f" | "mat4f" | "XMFLOAT4X4" => number(4).array(4),
        "XMFLOAT3X4" => number(4).array(3),
        "XMFLOAT4X3" => number(3).array(4),
        "Matrix4f" => number(4).aligned(16).array(4),
        "simd_float2" => number(2).aligned(8),
        "simd_float3" => number(3).aligned(16),
        "simd_float4" => number(4).aligned(16),
        "simd_float4x4" => number(4).aligned(16).array(4),
        "simd_float3x3" => number(3).aligned(16).array(3),
        "simd_uint2" | "simd_int2" => unsigned().array(2).aligned(8),
        "simd_uint3" | "simd_int3" => unsigned().array(3).aligned(16),
        "simd_uint4" | "simd_int4" => unsigned().array(4).aligned(16),
        "half" => HostType::scalar("half", ScalarClass::Float, 2),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes and alignments that the compiler reports for glam.
    #[test]
    fn glam_types_have_the_sizes_of_the_crate() {
        macro_rules! check {
            ($($name:ident)*) => {$(
                let ty = math_type(stringify!($name), HostLanguage::Rust).expect(stringify!($name));
                let expected = (size_of::<glam::$name>(), align_of::<glam::$name>());
                assert_eq!((ty.size(), ty.align()), expected, stringify!($name));
            )*};
        }
        check!(Vec2 Vec3 Vec3A Vec4 Quat Mat2 Mat3 Mat3A Mat4 Affine3A DVec2 DVec3 DVec4 DMat2 DMat3 DMat4 DQuat);
    }

    /// By GLM's manual, "Default types have the alignment of their components"; DirectXMath's and
    /// Vulkan's headers.
    #[test]
    fn c_types_have_the_sizes_of_their_headers() {
        for (name, size, align) in [
            ("vec3", 12, 4),
            ("mat4", 64, 4),
            ("mat4x3", 48, 4),
            ("dvec2", 16, 8),
            ("aligned_vec3", 16, 16),
            ("XMFLOAT4X4", 64, 4),
            ("XMMATRIX", 64, 16),
            ("VkTransformMatrixKHR", 48, 4),
            ("simd_float3", 16, 16),
        ] {
            let ty = math_type(name, HostLanguage::C).expect(name);
            assert_eq!((ty.size(), ty.align(), ty.name()), (size, align, name));
        }
        for name in ["float3", "vec5", "mat44", "matrix", "vec"] {
            assert!(math_type(name, HostLanguage::C).is_none(), "{name}");
        }
    }
}
