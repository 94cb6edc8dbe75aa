//! Triangles from OBJ and glTF files.

pub mod gltf;
pub mod obj;

/// Triangles with shared vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The positions of the vertices.
    pub vertices: Vec<[f32; 3]>,
    /// Three a triangle.
    pub indices: Vec<u32>,
}
