//! The buffers of a glTF file: its binary chunk, data URIs and files beside it.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;

use crate::files::{Files, sibling};
use crate::mesh::gltf::document::{Accessor, Document};
use crate::mesh::gltf::extension::{INSTANCING, MESHOPT};
use crate::mesh::gltf::{Data, get, invalid};
use crate::mesh::uri::Uri;
use anyhit_base::error::{Error, ErrorKind, Result};

/// The content of each buffer that is used. Several of one file share it.
pub(super) fn load(
    path: &Path,
    document: &mut Document,
    used: &HashSet<usize>,
    binary: Option<Vec<u8>>,
    files: &dyn Files,
) -> Result<Vec<Option<Arc<Vec<u8>>>>> {
    let mut binary = binary.map(Arc::new);
    let mut named: HashMap<PathBuf, Arc<Vec<u8>>> = HashMap::new();
    let mut all = Vec::new();
    for (at, buffer) in document.buffers.iter_mut().enumerate() {
        // glTF 2.0, 3.6.1.2: the binary chunk is the first buffer, if that has no URI.
        let chunk = binary.take();
        let bytes = match buffer.uri.take() {
            _ if !used.contains(&at) => None,
            None => chunk,
            Some(uri) => Some(match Uri::parse(&uri).map_err(|error| error.context(uri_path(at)))? {
                Uri::Data(bytes) => Arc::new(bytes),
                Uri::File(name) => {
                    let name = sibling(path, &name);
                    match named.get(&name) {
                        Some(bytes) => bytes.clone(),
                        None => {
                            let read = files.read(&name).map_err(|error| error.context(uri_path(at)))?;
                            let bytes = Arc::new(read);
                            named.insert(name, bytes.clone());
                            bytes
                        }
                    }
                }
            }),
        };
        if let Some(bytes) = &bytes
            && bytes.len() < buffer.byte_length
        {
            return Err(invalid(format!(
                "`buffers[{at}]` has {} bytes, but its `byteLength` is {}",
                bytes.len(),
                buffer.byte_length
            )));
        }
        all.push(bytes);
    }
    Ok(all)
}

fn uri_path(buffer: usize) -> String {
    format!("`buffers[{buffer}].uri`")
}

/// The buffers that the primitives, skins, instances and textures of a document use, and other
/// accessors.
pub(super) fn used(document: &Document, others: impl Iterator<Item = usize>) -> HashSet<usize> {
    let mut accessors: HashSet<usize> = others.collect();
    for primitive in document.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        accessors.extend(primitive.attributes.values().chain(&primitive.indices));
        accessors.extend(primitive.targets.iter().flat_map(|target| target.values()));
    }
    accessors.extend(document.skins.iter().filter_map(|skin| skin.inverse_bind_matrices));
    for node in &document.nodes {
        let instances = node.extensions.get(INSTANCING).and_then(|one| one["attributes"].as_object());
        accessors.extend(instances.into_iter().flat_map(|one| one.values()).filter_map(as_index));
    }
    let views = |accessor: &Accessor| {
        let sparse =
            accessor.sparse.as_ref().map(|sparse| [sparse.indices.buffer_view, sparse.values.buffer_view]);
        accessor.buffer_view.into_iter().chain(sparse.into_iter().flatten())
    };
    let accessors = accessors.into_iter().filter_map(|at| document.accessors.get(at));
    let images = document.textures.iter().filter_map(|texture| document.images.get(texture.source?));
    let images = images.filter_map(|image| image.buffer_view);
    let views = accessors.flat_map(views).chain(images).filter_map(|at| document.buffer_views.get(at));
    views.map(|view| view.buffer).collect()
}

fn as_index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|index| index.try_into().ok())
}

impl Data {
    /// The bytes of a buffer view and its stride.
    ///
    /// # Errors
    /// `UnsupportedFile` for a compressed view; `InvalidMesh` for one beyond its buffer.
    pub(super) fn view(&self, at: usize, user: &str) -> Result<(&[u8], Option<usize>)> {
        let path = format!("bufferViews[{at}]");
        let view = get(&self.document.buffer_views, at, "bufferViews", user)?;
        get(&self.document.buffers, view.buffer, "buffers", &path)?;
        let Some(bytes) = &self.buffers[view.buffer] else {
            if let Some(name) = MESHOPT.iter().find(|name| view.extensions.contains_key(**name)) {
                return Err(compressed(name, &path));
            }
            let message = format!("`{path}` uses `buffers[{}]`, which has no data", view.buffer);
            return Err(invalid(message).note(
                "help: set its `uri`: only `buffers[0]` of a binary file is the chunk of the type BIN",
            ));
        };
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| bytes.get(view.byte_offset..end));
        let bytes = bytes.ok_or_else(|| {
            invalid(format!("`{path}` extends beyond its buffer, `buffers[{}]`", view.buffer))
        })?;
        Ok((bytes, view.byte_stride))
    }
}

/// The error of data that an extension compresses.
pub(super) fn compressed(extension: &str, path: &str) -> Error {
    let message = format!("{extension}: the compressed data of `{path}` is not read");
    Error::new(ErrorKind::UnsupportedFile, message).note("help: export the model without compression")
}
