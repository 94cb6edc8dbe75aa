//! glTF 2.0 (`.gltf` and `.glb`), read by the `gltf` crate.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gltf::accessor::{DataType, Dimensions, Item, Iter};
use gltf::mesh::Mode;
use gltf::mesh::util::ReadIndices;
use gltf::{Accessor, Document, Glb, Gltf, Node, Primitive, Semantic};

use crate::files::Files;
use crate::mesh::Mesh;
use crate::mesh::listed::{Listed, ListedPart, ModelNode, Numbers};
use crate::mesh::material::{
    FileCamera, Material, PictureSource, Projection, Texture, TextureMapping, TextureSlot,
};
use crate::mesh::uri::{base64, percent_decoded};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::{InputLimit, InputLimits, contained, threads};
use anyhit_engine::machine::sampler::{AddressMode, Filter, Sampler};

/// How deep nodes may be nested.
const MAX_DEPTH: usize = 256;

/// Bytes of the header of a binary file, and of one of its chunks (glTF 2.0, 4.4).
const GLB_HEADER: usize = 12;
const GLB_CHUNK_HEADER: usize = 8;

/// An open file.
#[derive(Debug)]
pub struct GltfFile {
    document: Document,
    buffers: Vec<Arc<Vec<u8>>>,
    limits: InputLimits,
}

impl GltfFile {
    /// Opens a file and lists what is in it.
    ///
    /// # Errors
    /// `InvalidMesh` for a broken file, or one beyond a limit; `UnsupportedFile` for points and
    /// lines.
    pub(super) fn open(path: &Path, bytes: Vec<u8>, files: &dyn Files) -> Result<(Listed, Self)> {
        let open = contained("gltf", ErrorKind::InvalidMesh, || {
            let (gltf, blob) = parse(bytes, &files.limits())?;
            let buffers = buffers(path, &gltf, blob, files)?;
            let file = Self { document: gltf.document, buffers, limits: files.limits() };
            let listed = file.list(path)?;
            Ok((listed, file))
        });
        open.map_err(|error| error.at(Place::File(path.to_path_buf())))
    }

    /// The triangles of a primitive.
    ///
    /// # Errors
    /// `InvalidMesh` for an index beyond the vertices.
    pub(super) fn triangles(&self, mesh: usize, primitive: usize) -> Result<Mesh> {
        contained("gltf", ErrorKind::InvalidMesh, || self.decode(&self.primitive(mesh, primitive)?))
    }

    /// The numbers of an attribute of a primitive.
    ///
    /// # Errors
    /// `InvalidMesh` for an accessor that cannot be read.
    pub(super) fn attribute(&self, mesh: usize, primitive: usize, name: &str) -> Result<Numbers> {
        contained("gltf", ErrorKind::InvalidMesh, || {
            let primitive = self.primitive(mesh, primitive)?;
            let mut attributes = primitive.attributes();
            let found = attributes.find(|(semantic, _)| semantic_name(semantic) == name);
            let (_, accessor) = found.ok_or_else(|| invalid(format!("no attribute `{name}`")))?;
            let vertices = primitive.get(&Semantic::Positions).map_or(0, |positions| positions.count());
            let count = accessor.count();
            if count != vertices {
                return Err(invalid(format!(
                    "attribute `{name}` has {count} elements for {vertices} vertices"
                )));
            }
            self.numbers(&accessor)
        })
    }

