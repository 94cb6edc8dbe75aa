//! Triangles from OBJ and glTF files, with what belongs to them: normals, texture coordinates,
//! materials, textures, nodes and cameras.

pub mod gltf;
pub mod listed;
pub mod material;
pub mod model;
pub mod obj;
mod uri;

/// Triangles with shared vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The positions of the vertices.
    pub vertices: Vec<[f32; 3]>,
    /// Three a triangle.
    pub indices: Vec<u32>,
}
