//! glTF 2.0 (`.gltf` and `.glb`).

use std::path::Path;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::files::Files;
use crate::mesh::Mesh;
use crate::mesh::gltf::accessor::Expected;
use crate::mesh::gltf::animation::SelectedAnimation;
use crate::mesh::gltf::deform::Pose;
use crate::mesh::gltf::document::{ComponentType, Document, Mode, Primitive, Shape};
use crate::mesh::gltf::extension::DRACO;
use crate::mesh::gltf::nodes::Walk;
use crate::mesh::gltf::poses::{PosedMesh, Poses};
use crate::mesh::gltf::unread::Ignored;
use crate::mesh::invalid;
use crate::mesh::listed::{AnimationTime, Listed, ListedPart, Numbers};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::{InputLimit, InputLimits};

mod accessor;
mod animation;
mod buffers;
mod container;
mod deform;
mod document;
mod extension;
mod material;
mod nodes;
mod poses;
mod unread;

/// An open file.
#[derive(Debug)]
pub struct GltfFile {
    data: Data,
    /// The listed meshes.
    meshes: Vec<PosedMesh>,
}

/// A document with its buffers.
#[derive(Debug)]
struct Data {
    document: Document,
    /// The content of the buffers that are used.
    buffers: Vec<Option<Arc<Vec<u8>>>>,
    limits: InputLimits,
}

/// Vertices and triangles listed so far, and elements of accessors without a buffer view.
#[derive(Default)]
struct Counts {
    vertices: u64,
    triangles: u64,
    zeros: u64,
}

/// The entry of a list of the document that `user`, a path in it, names.
fn get<'a, T>(list: &'a [T], at: usize, name: &str, user: &str) -> Result<&'a T> {
    let message = || format!("`{user}` names `{name}[{at}]`, but there are {}", list.len());
    list.get(at).ok_or_else(|| invalid(message()))
}

/// Reads a part of the document that was not read with it.
fn read_value<T: DeserializeOwned>(value: &Value, path: &str) -> Result<T> {
    serde_path_to_error::deserialize(value).map_err(|error| match error.path().to_string().as_str() {
        "." => invalid(format!("`{path}`: {}", error.inner())),
        own => invalid(format!("`{path}.{own}`: {}", error.inner())),
    })
}

fn primitive_path(mesh: usize, primitive: usize) -> String {
    format!("meshes[{mesh}].primitives[{primitive}]")
}

impl GltfFile {
    /// Opens a file, at a time of an animation or in its rest state, and lists what is in it.
    ///
    /// # Errors
    /// `InvalidMesh` for a broken file, or one beyond a limit; `UnsupportedFile` for a file without
    /// triangles, of another version, or whose triangles an extension defines that is not read.
    pub(super) fn open(
        path: &Path,
        bytes: Vec<u8>,
        files: &dyn Files,
        time: Option<&AnimationTime>,
    ) -> Result<(Listed, Self)> {
        let open = || {
            let (mut document, binary) = container::parse(bytes, &files.limits())?;
            unread::check_required(&document)?;
            let animation = time.map(|time| SelectedAnimation::new(&document, time)).transpose()?;
            let used = buffers::used(&document, animation.iter().flat_map(SelectedAnimation::accessors));
            let buffers = buffers::load(path, &mut document, &used, binary, files)?;
            let mut data = Data { document, buffers, limits: files.limits() };
            animation.iter().try_for_each(|animation| animation.apply(&mut data))?;
            let animations = data.document.animations.len() - usize::from(animation.is_some());
            data.list(path, animations)
        };
        open().map_err(|error| error.at(Place::File(path.to_path_buf())))
    }

    /// The triangles of a primitive.
    ///
    /// # Errors
    /// `InvalidMesh` for an index beyond the vertices.
    pub(super) fn triangles(&self, mesh: usize, part: usize) -> Result<Mesh> {
        let (primitive, pose, path) = self.primitive(mesh, part);
        self.data.triangles(primitive, pose, &path)
    }

    /// The numbers of an attribute of a primitive.
    ///
    /// # Errors
    /// `InvalidMesh` for an accessor that cannot be read.
    pub(super) fn attribute(&self, mesh: usize, part: usize, name: &str) -> Result<Numbers> {
        let (primitive, pose, path) = self.primitive(mesh, part);
        let mut names = primitive.attributes.keys();
        let found = names.find(|own| own.to_ascii_lowercase() == name);
        let found = found.ok_or_else(|| invalid(format!("no attribute `{name}`")))?;
        self.data.attribute(primitive, found, pose, &path)
    }

    fn primitive(&self, mesh: usize, part: usize) -> (&Primitive, &Pose, String) {
        let PosedMesh { mesh, primitives, pose, .. } = &self.meshes[mesh];
        let at = primitives[part];
        (&self.data.document.meshes[*mesh].primitives[at], pose, primitive_path(*mesh, at))
    }
}

impl Data {
    /// Lists the content; `animations` are those that are not read.
    fn list(self, path: &Path, animations: usize) -> Result<(Listed, GltfFile)> {
        let Walk { placed, cameras, hidden, .. } = Walk::new(&self)?;
        let mut ignored = Ignored { animations, hidden, skins: 0 };
        let (meshes, nodes) = Poses::of(&self, placed, &mut ignored)?;
        let mut counts = Counts::default();
        let mut listed = Vec::new();
        for PosedMesh { mesh, name, primitives, .. } in &meshes {
            let parts = primitives.iter().map(|at| self.list_primitive(*mesh, *at, &mut counts));
            listed.push((name.clone(), parts.collect::<Result<_>>()?));
        }
        let unread = unread::list(&self.document, &ignored);
        let has_primitives = self.document.meshes.iter().any(|mesh| !mesh.primitives.is_empty());
        if has_primitives && counts.triangles == 0 {
            let error = Error::new(ErrorKind::UnsupportedFile, "the model has no triangles");
            return Err(error.note(format!("not read: {}", unread.join("; "))));
        }
        let (materials, textures) = (self.materials()?, self.textures(path)?);
        let listed = Listed { meshes: listed, nodes, materials, textures, cameras, unread };
        Ok((listed, GltfFile { data: self, meshes }))
    }