    fn primitive(&self, mesh: usize, primitive: usize) -> Result<Primitive<'_>> {
        let mesh = self.document.meshes().nth(mesh);
        let found = mesh.and_then(|mesh| mesh.primitives().nth(primitive));
        found.ok_or_else(|| invalid("the primitive does not exist"))
    }

    fn list(&self, path: &Path) -> Result<Listed> {
        let mut counts = Counts::default();
        let mut meshes = Vec::new();
        for mesh in self.document.meshes() {
            let mut parts = Vec::new();
            for primitive in mesh.primitives() {
                parts.push(self.list_primitive(&primitive, &mut counts)?);
            }
            meshes.push((mesh.name().map(str::to_string), parts));
        }
        let textures = self.textures(path)?;
        let materials = self.document.materials().map(|material| material_of(&material)).collect();
        let mut walk = Walk { limits: self.limits, count: 0, nodes: Vec::new(), cameras: Vec::new() };
        if let Some(scene) = self.document.default_scene().or_else(|| self.document.scenes().next()) {
            scene.nodes().try_for_each(|node| walk.node(&node, &glam::DMat4::IDENTITY, 0))?;
        }
        Ok(Listed {
            meshes,
            nodes: walk.nodes,
            materials,
            textures,
            cameras: walk.cameras,
            unread: Vec::new(),
        })
    }

    fn list_primitive(&self, primitive: &Primitive<'_>, counts: &mut Counts) -> Result<ListedPart> {
        let mode = primitive.mode();
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            return Err(Error::new(
                ErrorKind::UnsupportedFile,
                format!("unsupported primitive mode {mode:?}"),
            )
            .note("supported modes: triangles, triangle strips and triangle fans"));
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            return Err(invalid("a primitive has no positions"));
        };
        self.check_accessor(&positions, &[DataType::F32], &[Dimensions::Vec3], counts)?;
        if let Some(accessor) = &primitive.indices() {
            // glTF 2.0, 3.7.2.1
            let types = [DataType::U8, DataType::U16, DataType::U32];
            self.check_accessor(accessor, &types, &[Dimensions::Scalar], counts)?;
        }
        let (vertices, triangles) = (positions.count(), triangle_count(primitive));
        counts.vertices += vertices as u64;
        counts.triangles += triangles as u64;
        self.limits.check(InputLimit::MeshVertices, counts.vertices, ErrorKind::InvalidMesh)?;
        self.limits.check(InputLimit::MeshTriangles, counts.triangles, ErrorKind::InvalidMesh)?;
        let attributes = primitive.attributes().map(|(semantic, _)| semantic_name(&semantic)).collect();
        Ok(ListedPart { material: primitive.material().index(), vertices, triangles, attributes })
    }

    fn decode(&self, primitive: &Primitive<'_>) -> Result<Mesh> {
        let mode = primitive.mode();
        let buffers = &self.buffers;
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|bytes| bytes.as_slice()));
        let positions = primitive.get(&Semantic::Positions);
        let count = positions.as_ref().map_or(0, Accessor::count);
        let mut vertices;
        if let Some(elements) = positions.and_then(|positions| self.plain(&positions)) {
            vertices = vec![[0.0; 3]; count];
            elements.fill(&mut vertices, 1, &|bytes, vertex| {
                let (components, _) = bytes.as_chunks::<4>();
                for (to, bytes) in vertex[0].iter_mut().zip(components) {
                    *to = f32::from_le_bytes(*bytes);
                }
            });
        } else {
            let read = reader.read_positions().ok_or_else(|| invalid("the positions cannot be read"))?;
            vertices = Vec::with_capacity(count);
            vertices.extend(read.take(count));
        }
        let given = vertices.len();
        if let (Mode::Triangles, Some(accessor)) = (mode, primitive.indices())
            && let Some(elements) = self.plain(&accessor)
        {
            return Ok(Mesh { vertices, indices: elements.triangles(accessor.count(), given)? });
        }
        let mut indices = Vec::with_capacity(3 * triangle_count(primitive));
        let mut cut = Cut { mode, given, seen: 0, held: [0; 2], out: &mut indices };
        match reader.read_indices() {
            Some(ReadIndices::U8(corners)) => cut.all(&mut corners.map(u32::from)),
            Some(ReadIndices::U16(corners)) => cut.all(&mut corners.map(u32::from)),
            Some(ReadIndices::U32(mut corners)) => cut.all(&mut corners),
            None if primitive.indices().is_some() => Err(invalid("the indices cannot be read")),
            None => cut.all(&mut (0..given as u32)),
        }?;
        Ok(Mesh { vertices, indices })
    }

    /// The elements of an accessor that has no sparse values.
    fn plain(&self, accessor: &Accessor<'_>) -> Option<PlainElements<'_>> {
        let view = accessor.view().filter(|_| accessor.sparse().is_none())?;
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size);
        let begin = view.offset().checked_add(accessor.offset())?;
        let last = accessor.count().checked_sub(1)?.checked_mul(stride)?.checked_add(begin)?;
        let bytes = self.buffers.get(view.buffer().index())?.get(begin..last.checked_add(size)?)?;
        Some(PlainElements { bytes, stride, size })
    }

    /// The elements of an accessor as floats, integers as they are or, where the accessor says so,
    /// as fractions (glTF 2.0, 3.11).
    fn numbers(&self, accessor: &Accessor<'_>) -> Result<Numbers> {
        use {DataType as T, Dimensions as D};
        let types = [T::I8, T::U8, T::I16, T::U16, T::U32, T::F32];
        let dimensions = [D::Scalar, D::Vec2, D::Vec3, D::Vec4];
        self.check_accessor(accessor, &types, &dimensions, &mut Counts::default())?;
        let normalized = accessor.normalized();
        let unsigned = |most: f32| move |x: f32| if normalized { x / most } else { x };
        let signed = |most: f32| move |x: f32| if normalized { (x / most).max(-1.0) } else { x };
        // The bits are read, so that there are half as many types of elements.
        match accessor.data_type() {
            T::U8 => self.elements(accessor, &|x: u8| unsigned(255.0)(x.into())),
            T::U16 => self.elements(accessor, &|x: u16| unsigned(65535.0)(x.into())),
            T::I8 => self.elements(accessor, &|x: u8| signed(127.0)((x as i8).into())),
            T::I16 => self.elements(accessor, &|x: u16| signed(32767.0)((x as i16).into())),
            T::U32 => self.elements(accessor, &|x: u32| x as f32),
            T::F32 => self.elements(accessor, &f32::from_bits),
        }
    }

    fn elements<T: Item + Copy + FromLittleEndian>(
        &self,
        accessor: &Accessor<'_>,
        number: &(dyn Fn(T) -> f32 + Sync),
    ) -> Result<Numbers> {
        let components = accessor.dimensions().multiplicity();
        if let Some(elements) = self.plain(accessor) {
            let mut values = vec![0.0; components * accessor.count()];
            elements.fill(&mut values, components, &|bytes, element| {
                for (to, bytes) in element.iter_mut().zip(bytes.chunks_exact(size_of::<T>())) {
                    *to = number(T::from_little_endian(bytes));
                }
            });
            return Ok(Numbers { components, values });
        }
        let mut values = Vec::with_capacity(components * accessor.count());
        match components {
            1 => values.extend(self.items::<T>(accessor)?.map(number)),
            2 => self.items::<[T; 2]>(accessor)?.for_each(|x| values.extend(x.map(number))),
            3 => self.items::<[T; 3]>(accessor)?.for_each(|x| values.extend(x.map(number))),
            _ => self.items::<[T; 4]>(accessor)?.for_each(|x| values.extend(x.map(number))),
        }
        if values.len() != components * accessor.count() {
            return Err(invalid(format!("accessor {} cannot be read", accessor.index())));
        }
        Ok(Numbers { components, values })
    }

    fn items<'a, T: Item>(&'a self, accessor: &Accessor<'a>) -> Result<Iter<'a, T>> {
        let buffers = &self.buffers;
        let bytes = |buffer: gltf::Buffer<'a>| buffers.get(buffer.index()).map(|bytes| bytes.as_slice());
        let items = Iter::new(accessor.clone(), bytes);
        items.ok_or_else(|| invalid(format!("accessor {} cannot be read", accessor.index())))
    }

    fn textures(&self, path: &Path) -> Result<Vec<Texture>> {
        let mut pictures: HashMap<usize, PictureSource> = HashMap::new();
        let mut all = Vec::new();
        for texture in self.document.textures() {
            let image = texture.source();
            let picture = match pictures.get(&image.index()) {
                Some(picture) => picture.clone(),
                None => {
                    let picture = self.picture(&image, path)?;
                    pictures.insert(image.index(), picture.clone());
                    picture
                }
            };
            all.push(Texture { picture, sampler: sampler_of(&texture.sampler()) });
        }
        Ok(all)
    }

    fn picture(&self, image: &gltf::Image<'_>, path: &Path) -> Result<PictureSource> {
        match image.source() {
            gltf::image::Source::View { view, .. } => {
                let buffer = self.buffers.get(view.buffer().index());
                let end = view.offset().checked_add(view.length());
                let bytes = buffer.zip(end).and_then(|(bytes, end)| bytes.get(view.offset()..end));
                let bytes = bytes
                    .ok_or_else(|| invalid(format!("image {} extends beyond its buffer", image.index())));
                Ok(PictureSource::Bytes(bytes?.into()))
            }
            gltf::image::Source::Uri { uri, .. } => match uri.strip_prefix("data:") {
                Some(data) => Ok(PictureSource::Bytes(data_uri(data)?.into())),
                None => Ok(PictureSource::File(sibling(path, uri)?)),
            },
        }
    }

    /// Checks that an accessor has a type that is read and is within its buffer, which the `gltf`
    /// crate does not.
    fn check_accessor(
        &self,
        accessor: &Accessor<'_>,
        types: &[DataType],
        dimensions: &[Dimensions],
        counts: &mut Counts,
    ) -> Result<()> {
        let index = accessor.index();
        let wrong = |what: &str| Err(invalid(format!("accessor {index} {what}")));
        if !types.contains(&accessor.data_type()) || !dimensions.contains(&accessor.dimensions()) {
            let dimensions = list_of_dimensions(dimensions);
            return wrong(&format!("is not {types:?} {dimensions}"));
        }
        let count = accessor.count();
        let limit = match accessor.dimensions() {
            Dimensions::Scalar => (InputLimit::MeshTriangles, count as u64 / 3),
            _ => (InputLimit::MeshVertices, count as u64),
        };
        if count == 0 {
            return wrong("has 0 elements");
        }
        let within = |limit, count| {
            let checked = self.limits.check(limit, count, ErrorKind::InvalidMesh);
            checked.map_err(|error| error.context(format!("accessor {index}")))
        };
        within(limit.0, limit.1)?;
        if let Some(view) = accessor.view() {
            if !self.view_contains(&view, accessor.offset(), count, accessor.size()) {
                return wrong("extends beyond its buffer");
            }
        } else if accessor.sparse().is_none() {
            return wrong("has no buffer view");
        } else {
            counts.zeros += count as u64;
            within(InputLimit::MeshSparse, counts.zeros)?;
        }
        let Some(sparse) = accessor.sparse() else { return Ok(()) };
        let (indices, values) = (sparse.indices(), sparse.values());
        let changed = sparse.count();
        if changed == 0
            || changed > count
            || !self.view_contains(&indices.view(), indices.offset(), changed, indices.index_type().size())
            || !self.view_contains(&values.view(), values.offset(), changed, accessor.size())
        {
            return wrong("has sparse values beyond their buffer");
        }
        Ok(())
    }

    fn view_contains(&self, view: &gltf::buffer::View<'_>, offset: usize, count: usize, size: usize) -> bool {
        let stride = view.stride().unwrap_or(size);
        let last = (count - 1).checked_mul(stride).and_then(|x| x.checked_add(size));
        let end = last.and_then(|x| x.checked_add(offset));
        let view_end = view.offset().checked_add(view.length());
        let buffer = self.buffers.get(view.buffer().index()).map_or(0, |bytes| bytes.len());
        stride >= size
            && end.is_some_and(|end| end <= view.length())
            && view_end.is_some_and(|end| end <= buffer)
    }
}

