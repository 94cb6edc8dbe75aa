//! Layouts of structs in host code, and their comparison with the block of a shader.
//!
//! A renderer declares each uniform block twice, in the shader and as a struct of its host. Nothing
//! but a comparison keeps both alike: [`compare`] finds the first byte at which they differ. The
//! host's struct comes from Rust itself ([`host_layout!`](crate::host_layout)), or from its source
//! text, Rust or C and C++ ([`source`]).
//!
//! The comparison ignores how scalars are grouped: a `vec4`, four floats and a `[f32; 4]` are the
//! same bytes. It compares the offset, width and class (float or integer) of every scalar, the
//! order of members by their names, and the size of the elements of arrays.

#[cfg(feature = "source-layouts")]
mod c_declarations;
#[cfg(feature = "source-layouts")]
mod c_preprocessor;
#[cfg(feature = "source-layouts")]
mod c_tokens;
pub mod compare;
#[cfg(feature = "source-layouts")]
mod math_types;
#[cfg(feature = "source-layouts")]
mod rust_source;
#[cfg(feature = "source-layouts")]
pub mod source;
#[cfg(feature = "source-layouts")]
mod source_file;

use std::sync::Arc;

/// Kinds of scalars that a comparison distinguishes. Signedness is not among them, since a `bool`
/// of GLSL is a `uint` in SPIR-V.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScalarClass {
    /// A floating-point number.
    Float,
    /// An integer, a boolean, an enumeration or an address.
    Integer,
}

/// The layout of a type of host code: size and alignment in bytes, and its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct HostType {
    name: String,
    size: usize,
    align: usize,
    parts: Parts,
}

#[derive(Clone, Debug, PartialEq)]
enum Parts {
    Scalar(ScalarClass),
    /// So many elements, each of the size of its type.
    Array(Arc<HostType>, usize),
    /// The array without a length that ends a struct of C.
    #[cfg_attr(not(feature = "source-layouts"), allow(dead_code, reason = "only source text has it"))]
    Flexible(Arc<HostType>),
    Struct(Vec<HostField>),
}

/// A field of a host struct.
#[derive(Clone, Debug, PartialEq)]
pub struct HostField {
    /// Its name; empty for a nameless part, whose fields belong to the struct around.
    pub name: String,
    /// Bytes from the start of the struct.
    pub offset: usize,
    /// Its type.
    pub ty: HostType,
}

impl HostType {
    /// A scalar whose alignment is its size.
    pub fn scalar(name: impl Into<String>, class: ScalarClass, size: usize) -> Self {
        Self { name: name.into(), size, align: size.max(1), parts: Parts::Scalar(class) }
    }

    /// An array of elements.
    pub fn array(self, count: usize) -> Self {
        let name = format!("[{}; {count}]", self.name);
        let (size, align) = (self.size.saturating_mul(count), self.align);
        Self { name, size, align, parts: Parts::Array(Arc::new(self), count) }
    }

    /// A struct with the given size and alignment in bytes.
    pub fn structure(name: impl Into<String>, size: usize, align: usize, fields: Vec<HostField>) -> Self {
        Self { name: name.into(), size, align, parts: Parts::Struct(fields) }
    }

    /// The type's name in the host's language.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The size in bytes.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The alignment in bytes.
    pub fn align(&self) -> usize {
        self.align
    }

    /// Offset and size in bytes of every scalar, and whether it is a float, in the order of their
    /// declaration.
    pub fn scalars(&self) -> Vec<(usize, usize, bool)> {
        match &self.parts {
            Parts::Scalar(class) => vec![(0, self.size, *class == ScalarClass::Float)],
            Parts::Array(element, count) => {
                let inner = element.scalars();
                let moved = |index| {
                    inner.iter().map(move |&(at, size, float)| (index * element.size + at, size, float))
                };
                (0..*count).flat_map(moved).collect()
            }
            Parts::Flexible(_) => Vec::new(),
            Parts::Struct(fields) => {
                let moved = |field: &HostField| {
                    let offset = field.offset;
                    field.ty.scalars().into_iter().map(move |(at, size, float)| (offset + at, size, float))
                };
                fields.iter().flat_map(moved).collect()
            }
        }
    }

