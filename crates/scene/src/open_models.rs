//! The mesh files of a scene, opened once each, and what a scene selects of them.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::files::Files;
use crate::mesh::listed::AnimationTime;
use crate::mesh::model::{MeshFormat, Model};
use crate::read::Spanned;
use crate::read_file::file_error;
use anyhit_base::error::{Error, Result};

/// The mesh files of a scene, each of which is opened once.
#[derive(Debug, Default)]
pub struct OpenModels(Mutex<HashMap<ModelKey, Arc<OnceLock<Opened>>>>);

/// A file, and the bits of the time and the name of an animation.
type ModelKey = (PathBuf, Option<(u32, Option<String>)>);

/// A mesh file, or why it could not be opened.
type Opened = Result<Arc<Model>, Unopened>;

/// Why a mesh file could not be opened: it could not be read, or it is broken.
#[derive(Clone, Debug)]
enum Unopened {
    Unread(Error),
    Broken(Error),
}

impl OpenModels {
    /// Opens a file that a scene names.
    ///
    /// # Errors
    /// As [`Model::open`]; also where the name does not say what the file is.
    pub fn open(
        &self,
        file: &Spanned<String>,
        time: Option<&AnimationTime>,
        files: &dyn Files,
    ) -> Result<Arc<Model>> {
        match MeshFormat::of(Path::new(&file.value)) {
            Some(format) => self.open_as(format, file, time, files),
            None => Err(file
                .span
                .error(format!("`{}` is not a mesh file", file.value))
                .note("mesh files end in .gltf, .glb or .obj")),
        }
    }

    /// Opens a file of a format that the scene says. A thread that needs a file which another one
    /// opens waits for it.
    ///
    /// # Errors
    /// As [`Model::open`].
    pub fn open_as(
        &self,
        format: MeshFormat,
        file: &Spanned<String>,
        time: Option<&AnimationTime>,
        files: &dyn Files,
    ) -> Result<Arc<Model>> {
        let path = file.span.source.sibling(&file.value);
        let key = (path.clone(), time.map(AnimationTime::key));
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let opened = known.entry(key).or_default().clone();
        drop(known);
        let opened = opened.get_or_init(|| {
            let bytes = files.read(&path).map_err(Unopened::Unread)?;
            Model::open_at(format, &path, bytes, files, time).map(Arc::new).map_err(Unopened::Broken)
        });
        opened.clone().map_err(|unopened| match unopened {
            Unopened::Unread(error) => file_error(error, &file.span, &path),
            Unopened::Broken(error) => error.at_with(file.span.place(), "named here"),
        })
    }

    /// Returns the models that are open, in no order.
    pub fn opened(&self) -> Vec<Arc<Model>> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.values().filter_map(|opened| opened.get()?.as_ref().ok().cloned()).collect()
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