/// The elements of an accessor as they lie in a buffer, all of them within it.
struct PlainElements<'a> {
    /// From the first one on.
    bytes: &'a [u8],
    /// Bytes from one to the next.
    stride: usize,
    /// Bytes of one.
    size: usize,
}

impl PlainElements<'_> {
    /// Fills a list, which has so many entries for each element, by a function that is given the
    /// bytes of an element and its entries.
    fn fill<T: Send>(&self, list: &mut [T], entries: usize, read: &(impl Fn(&[u8], &mut [T]) + Sync)) {
        /// Elements that a thread decodes at once.
        const PART: usize = 1 << 16;
        threads::fill(list, PART * entries, &|first, part| {
            for (element, at) in part.chunks_exact_mut(entries).zip(first / entries..) {
                read(&self.bytes[at * self.stride..][..self.size], element);
            }
        });
    }

    /// The indices of whole triangles among these, each below `given`.
    fn triangles(&self, count: usize, given: usize) -> Result<Vec<u32>> {
        let mut indices = vec![0; count];
        self.fill(&mut indices, 1, &|bytes, index| {
            let mut word = [0; 4];
            word[..bytes.len()].copy_from_slice(bytes);
            index[0] = u32::from_le_bytes(word);
        });
        let greatest = indices.iter().fold(0, |greatest, &index| index.max(greatest));
        if greatest as usize >= given
            && let Some(&index) = indices.iter().find(|&&index| index as usize >= given)
        {
            return Err(out_of_range(index, given));
        }
        indices.truncate(count / 3 * 3);
        Ok(indices)
    }
}