    /// The weights of the morph targets of a mesh, without zeros at the end.
    fn weights(&self, mesh: usize, weights: &[f32]) -> Vec<f32> {
        let weights = &weights[..weights.len().min(self.targets(mesh))];
        let end = weights.iter().rposition(|weight| *weight != 0.0).map_or(0, |last| last + 1);
        weights[..end].to_vec()
    }

    /// The number of morph targets of a mesh.
    fn targets(&self, mesh: usize) -> usize {
        let primitives = self.document.meshes.get(mesh).map_or(&[][..], |mesh| &mesh.primitives);
        primitives.iter().map(|primitive| primitive.targets.len()).max().unwrap_or(0)
    }

    fn list_primitive(&self, mesh: usize, at: usize, counts: &mut Counts) -> Result<ListedPart> {
        let primitive = &self.document.meshes[mesh].primitives[at];
        let path = primitive_path(mesh, at);
        let vertices = self.vertex_count(primitive, &path)?;
        let accessors = || primitive.attributes.get("POSITION").into_iter().chain(&primitive.indices);
        let accessors = || accessors().filter_map(|at| self.document.accessors.get(*at));
        let has_data = accessors().all(|one| one.buffer_view.is_some() || one.sparse.is_some());
        if primitive.extensions.contains_key(DRACO) && !has_data {
            return Err(buffers::compressed(DRACO, &path));
        }
        self.elements(
            primitive.attributes["POSITION"],
            &self.position_types(),
            &format!("{path}.attributes.POSITION"),
        )?;
        self.corners(primitive, &path)?;
        for accessor in accessors().filter(|accessor| accessor.buffer_view.is_none()) {
            counts.zeros += accessor.count as u64;
        }
        let triangles = self.triangle_count(primitive, vertices);
        counts.vertices += vertices as u64;
        counts.triangles += triangles as u64;
        self.limits.check(InputLimit::MeshSparse, counts.zeros, ErrorKind::InvalidMesh)?;
        self.limits.check(InputLimit::MeshVertices, counts.vertices, ErrorKind::InvalidMesh)?;
        self.limits.check(InputLimit::MeshTriangles, counts.triangles, ErrorKind::InvalidMesh)?;
        if let Some(material) = primitive.material {
            get(&self.document.materials, material, "materials", &path)?;
        }
        let attributes = primitive.attributes.keys().map(|name| name.to_ascii_lowercase()).collect();
        Ok(ListedPart { material: primitive.material, vertices, triangles, attributes })
    }

    /// The indices of a primitive that has some.
    fn corners(&self, primitive: &Primitive, path: &str) -> Result<Option<accessor::Elements<'_>>> {
        use ComponentType as T;
        // glTF 2.0, 3.7.2.1
        let expected = Expected { shapes: &[Shape::Scalar], components: &[T::U8, T::U16, T::U32] };
        let elements = |at: usize| self.elements(at, &expected, &format!("{path}.indices"));
        primitive.indices.map(elements).transpose()
    }

    fn triangle_count(&self, primitive: &Primitive, vertices: usize) -> usize {
        let corners = primitive.indices.and_then(|at| self.document.accessors.get(at));
        let corners = corners.map_or(vertices, |indices| indices.count);
        match primitive.mode {
            Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
            _ => corners / 3,
        }
    }

    fn triangles(&self, primitive: &Primitive, pose: &Pose, path: &str) -> Result<Mesh> {
        let vertices = self.positions(primitive, pose, path)?;
        let given = vertices.len();
        let corners = match self.corners(primitive, path)? {
            None => (0..given as u32).collect(),
            Some(elements) => {
                let corners = elements.indices();
                let greatest = corners.iter().fold(0, |greatest, &index| index.max(greatest));
                if greatest as usize >= given
                    && let Some(index) = corners.iter().find(|index| **index as usize >= given)
                {
                    return Err(invalid(format!(
                        "index {index} is out of range: there are {given} vertices in `{path}`"
                    )));
                }
                corners
            }
        };
        Ok(Mesh { vertices, indices: cut(primitive.mode, corners) })
    }
}

/// Cuts the corners of a primitive into triangles: strips alternate their winding, fans share their
/// first corner (glTF 2.0, 3.7.2.1).
fn cut(mode: Mode, mut corners: Vec<u32>) -> Vec<u32> {
    match mode {
        Mode::TriangleStrip => {
            let triangles = corners.windows(3).enumerate();
            let cut = triangles.map(|(at, three)| match at % 2 {
                0 => [three[0], three[1], three[2]],
                _ => [three[0], three[2], three[1]],
            });
            cut.collect::<Vec<_>>().into_flattened()
        }
        Mode::TriangleFan => {
            let edges = corners.get(1..).unwrap_or_default().windows(2);
            edges.map(|edge| [corners[0], edge[0], edge[1]]).collect::<Vec<_>>().into_flattened()
        }
        _ => {
            corners.truncate(corners.len() / 3 * 3);
            corners
        }
    }
}

#[cfg(test)]
mod content_tests;
#[cfg(test)]
mod pose_tests;
#[cfg(test)]
mod test_file;
#[cfg(test)]
mod tests;
