//! What the data of a scene may name: files, meshes, the picture.

use crate::files::Files;
use crate::mesh_piece::SceneMeshes;
use crate::open_models::OpenModels;

/// What data may name.
#[derive(Clone, Copy)]
#[allow(missing_debug_implementations, reason = "it borrows a trait object")]
pub struct DataSources<'a> {
    /// Files beside the scene.
    pub files: &'a dyn Files,
    /// The width of the picture divided by its height, for cameras.
    pub aspect: f32,
    /// The mesh files of the scene.
    pub models: &'a OpenModels,
    /// Its meshes and instances; `None` where they are not known yet.
    pub meshes: Option<SceneMeshes<'a>>,
}

impl<'a> DataSources<'a> {
    /// Files alone, without meshes.
    pub fn files(files: &'a dyn Files, models: &'a OpenModels) -> Self {
        Self { files, aspect: 1.0, models, meshes: None }
    }
}
