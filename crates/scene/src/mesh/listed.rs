//! What the readers of mesh files list, before it is a model.

use crate::mesh::material::{FileCamera, Material, Texture};

/// A node with a mesh: what becomes an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelNode {
    /// Its name in the file.
    pub name: Option<String>,
    /// Its mesh.
    pub mesh: usize,
    /// Object to world.
    pub world: glam::DMat4,
}

/// The content of a file before its names are made.
pub(super) struct Listed {
    /// The name of each mesh, and of its parts all but the name.
    pub meshes: Vec<(Option<String>, Vec<ListedPart>)>,
    pub nodes: Vec<ModelNode>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub cameras: Vec<FileCamera>,
    /// The content that is not read, each kind with its number.
    pub unread: Vec<String>,
}

/// A part without a name.
pub(super) struct ListedPart {
    pub material: Option<usize>,
    pub vertices: usize,
    pub triangles: usize,
    pub attributes: Vec<String>,
}

/// The numbers of an attribute: so many for each vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// How many each vertex has, 1 to 4.
    pub components: usize,
    /// All of them, one vertex after the other.
    pub values: Vec<f32>,
}
