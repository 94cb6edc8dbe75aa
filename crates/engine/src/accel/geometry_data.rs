//! What a geometry is made of, decoded to f32 and u32.

use std::fmt;

/// The primitives of one geometry, in object space.
#[derive(Clone, PartialEq)]
pub enum GeometryData {
    /// Triangles, three vertices each.
    Triangles {
        /// Vertex positions.
        vertices: Vec<[f32; 3]>,
        /// Three indices for each primitive; without them vertices are taken three by three.
        indices: Option<Vec<u32>>,
        /// The build-time geometry transform (row-major 3x4).
        transform: Option<[[f32; 4]; 3]>,
    },
    /// Axis-aligned boxes: minimum, then maximum.
    Aabbs(Vec<[f32; 6]>),
    /// Spheres, one for each position or index.
    Spheres {
        /// The centres.
        positions: Vec<[f32; 3]>,
        /// The radii, one for each position.
        radii: Vec<f32>,
        /// One index for each primitive; without them positions are taken in turn.
        indices: Option<Vec<u32>>,
    },
    /// Linear swept spheres (LSS).
    LinearSweptSpheres {
        /// The centres of the end spheres.
        positions: Vec<[f32; 3]>,
        /// The radii, one for each position.
        radii: Vec<f32>,
        /// Two indices for each primitive (`List`) or one (`Successive`); optional for `List` only.
        indices: Option<Vec<u32>>,
        /// `VkRayTracingLssIndexingModeNV`.
        indexing: Indexing,
        /// `VkRayTracingLssPrimitiveEndCapsModeNV`.
        end_caps: EndCaps,
    },
}

/// The bytes that a list takes, spare room included.
pub(super) fn bytes_of<T>(list: &Vec<T>) -> usize {
    list.capacity() * size_of::<T>()
}

impl GeometryData {
    /// Which kind of primitive it holds (`VkGeometryTypeKHR`).
    #[doc(hidden)]
    pub fn kind(&self) -> GeometryKind {
        match self {
            Self::Triangles { .. } => GeometryKind::Triangles,
            Self::Aabbs(_) => GeometryKind::Aabbs,
            Self::Spheres { .. } => GeometryKind::Spheres,
            Self::LinearSweptSpheres { .. } => GeometryKind::LinearSweptSpheres,
        }
    }

    /// The bytes of its arrays.
    pub(super) fn memory_size(&self) -> usize {
        let index_bytes = |indices: &Option<Vec<u32>>| indices.as_ref().map_or(0, bytes_of);
        match self {
            Self::Triangles { vertices, indices, .. } => bytes_of(vertices) + index_bytes(indices),
            Self::Aabbs(boxes) => bytes_of(boxes),
            Self::Spheres { positions, radii, indices }
            | Self::LinearSweptSpheres { positions, radii, indices, .. } => {
                bytes_of(positions) + bytes_of(radii) + index_bytes(indices)
            }
        }
    }

    /// How many primitives it holds, inactive ones included. An incomplete last primitive does not
    /// count.
    #[doc(hidden)]
    pub fn primitive_count(&self) -> usize {
        match self {
            Self::Triangles { vertices, indices, .. } => {
                indices.as_ref().map_or(vertices.len(), Vec::len) / 3
            }
            Self::Aabbs(boxes) => boxes.len(),
            Self::Spheres { positions, indices, .. } => indices.as_ref().map_or(positions.len(), Vec::len),
            Self::LinearSweptSpheres { positions, indices, indexing, .. } => {
                let entries = indices.as_ref().map_or(positions.len(), Vec::len);
                match indexing {
                    Indexing::List => entries / 2,
                    Indexing::Successive => entries,
                }
            }
        }
    }
}

/// The first elements of a list, and how many there are.
struct Beginning<'a, T>(&'a [T]);

impl<T: fmt::Debug> fmt::Debug for Beginning<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 8;
        let shown = self.0.iter().take(SHOWN);
        match self.0.len() {
            ..=SHOWN => f.debug_list().entries(shown).finish(),
            all => f.debug_list().entries(shown).entry(&format_args!("... {all} in all")).finish(),
        }
    }
}

/// The kind, and the first elements of every list.
impl fmt::Debug for GeometryData {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let indices = |indices: &Option<Vec<u32>>| match indices {
            Some(indices) => format!("Some({:?})", Beginning(indices)),
            None => "None".to_owned(),
        };
        match self {
            Self::Triangles { vertices, indices: by, transform } => f
                .debug_struct("Triangles")
                .field("vertices", &Beginning(vertices))
                .field("indices", &format_args!("{}", indices(by)))
                .field("transform", transform)
                .finish(),
            Self::Aabbs(boxes) => f.debug_tuple("Aabbs").field(&Beginning(boxes)).finish(),
            Self::Spheres { positions, radii, indices: by } => f
                .debug_struct("Spheres")
                .field("positions", &Beginning(positions))
                .field("radii", &Beginning(radii))
                .field("indices", &format_args!("{}", indices(by)))
                .finish(),
            Self::LinearSweptSpheres { positions, radii, indices: by, indexing, end_caps } => f
                .debug_struct("LinearSweptSpheres")
                .field("positions", &Beginning(positions))
                .field("radii", &Beginning(radii))
                .field("indices", &format_args!("{}", indices(by)))
                .field("indexing", indexing)
                .field("end_caps", end_caps)
                .finish(),
        }
    }
}

/// `VkGeometryTypeKHR`: what a BLAS holds one kind of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GeometryKind {
    /// `VK_GEOMETRY_TYPE_TRIANGLES_KHR`
    Triangles,
    /// `VK_GEOMETRY_TYPE_AABBS_KHR`
    Aabbs,
    /// `VK_GEOMETRY_TYPE_SPHERES_NV`
    Spheres,
    /// `VK_GEOMETRY_TYPE_LINEAR_SWEPT_SPHERES_NV`
    LinearSweptSpheres,
}

impl fmt::Display for GeometryKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Triangles => "triangles",
            Self::Aabbs => "AABBs",
            Self::Spheres => "spheres",
            Self::LinearSweptSpheres => "linear swept spheres",
        })
    }
}

/// `VkRayTracingLssIndexingModeNV`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Indexing {
    /// Two indices for each primitive, its end vertices.
    List,
    /// One index k for each primitive, which spans vertices k and k+1.
    Successive,
}

/// `VkRayTracingLssPrimitiveEndCapsModeNV`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EndCaps {
    /// No caps: only the sides can be hit.
    None,
    /// The first primitive of a chain has both caps, each following one only its trailing cap.
    Chained,
}
