//! A mesh file that is open: what is in it is known, and vertices are decoded when they are asked
//! for.

use std::path::{Path, PathBuf};

use crate::files::Files;
use crate::mesh::Mesh;
use crate::mesh::gltf::GltfFile;
use crate::mesh::listed::{AnimationTime, Listed, ListedPart, ModelNode, Numbers};
use crate::mesh::material::{FileCamera, Material, Texture, TextureSlot};
use crate::mesh::obj::ObjFile;
use crate::read::Named;
use anyhit_base::error::names::list_of;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::{InputLimit, InputLimits};

/// What a mesh file holds.
#[derive(Debug)]
pub struct Model {
    /// The file.
    pub path: PathBuf,
    /// The primitives of glTF, or the groups of OBJ, those of a mesh beside each other.
    pub parts: Vec<Part>,
    /// The meshes of glTF, or the objects of OBJ.
    pub meshes: Vec<MeshParts>,
    /// The nodes that have a mesh, in the order of a walk through the default scene.
    pub nodes: Vec<ModelNode>,
    /// The materials, in the file's order; at the end the default one if a part has none.
    pub materials: Vec<Material>,
    /// The textures, in the file's order.
    pub textures: Vec<Texture>,
    /// The cameras of the default scene.
    pub cameras: Vec<FileCamera>,
    /// The content of the file that is not read, each kind with its number.
    pub unread: Vec<String>,
    source: Source,
}

#[derive(Debug)]
enum Source {
    Gltf(Box<GltfFile>),
    Obj(ObjFile),
}

/// The two formats of mesh files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// glTF 2.0, as text or binary.
    Gltf,
}

impl MeshFormat {
    /// The format by the extension of a file's name.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "obj" => Some(Self::Obj),
            "gltf" | "glb" => Some(Self::Gltf),
            _ => None,
        }
    }
}

/// A primitive of glTF, or a group of OBJ: what becomes a geometry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The mesh's name, and where it has several parts `.` and the number among them.
    pub name: String,
    /// The mesh that it belongs to.
    pub mesh: usize,
    /// Its material, an index into [`Model::materials`].
    pub material: usize,
    /// How many vertices it has.
    pub vertices: usize,
    /// How many triangles it has.
    pub triangles: usize,
    /// The names of its attributes in a scene: `position`, `normal`, `texcoord_0`, ...
    pub attributes: Vec<String>,
}

/// A mesh of glTF or an object of OBJ: what becomes a BLAS.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshParts {
    /// Its name, which no other mesh of the file has.
    pub name: String,
    /// The name in the file, which others may have, too.
    pub given: Option<String>,
    /// Its first part.
    pub first: usize,
    /// How many parts it has.
    pub count: usize,
}

impl Model {
    /// Opens a file in its rest state.
    ///
    /// # Errors
    /// As [`Model::open_at`].
    pub fn open(format: MeshFormat, path: &Path, bytes: Vec<u8>, files: &dyn Files) -> Result<Self> {
        Self::open_at(format, path, bytes, files, None)
    }

