//! Triangles from OBJ and glTF files, with what belongs to them: normals, texture coordinates,
//! materials, textures, nodes and cameras.

#[cfg(not(all(feature = "gltf", feature = "obj")))]
mod absent;
#[cfg(feature = "gltf")]
pub mod gltf;
pub mod listed;
pub mod material;
pub mod model;
#[cfg(feature = "obj")]
pub mod obj;
#[cfg(feature = "gltf")]
mod uri;

#[cfg(not(feature = "gltf"))]
use absent as gltf;
#[cfg(not(feature = "obj"))]
use absent as obj;

#[cfg(any(feature = "gltf", feature = "obj"))]
fn invalid(message: impl Into<String>) -> anyhit_base::error::Error {
    anyhit_base::error::Error::new(anyhit_base::error::ErrorKind::InvalidMesh, message)
}

/// Triangles with shared vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The positions of the vertices.
    pub vertices: Vec<[f32; 3]>,
    /// Three a triangle.
    pub indices: Vec<u32>,
}
