//! Stand-ins for the readers that this build leaves out: opening a file is an error, and there is
//! no open file.

use std::path::Path;

use crate::files::Files;
use crate::mesh::Mesh;
#[cfg(not(feature = "gltf"))]
use crate::mesh::listed::AnimationTime;
use crate::mesh::listed::{Listed, Numbers};
use anyhit_base::error::{Error, ErrorKind, Place, Result, feature_note};

/// The error that files of a format cannot be read.
fn missing(format: &str, feature: &str, path: &Path) -> Error {
    Error::new(ErrorKind::UnsupportedTool, format!("this build of anyhit does not read {format} files"))
        .at(Place::File(path.to_path_buf()))
        .note(feature_note(feature))
}

/// An open glTF file, of which there is none.
#[cfg(not(feature = "gltf"))]
#[derive(Debug)]
pub(super) enum GltfFile {}

#[cfg(not(feature = "gltf"))]
impl GltfFile {
    pub(super) fn open(
        path: &Path,
        _: Vec<u8>,
        _: &dyn Files,
        _: Option<&AnimationTime>,
    ) -> Result<(Listed, Self)> {
        Err(missing("glTF", "gltf", path))
    }

    pub(super) fn triangles(&self, _mesh: usize, _primitive: usize) -> Result<Mesh> {
        match *self {}
    }

    pub(super) fn attribute(&self, _mesh: usize, _primitive: usize, _name: &str) -> Result<Numbers> {
        match *self {}
    }
}

/// An open OBJ file, of which there is none.
#[cfg(not(feature = "obj"))]
#[derive(Debug)]
pub(super) enum ObjFile {}

#[cfg(not(feature = "obj"))]
impl ObjFile {
    pub(super) fn open(path: &Path, _: &[u8], _: &dyn Files) -> Result<(Listed, Self)> {
        Err(missing("OBJ", "obj", path))
    }

    pub(super) fn triangles(&self, _group: usize) -> Mesh {
        match *self {}
    }

    pub(super) fn attribute(&self, _group: usize, _name: &str) -> Numbers {
        match *self {}
    }
}