    /// Offset and size in bytes of a field of a struct.
    pub fn field(&self, name: &str) -> Option<(usize, usize)> {
        let Parts::Struct(fields) = &self.parts else { return None };
        fields.iter().find(|field| field.name == name).map(|field| (field.offset, field.ty.size))
    }

    /// Renames the type.
    #[must_use]
    pub fn named(self, name: impl Into<String>) -> Self {
        Self { name: name.into(), ..self }
    }
}

/// What the parsers of source text need beyond the layouts that Rust itself computes.
#[cfg(feature = "source-layouts")]
impl HostType {
    /// An array without a length.
    fn flexible(self) -> Self {
        let (name, align) = (format!("[{}]", self.name), self.align);
        Self { name, size: 0, align, parts: Parts::Flexible(Arc::new(self)) }
    }

    /// Raises the alignment, which rounds the size up.
    fn aligned(self, align: usize) -> Self {
        let align = self.align.max(align);
        Self { align, size: self.size.next_multiple_of(align), ..self }
    }

    /// A struct of C: each field at the next multiple of its alignment, which `pack` limits.
    fn c_struct(name: &str, fields: Vec<(String, Self)>, pack: Option<usize>, align: usize) -> Self {
        let mut end = 0_usize;
        let mut largest = align.max(1);
        let place = |(name, ty): (String, Self)| {
            let align = pack.map_or(ty.align, |pack| pack.min(ty.align));
            largest = largest.max(align);
            let offset = end.next_multiple_of(align.max(1));
            end = offset.saturating_add(ty.size);
            HostField { name, offset, ty }
        };
        let fields = fields.into_iter().map(place).collect();
        Self::structure(name, end.next_multiple_of(largest), largest, fields)
    }

    /// A union of C: all fields at its start.
    fn c_union(name: &str, fields: Vec<(String, Self)>, pack: Option<usize>, align: usize) -> Self {
        let (mut end, mut largest) = (0, align.max(1));
        let place = |(name, ty): (String, Self)| {
            end = end.max(ty.size);
            largest = largest.max(pack.map_or(ty.align, |pack| pack.min(ty.align)));
            HostField { name, offset: 0, ty }
        };
        let fields = fields.into_iter().map(place).collect();
        Self::structure(name, end.next_multiple_of(largest), largest, fields)
    }
}

/// A Rust type whose layout a test compares with that of a shader's block.
///
/// Numbers, arrays and the vectors and matrices of `glam` have it.
/// [`host_layout!`](crate::host_layout) implements it for a `#[repr(C)]` struct.
pub trait HostLayout {
    /// The layout of the type.
    fn host_type() -> HostType;
}

macro_rules! scalars {
    ($class:ident: $($ty:ty),*) => {
        $(impl HostLayout for $ty {
            fn host_type() -> HostType {
                HostType {
                    align: align_of::<$ty>(),
                    ..HostType::scalar(stringify!($ty), ScalarClass::$class, size_of::<$ty>())
                }
            }
        })*
    };
}

scalars!(Float: f32, f64, half::f16, half::bf16);
scalars!(Integer: u8, u16, u32, u64, u128, usize, i8, i16, i32, i64, i128, isize, bool);

impl<T: HostLayout, const N: usize> HostLayout for [T; N] {
    fn host_type() -> HostType {
        T::host_type().array(N)
    }
}

macro_rules! vectors {
    ($($ty:ident: $part:ty, $count:literal;)*) => {
        $(impl HostLayout for glam::$ty {
            fn host_type() -> HostType {
                let parts = <$part>::host_type().array($count).parts;
                let (size, align) = (size_of::<Self>(), align_of::<Self>());
                HostType { name: stringify!($ty).into(), size, align, parts }
            }
        })*
    };
}