/// An integer of some bytes, the lowest one first.
trait FromLittleEndian {
    /// The integer of as many bytes as it has.
    fn from_little_endian(bytes: &[u8]) -> Self;
}

macro_rules! from_little_endian {
    ($($integer:ty),*) => {
        $(impl FromLittleEndian for $integer {
            fn from_little_endian(bytes: &[u8]) -> Self {
                bytes.try_into().map_or(0, Self::from_le_bytes)
            }
        })*
    };
}

from_little_endian!(u8, u16, u32);

/// The JSON of a file and its binary chunk.
fn parse(mut bytes: Vec<u8>, limits: &InputLimits) -> Result<(Gltf, Option<Vec<u8>>)> {
    limits.check(InputLimit::MeshValues, json_values(json(&bytes)?), ErrorKind::InvalidMesh)?;
    let not_gltf = |error| invalid(format!("not glTF: {error}"));
    if !bytes.starts_with(b"glTF") {
        return Ok((Gltf::from_slice(&bytes).map_err(not_gltf)?, None));
    }
    let container = Glb::from_slice(&bytes).map_err(not_gltf)?;
    let gltf = Gltf::from_slice(&container.json).map_err(not_gltf)?;
    let length = container.bin.as_ref().map(|chunk| chunk.len());
    // The chunk lies behind the header, the JSON and its own header.
    let begin = GLB_HEADER + 2 * GLB_CHUNK_HEADER + container.json.len();
    drop(container);
    let chunk = length.map(|length| {
        bytes.truncate(begin + length);
        bytes.drain(..begin);
        bytes
    });
    Ok((gltf, chunk))
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidMesh, message)
}

