//! The mesh files of a scene, opened once each, and what a scene selects of them.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::Result;
use crate::scene::files::Files;
use crate::scene::mesh::model::{MeshFormat, Model};
use crate::scene::read::Spanned;
use crate::scene::read_file::read;

/// The mesh files of a scene, each of which is opened once.
#[derive(Debug, Default)]
pub struct OpenModels(RefCell<HashMap<PathBuf, Arc<Model>>>);

impl OpenModels {
    /// Opens a file that a scene names.
    ///
    /// # Errors
    /// As [`Model::open`]; also where the name does not say what the file is.
    pub fn open(&self, file: &Spanned<String>, files: &dyn Files) -> Result<Arc<Model>> {
        match MeshFormat::of(Path::new(&file.value)) {
            Some(format) => self.open_as(format, file, files),
            None => Err(file
                .span
                .error(format!("`{}` is not a mesh file", file.value))
                .note("mesh files end in .gltf, .glb or .obj")),
        }
    }

    /// Opens a file of a format that the scene says.
    ///
    /// # Errors
    /// As [`Model::open`].
    pub fn open_as(
        &self,
        format: MeshFormat,
        file: &Spanned<String>,
        files: &dyn Files,
    ) -> Result<Arc<Model>> {
        let path = file.span.source.sibling(&file.value);
        if let Some(known) = self.0.borrow().get(&path) {
            return Ok(known.clone());
        }
        let bytes = read(files, &file.value, &file.span)?;
        let model = Model::open(format, &path, bytes, files);
        let model = Arc::new(model.map_err(|error| error.at_with(file.span.place(), "named here"))?);
        self.0.borrow_mut().insert(path, model.clone());
        Ok(model)
    }
}

/// What a scene calls a mesh, in pieces of data, textures and samplers.
#[derive(Clone, Debug)]
pub struct MeshSelection {
    /// The file.
    pub model: Arc<Model>,
    /// Its geometries, in the order of the file.
    pub parts: Vec<usize>,
    /// Whether they are one geometry, so that indices count all vertices.
    pub merged: bool,
    /// The names of these geometries in the scene.
    pub geometries: HashSet<String>,
}