vectors! {
    Vec2: f32, 2;
    Vec3: f32, 3;
    Vec3A: f32, 3;
    Vec4: f32, 4;
    Quat: f32, 4;
    Mat2: glam::Vec2, 2;
    Mat3: glam::Vec3, 3;
    Mat3A: glam::Vec3A, 3;
    Mat4: glam::Vec4, 4;
}

/// Implements [`HostLayout`](crate::host_struct::HostLayout) for a `#[repr(C)]` struct, so that a
/// test can compare it with a shader's block.
///
/// Name every field: one that is missing does not compile. A field whose type does not implement
/// `HostLayout`, such as a vector of a mathematics library, takes a type of the same size behind a
/// colon.
///
/// ```
/// use anyhit::{Module, StructData, host_layout};
///
/// #[repr(C)]
/// struct Sun {
///     direction: [f32; 3],
///     power: f32,
/// }
/// host_layout!(Sun { direction, power });
///
/// #[repr(C)]
/// struct Params {
///     count: u32,
///     sun: Sun,
/// }
/// host_layout!(Params { count, sun });
///
/// # fn main() -> anyhit::Result<()> {
/// let source = "
///     struct Sun { direction: vec3f, power: f32 }
///     struct Params { count: u32, sun: Sun }
///     @group(0) @binding(0) var<uniform> params: Params;
///     @group(0) @binding(1) var<storage, read_write> result: f32;
///     @compute @workgroup_size(1)
///     fn main() { result = params.sun.power * f32(params.count); }
/// ";
/// let module = Module::from_source("params.wgsl", source)?;
/// StructData::of(&module, "Sun")?.check_host_layout::<Sun>()?;
///
/// // In the shader `sun` begins at byte 16, since a vec3f is aligned to 16 bytes.
/// let error = StructData::of(&module, "Params")?.check_host_layout::<Params>().unwrap_err();
/// assert!(error.message().contains("`sun.direction` begins at byte 16 in the shader, at byte 4 in"));
/// # Ok(())
/// # }
/// ```
#[macro_export]
macro_rules! host_layout {
    ($name:ident { $($field:ident $(: $as:ty)?),* $(,)? }) => {
        impl $crate::host_struct::HostLayout for $name {
            fn host_type() -> $crate::host_struct::HostType {
                use $crate::host_struct::{HostField, HostType};
                // Every field, or the pattern does not compile.
                let _ = |value: $name| {
                    let $name { $($field: _),* } = value;
                };
                let fields = vec![$(HostField {
                    name: stringify!($field).into(),
                    offset: ::core::mem::offset_of!($name, $field),
                    ty: $crate::host_layout!(@type $name $field $($as)?),
                }),*];
                let (size, align) = (::core::mem::size_of::<$name>(), ::core::mem::align_of::<$name>());
                HostType::structure(stringify!($name), size, align, fields)
            }
        }
    };
    (@type $name:ident $field:ident) => {
        $crate::host_struct::field_type(|value: $name| value.$field)
    };
    (@type $name:ident $field:ident $as:ty) => {
        $crate::host_struct::field_type_as::<_, _, $as>(|value: $name| value.$field)
    };
}

/// The layout of a field, by a function that returns it.
#[doc(hidden)]
pub fn field_type<S, T: HostLayout>(_: fn(S) -> T) -> HostType {
    T::host_type()
}

/// The layout of a field that is taken for another type of the same size.
///
/// # Panics
/// Where the sizes differ.
#[doc(hidden)]
pub fn field_type_as<S, T, As: HostLayout>(_: fn(S) -> T) -> HostType {
    let ty = As::host_type();
    let (size, name) = (size_of::<T>(), std::any::type_name::<T>());
    assert!(size == ty.size, "{name} has {size} bytes, {} has {}", ty.name, ty.size);
    HostType { align: align_of::<T>(), ..ty }
}