/// The JSON of a file: all of it, or the first chunk of a binary one, whose lengths the crate
/// subtracts without looking (glTF 2.0, 4.4).
fn json(bytes: &[u8]) -> Result<&[u8]> {
    if !bytes.starts_with(b"glTF") {
        return Ok(bytes);
    }
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
        word.map(|word| u32::from_le_bytes(word) as usize)
    };
    let (Some(length), Some(chunk)) = (word(8), word(GLB_HEADER)) else {
        return Err(invalid("not glTF: the file ends within its header"));
    };
    let start = GLB_HEADER + GLB_CHUNK_HEADER;
    if length < start || length > bytes.len() {
        return Err(invalid(format!(
            "not glTF: the header specifies {length} bytes, but the file has {}",
            bytes.len()
        )));
    }
    let json = bytes.get(start..).and_then(|rest| rest.get(..chunk));
    json.ok_or_else(|| invalid("not glTF: the JSON chunk extends beyond the file"))
}

/// The number of values of a JSON text, or a few more: each begins the text, or stands behind a
/// comma or an opening bracket outside of strings.
fn json_values(text: &[u8]) -> u64 {
    let (mut count, mut in_string, mut escaped) = (1, false, false);
    for byte in text {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => in_string = !in_string,
            b',' | b'[' | b'{' if !in_string => count += 1,
            _ => {}
        }
    }
    count
}