    /// Opens a file, at a time of an animation if one is selected.
    ///
    /// # Errors
    /// `InvalidMesh` for a broken file, or one beyond a limit; `UnsupportedFile` for glTF of
    /// another version, without triangles or with an extension that changes them; `Io` where a file
    /// that it names cannot be read.
    pub fn open_at(
        format: MeshFormat,
        path: &Path,
        bytes: Vec<u8>,
        files: &dyn Files,
        time: Option<&AnimationTime>,
    ) -> Result<Self> {
        let (listed, source) = match format {
            MeshFormat::Gltf => {
                let (listed, file) = GltfFile::open(path, bytes, files, time)?;
                (listed, Source::Gltf(Box::new(file)))
            }
            MeshFormat::Obj if time.is_some() => {
                let error = Error::new(ErrorKind::InvalidMesh, "OBJ files have no animations");
                return Err(error.at(Place::File(path.to_path_buf())));
            }
            MeshFormat::Obj => {
                let (listed, file) = ObjFile::open(path, &bytes, files)?;
                (listed, Source::Obj(file))
            }
        };
        let Listed { meshes: listed, nodes, mut materials, textures, cameras, unread } = listed;
        let default = materials.len();
        let has_default = listed.iter().flat_map(|(_, parts)| parts).any(|part| part.material.is_none());
        if has_default {
            materials.push(Material::default());
        }
        let (mut parts, mut meshes) = (Vec::new(), Vec::new());
        let names = unique_names(listed.iter().map(|(name, _)| name.as_deref()));
        for (at, ((given, of_mesh), name)) in listed.into_iter().zip(names).enumerate() {
            let (first, count) = (parts.len(), of_mesh.len());
            for (k, part) in of_mesh.into_iter().enumerate() {
                let ListedPart { material, vertices, triangles, attributes } = part;
                let name = if count == 1 { name.clone() } else { format!("{name}.{k}") };
                let material = material.unwrap_or(default);
                parts.push(Part { name, mesh: at, material, vertices, triangles, attributes });
            }
            meshes.push(MeshParts { name, given, first, count });
        }
        let path = path.to_path_buf();
        Ok(Self { path, parts, meshes, nodes, materials, textures, cameras, unread, source })
    }

    /// The triangles of a part.
    ///
    /// # Errors
    /// `InvalidMesh` for an index beyond the vertices.
    pub fn triangles(&self, part: usize) -> Result<Mesh> {
        match &self.source {
            Source::Gltf(file) => {
                let mesh = self.parts[part].mesh;
                file.triangles(mesh, part - self.meshes[mesh].first).map_err(|error| self.at(error))
            }
            Source::Obj(file) => Ok(file.triangles(part)),
        }
    }

    /// The numbers of an attribute of a part, which has it.
    ///
    /// # Errors
    /// `InvalidMesh` where they cannot be read.
    pub fn attribute(&self, part: usize, name: &str) -> Result<Numbers> {
        match &self.source {
            Source::Gltf(file) => {
                let mesh = self.parts[part].mesh;
                let numbers = file.attribute(mesh, part - self.meshes[mesh].first, name);
                numbers.map_err(|error| self.at(error))
            }
            Source::Obj(file) => Ok(file.attribute(part, name)),
        }
    }

    /// The triangles of several parts in one, each with a transform.
    ///
    /// # Errors
    /// As [`Model::triangles`]; also where all together are beyond a limit, or none is there.
    pub fn merged(&self, parts: &[(usize, glam::DMat4)], limits: &InputLimits) -> Result<Mesh> {
        let count =
            |of: fn(&Part) -> usize| parts.iter().map(|(part, _)| of(&self.parts[*part]) as u64).sum();
        let check =
            |limit, count| limits.check(limit, count, ErrorKind::InvalidMesh).map_err(|error| self.at(error));
        check(InputLimit::MeshVertices, count(|part| part.vertices))?;
        check(InputLimit::MeshTriangles, count(|part| part.triangles))?;
        let mut all = Mesh::default();
        for (part, transform) in parts {
            let mut mesh = self.triangles(*part)?;
            if *transform != glam::DMat4::IDENTITY {
                for vertex in &mut mesh.vertices {
                    let point = transform.transform_point3(glam::Vec3::from(*vertex).as_dvec3());
                    *vertex = point.as_vec3().to_array();
                }
            }
            if parts.len() == 1 {
                all = mesh;
                break;
            }
            let Ok(base) = u32::try_from(all.vertices.len() + mesh.vertices.len()) else {
                let message = "the mesh has more vertices than 32-bit indices can address";
                return Err(self.at(Error::new(ErrorKind::InvalidMesh, message)));
            };
            let base = base - mesh.vertices.len() as u32;
            all.vertices.append(&mut mesh.vertices);
            all.indices.extend(mesh.indices.iter().map(|index| base + index));
        }
        if all.indices.is_empty() {
            return Err(self.at(Error::new(ErrorKind::InvalidMesh, "the file has no triangles")));
        }
        Ok(all)
    }

