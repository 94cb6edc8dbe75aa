//! What a geometry is made of, decoded to f32 and u32.

/// The primitives of one geometry, in object space.
#[derive(Clone, Debug, PartialEq)]
pub enum GeometryData {
    /// Three vertices a primitive.
    Triangles {
        /// Vertex positions.
        vertices: Vec<[f32; 3]>,
        /// Three a primitive; without it, vertices are taken three by three.
        indices: Option<Vec<u32>>,
        /// The build-time geometry transform (row-major 3x4).
        transform: Option<[[f32; 4]; 3]>,
    },
    /// Axis-aligned boxes: minimum, then maximum.
    Aabbs(Vec<[f32; 6]>),
    /// Spheres.
    Spheres {
        /// Centres.
        positions: Vec<[f32; 3]>,
        /// One a position.
        radii: Vec<f32>,
        /// One a primitive; without it, positions are taken in turn.
        indices: Option<Vec<u32>>,
    },
    /// Linear swept spheres (LSS).
    LinearSweptSpheres {
        /// Sphere centres.
        positions: Vec<[f32; 3]>,
        /// One a position.
        radii: Vec<f32>,
        /// Two a primitive (`List`) or one (`Successive`); optional for `List` only.
        indices: Option<Vec<u32>>,
        /// `VkRayTracingLssIndexingModeNV`.
        indexing: Indexing,
        /// `VkRayTracingLssPrimitiveEndCapsModeNV`.
        end_caps: EndCaps,
    },
}

/// `VkRayTracingLssIndexingModeNV`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Indexing {
    /// Pairs of entries.
    List,
    /// One index k a primitive, which spans vertices k and k+1.
    Successive,
}

/// `VkRayTracingLssPrimitiveEndCapsModeNV`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EndCaps {
    /// Sides only.
    None,
    /// The first primitive of a chain has both caps, each following one only its trailing cap.
    Chained,
}