/// The content of every buffer: the binary chunk, a data URI or a file beside this one. Several of
/// one file share it.
fn buffers(path: &Path, file: &Gltf, blob: Option<Vec<u8>>, files: &dyn Files) -> Result<Vec<Arc<Vec<u8>>>> {
    let blob = blob.map(Arc::new);
    let mut named: HashMap<PathBuf, Arc<Vec<u8>>> = HashMap::new();
    let mut all = Vec::new();
    for buffer in file.buffers() {
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => {
                blob.clone().ok_or_else(|| invalid("the file has no binary chunk"))?
            }
            gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => Arc::new(data_uri(data)?),
                None => {
                    let name = sibling(path, uri)?;
                    match named.get(&name) {
                        Some(bytes) => bytes.clone(),
                        None => {
                            let bytes = Arc::new(files.read(&name)?);
                            named.insert(name, bytes.clone());
                            bytes
                        }
                    }
                }
            },
        };
        if bytes.len() < buffer.length() {
            return Err(invalid(format!(
                "buffer {} has {} bytes, but its `byteLength` is {}",
                buffer.index(),
                bytes.len(),
                buffer.length()
            )));
        }
        all.push(bytes);
    }
    Ok(all)
}

/// What a file has given so far.
#[derive(Default)]
struct Counts {
    vertices: u64,
    triangles: u64,
    /// Elements of accessors that begin with zeros.
    zeros: u64,
}

fn list_of_dimensions(dimensions: &[Dimensions]) -> String {
    match dimensions {
        [one] => format!("{one:?}"),
        several => format!("{several:?}"),
    }
}

fn data_uri(data: &str) -> Result<Vec<u8>> {
    let (_, digits) = data.split_once(";base64,").ok_or_else(|| invalid("a data URI is not base64"))?;
    base64(digits).ok_or_else(|| invalid("a data URI contains invalid base64"))
}

/// A file that a URI names, relative to the one that it stands in.
fn sibling(path: &Path, uri: &str) -> Result<PathBuf> {
    let name = percent_decoded(uri).ok_or_else(|| invalid(format!("invalid URI `{uri}`")))?;
    Ok(path.parent().unwrap_or(Path::new("")).join(name))
}

/// The name of an attribute in a scene: that of glTF in small letters.
fn semantic_name(semantic: &Semantic) -> String {
    semantic.to_string().to_ascii_lowercase()
}

fn triangle_count(primitive: &Primitive<'_>) -> usize {
    let vertices = primitive.get(&Semantic::Positions).map_or(0, |positions| positions.count());
    let corners = primitive.indices().map_or(vertices, |indices| indices.count());
    match primitive.mode() {
        Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
        _ => corners / 3,
    }
}

fn material_of(material: &gltf::Material<'_>) -> Material {
    let pbr = material.pbr_metallic_roughness();
    let mut textures = [None; TextureSlot::COUNT];
    let mut set = |slot: TextureSlot, texture: Option<usize>| textures[slot as usize] = texture;
    set(TextureSlot::BaseColor, pbr.base_color_texture().map(|info| info.texture().index()));
    set(TextureSlot::MetallicRoughness, pbr.metallic_roughness_texture().map(|info| info.texture().index()));
    set(TextureSlot::Normal, material.normal_texture().map(|normal| normal.texture().index()));
    set(TextureSlot::Occlusion, material.occlusion_texture().map(|occlusion| occlusion.texture().index()));
    set(TextureSlot::Emissive, material.emissive_texture().map(|info| info.texture().index()));
    let default = Material::default();
    let mut mappings = default.mappings;
    let mut set = |slot: TextureSlot, mapping: Option<TextureMapping>| {
        mappings[slot as usize] = mapping.unwrap_or_default();
    };
    set(TextureSlot::BaseColor, pbr.base_color_texture().map(|info| mapping_of(&info)));
    set(TextureSlot::MetallicRoughness, pbr.metallic_roughness_texture().map(|info| mapping_of(&info)));
    set(TextureSlot::Emissive, material.emissive_texture().map(|info| mapping_of(&info)));
    let normal = material.normal_texture();
    let normal = normal.map(|info| other_mapping(info.tex_coord(), info.extension_value(TEXTURE_TRANSFORM)));
    set(TextureSlot::Normal, normal);
    let occlusion = material.occlusion_texture();
    let occlusion =
        occlusion.map(|info| other_mapping(info.tex_coord(), info.extension_value(TEXTURE_TRANSFORM)));
    set(TextureSlot::Occlusion, occlusion);
    Material {
        name: material.name().unwrap_or_default().to_string(),
        base_color: pbr.base_color_factor(),
        metallic: pbr.metallic_factor(),
        roughness: pbr.roughness_factor(),
        emissive: material.emissive_factor(),
        emissive_strength: material.emissive_strength().unwrap_or(default.emissive_strength),
        normal_scale: material.normal_texture().map_or(default.normal_scale, |normal| normal.scale()),
        occlusion_strength: material
            .occlusion_texture()
            .map_or(default.occlusion_strength, |occlusion| occlusion.strength()),
        alpha_cutoff: material.alpha_cutoff().unwrap_or(default.alpha_cutoff),
        alpha_mode: match material.alpha_mode() {
            gltf::material::AlphaMode::Opaque => 0,
            gltf::material::AlphaMode::Mask => 1,
            gltf::material::AlphaMode::Blend => 2,
        },
        double_sided: material.double_sided(),
        ior: material.ior().unwrap_or(default.ior),
        transmission: material.transmission().map_or(0.0, |transmission| transmission.transmission_factor()),
        textures,
        mappings,
        ..default
    }
}