    /// The parts of all nodes, each with its node's transform.
    ///
    /// # Errors
    /// `InvalidMesh` where they are more than vertices may be.
    pub fn placed(&self, limits: &InputLimits) -> Result<Vec<(usize, glam::DMat4)>> {
        let count = self.nodes.iter().map(|node| self.meshes[node.mesh].count as u64).sum();
        // Each has a vertex.
        let checked = limits.check(InputLimit::MeshVertices, count, ErrorKind::InvalidMesh);
        checked.map_err(|error| self.at(error))?;
        let parts = |node: &ModelNode| {
            let (mesh, world) = (&self.meshes[node.mesh], node.world);
            (mesh.first..mesh.first + mesh.count).map(move |part| (part, world))
        };
        Ok(self.nodes.iter().flat_map(parts).collect())
    }

    fn at(&self, error: Error) -> Error {
        error.or_at(Place::File(self.path.clone()))
    }

    /// The texture of a part's material for a purpose.
    pub fn texture(&self, part: usize, slot: TextureSlot) -> Option<&Texture> {
        let material = &self.materials[self.parts[part].material];
        material.textures[slot as usize].map(|texture| &self.textures[texture])
    }

    /// Whether the texels of a texture are colours for some material that uses it; `None` where
    /// none does.
    pub fn texture_has_colors(&self, texture: usize) -> Option<bool> {
        let slots = TextureSlot::NAMES.iter().map(|(_, slot)| *slot);
        let is_used = |slot: &TextureSlot| {
            self.materials.iter().any(|material| material.textures[*slot as usize] == Some(texture))
        };
        slots.filter(is_used).map(TextureSlot::is_color).reduce(|one, other| one | other)
    }

    /// The names of all meshes with their parts, for messages.
    pub fn contents(&self) -> String {
        let parts = |mesh: &MeshParts| match mesh.count {
            1 => mesh.name.clone(),
            count => format!("{} ({count} primitives)", mesh.name),
        };
        let all: Vec<String> = self.meshes.iter().map(parts).collect();
        list_of(all.iter().map(String::as_str))
    }

    /// The parts of the meshes with a name in the file.
    ///
    /// # Errors
    /// `InvalidMesh` that lists the meshes if there is none.
    pub fn parts_named(&self, name: &str, what: &str) -> Result<Vec<usize>> {
        let named = |mesh: &&MeshParts| mesh.name == name || mesh.given.as_deref() == Some(name);
        let found: Vec<_> = self.meshes.iter().filter(named).collect();
        let parts: Vec<usize> = found.iter().flat_map(|mesh| mesh.first..mesh.first + mesh.count).collect();
        if !found.is_empty() {
            return Ok(parts);
        }
        let plural = if what == "mesh" { "meshes" } else { "objects" };
        let with = if what == "mesh" { "" } else { " with triangles" };
        let error = Error::new(ErrorKind::InvalidMesh, format!("no {what} `{name}`{with}"));
        Err(self.at(error.note(format!("{plural} in the file: {}", self.contents()))))
    }
}

/// Names for meshes: their own; of meshes that share one, or have none, with `#` and their number.
fn unique_names<'n>(given: impl Iterator<Item = Option<&'n str>> + Clone) -> Vec<String> {
    let mut counts = std::collections::HashMap::new();
    for name in given.clone() {
        *counts.entry(name).or_insert(0_u32) += 1;
    }
    let name = |(at, name): (usize, Option<&str>)| match name {
        Some(own) if !own.is_empty() && counts[&name] == 1 => own.to_string(),
        Some(own) if !own.is_empty() => format!("{own}#{at}"),
        _ => format!("mesh#{at}"),
    };
    given.enumerate().map(name).collect()
}