const TEXTURE_TRANSFORM: &str = "KHR_texture_transform";

fn mapping_of(info: &gltf::texture::Info<'_>) -> TextureMapping {
    let own = info.tex_coord();
    info.texture_transform().map_or(
        TextureMapping { texcoord: own, ..TextureMapping::default() },
        |transform| {
            let texcoord = transform.tex_coord().unwrap_or(own);
            TextureMapping::new(texcoord, transform.scale(), transform.rotation(), transform.offset())
        },
    )
}

/// The mapping of a normal or occlusion texture, whose transform the reader leaves as JSON.
fn other_mapping(own: u32, transform: Option<&serde_json::Value>) -> TextureMapping {
    let Some(transform) = transform else {
        return TextureMapping { texcoord: own, ..TextureMapping::default() };
    };
    let pair = |key: &str, default: f32| {
        [0, 1].map(|at| transform[key][at].as_f64().map_or(default, |number| number as f32))
    };
    let texcoord = transform["texCoord"].as_u64().and_then(|set| u32::try_from(set).ok());
    let rotation = transform["rotation"].as_f64().unwrap_or(0.0) as f32;
    TextureMapping::new(texcoord.unwrap_or(own), pair("scale", 1.0), rotation, pair("offset", 0.0))
}

/// Without filters glTF leaves them to the implementation: linear, as a scene's own.
fn sampler_of(sampler: &gltf::texture::Sampler<'_>) -> Sampler {
    use gltf::texture::{MagFilter, MinFilter, WrappingMode};
    let (min_filter, mipmap_mode) = match sampler.min_filter() {
        // Without mip levels the base level is read alone: the greatest level of detail is 0.
        Some(MinFilter::Nearest) => (Filter::Nearest, None),
        Some(MinFilter::Linear) => (Filter::Linear, None),
        Some(MinFilter::NearestMipmapNearest) => (Filter::Nearest, Some(Filter::Nearest)),
        Some(MinFilter::LinearMipmapNearest) => (Filter::Linear, Some(Filter::Nearest)),
        Some(MinFilter::NearestMipmapLinear) => (Filter::Nearest, Some(Filter::Linear)),
        Some(MinFilter::LinearMipmapLinear) | None => (Filter::Linear, Some(Filter::Linear)),
    };
    let mag_filter = match sampler.mag_filter() {
        Some(MagFilter::Nearest) => Filter::Nearest,
        Some(MagFilter::Linear) | None => Filter::Linear,
    };
    let mode = |mode| match mode {
        WrappingMode::ClampToEdge => AddressMode::ClampToEdge,
        WrappingMode::MirroredRepeat => AddressMode::MirroredRepeat,
        WrappingMode::Repeat => AddressMode::Repeat,
    };
    let default = Sampler::default();
    Sampler {
        mag_filter,
        min_filter,
        mipmap_mode: mipmap_mode.unwrap_or(Filter::Nearest),
        max_lod: if mipmap_mode.is_some() { default.max_lod } else { 0.0 },
        address_mode: [mode(sampler.wrap_s()), mode(sampler.wrap_t()), AddressMode::Repeat],
        ..default
    }
}

/// A walk through the nodes of a scene.
struct Walk {
    limits: InputLimits,
    count: u64,
    nodes: Vec<ModelNode>,
    cameras: Vec<FileCamera>,
}

impl Walk {
    fn node(&mut self, node: &Node<'_>, parent: &glam::DMat4, depth: usize) -> Result<()> {
        if depth > MAX_DEPTH {
            return Err(invalid(format!("nodes are nested more than {MAX_DEPTH} deep, possibly in a cycle")));
        }
        // Two nodes that list a third twice, and so on, double each time.
        self.count += 1;
        self.limits.check(InputLimit::MeshNodes, self.count, ErrorKind::InvalidMesh)?;
        let own = match node.transform() {
            gltf::scene::Transform::Matrix { matrix } => {
                glam::DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from)))
            }
            gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
                let rotation = glam::DQuat::from_array(rotation.map(f64::from));
                glam::DMat4::from_scale_rotation_translation(
                    scale.map(f64::from).into(),
                    rotation,
                    translation.map(f64::from).into(),
                )
            }
        };
        let world = *parent * own;
        let name = node.name().map(str::to_string);
        if let Some(camera) = node.camera() {
            let name = name.clone().or_else(|| camera.name().map(str::to_string)).unwrap_or_default();
            self.cameras.push(FileCamera { name, world, projection: projection_of(&camera) });
        }
        if let Some(mesh) = node.mesh() {
            self.nodes.push(ModelNode { name, mesh: mesh.index(), world });
        }
        node.children().try_for_each(|child| self.node(&child, &world, depth + 1))
    }
}

fn projection_of(camera: &gltf::Camera<'_>) -> Projection {
    match camera.projection() {
        gltf::camera::Projection::Perspective(lens) => Projection::Perspective {
            // tan(x / 2) of an angle in radians, which the crate of correctly rounded functions
            // gives in f32: the same on every machine.
            slope: f64::from(pxfm::f_tanf(lens.yfov() / 2.0)),
            aspect: lens.aspect_ratio().map(f64::from),
            near: lens.znear().into(),
            far: lens.zfar().map_or(f64::INFINITY, f64::from),
        },
        gltf::camera::Projection::Orthographic(lens) => Projection::Orthographic {
            half: [lens.xmag().into(), lens.ymag().into()],
            near: lens.znear().into(),
            far: lens.zfar().into(),
        },
    }
}

/// Makes triangles of corners while they are read: of strips, which alternate their winding, and
/// fans, which share their first corner (glTF 2.0, 3.7.2.1).
struct Cut<'a> {
    mode: Mode,
    /// How many vertices it has.
    given: usize,
    /// How many corners were read.
    seen: usize,
    /// The two corners that the next triangle has in common with those before; of a list, those of
    /// a triangle that is not whole yet.
    held: [u32; 2],
    out: &'a mut Vec<u32>,
}

fn out_of_range(index: u32, vertices: usize) -> Error {
    invalid(format!("index {index} is out of range: there are {vertices} vertices"))
}

impl Cut<'_> {
    fn all(&mut self, corners: &mut dyn Iterator<Item = u32>) -> Result<()> {
        for corner in corners {
            if corner as usize >= self.given {
                return Err(out_of_range(corner, self.given));
            }
            self.push(corner);
        }
        Ok(())
    }

    fn push(&mut self, corner: u32) {
        let at = self.seen;
        self.seen += 1;
        let [first, second] = self.held;
        match self.mode {
            Mode::TriangleStrip | Mode::TriangleFan if at < 2 => self.held[at] = corner,
            Mode::TriangleStrip => {
                let odd = at % 2 == 1;
                self.out.extend(if odd { [first, corner, second] } else { [first, second, corner] });
                self.held = [second, corner];
            }
            Mode::TriangleFan => {
                self.out.extend([first, second, corner]);
                self.held = [first, corner];
            }
            _ if at % 3 < 2 => self.held[at % 3] = corner,
            _ => self.out.extend([first, second, corner]),
        }
    }
}

#[cfg(test)]
mod tests;
