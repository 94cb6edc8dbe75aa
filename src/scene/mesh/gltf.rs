//! glTF 2.0 (`.gltf` and `.glb`), read by the `gltf` crate. All triangle primitives of the default
//! scene with their nodes' transforms applied, or of one mesh by name without any transform.

use std::path::Path;

use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Accessor, Document, Node, Primitive, Semantic};

use crate::error::{Error, ErrorKind, Place, Result};
use crate::scene::files::Files;
use crate::scene::mesh::Mesh;

/// How deep nodes may be nested.
const MAX_DEPTH: usize = 256;
/// The most nodes that are visited: nodes that list another one twice each visit exponentially
/// many.
const MAX_NODES: usize = 1 << 20;
/// The most vertices that one file may have; shared meshes count each time.
const MAX_VERTICES: usize = 1 << 27;

/// The triangles of the default scene, or of the mesh with the given name.
///
/// # Errors
/// `InvalidMesh` for a broken file, `UnsupportedFile` for points and lines.
pub fn read(path: &Path, bytes: &[u8], mesh: Option<&str>, files: &dyn Files) -> Result<Mesh> {
    let place = |error: Error| error.at(Place::File(path.to_path_buf()));
    let file = gltf::Gltf::from_slice(bytes).map_err(|error| place(invalid(format!("not glTF: {error}"))))?;
    let buffers = buffers(path, &file, files).map_err(place)?;
    let mut reader = Reader { buffers, mesh: Mesh::default(), nodes: 0 };
    match mesh {
        None => reader.scene(&file.document),
        Some(name) => reader.named(&file.document, name),
    }
    .map_err(place)?;
    if reader.mesh.indices.is_empty() {
        return Err(place(invalid("the file has no triangles")));
    }
    Ok(reader.mesh)
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidMesh, message)
}

/// The content of every buffer: the binary chunk, a data URI or a file beside this one.
fn buffers(path: &Path, file: &gltf::Gltf, files: &dyn Files) -> Result<Vec<Vec<u8>>> {
    let mut all = Vec::new();
    for buffer in file.buffers() {
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => {
                file.blob.clone().ok_or_else(|| invalid("the file has no binary chunk"))?
            }
            gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => {
                    let (_, digits) = data
                        .split_once(";base64,")
                        .ok_or_else(|| invalid("a data URI that is not base64"))?;
                    base64(digits).ok_or_else(|| invalid("a data URI with broken base64"))?
                }
                None => {
                    let name = percent_decoded(uri).ok_or_else(|| invalid(format!("broken URI `{uri}`")))?;
                    files.read(&path.parent().unwrap_or(Path::new("")).join(name))?
                }
            },
        };
        if bytes.len() < buffer.length() {
            return Err(invalid(format!(
                "buffer {} has {} bytes, its `byteLength` says {}",
                buffer.index(),
                bytes.len(),
                buffer.length()
            )));
        }
        all.push(bytes);
    }
    Ok(all)
}

struct Reader {
    buffers: Vec<Vec<u8>>,
    mesh: Mesh,
    nodes: usize,
}

impl Reader {
    fn scene(&mut self, document: &Document) -> Result<()> {
        let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
            return Err(invalid("the file has no scene"));
        };
        scene.nodes().try_for_each(|node| self.node(&node, &glam::DMat4::IDENTITY, 0))
    }

    fn named(&mut self, document: &Document, name: &str) -> Result<()> {
        let Some(mesh) = document.meshes().find(|mesh| mesh.name() == Some(name)) else {
            let names: Vec<_> = document.meshes().filter_map(|mesh| mesh.name()).collect();
            return Err(invalid(format!("no mesh `{name}`"))
                .note(format!("the meshes here are: {}", names.join(", "))));
        };
        mesh.primitives().try_for_each(|primitive| self.primitive(&primitive, None))
    }

    fn node(&mut self, node: &Node<'_>, parent: &glam::DMat4, depth: usize) -> Result<()> {
        if depth > MAX_DEPTH {
            return Err(invalid(format!("nodes are nested more than {MAX_DEPTH} deep, perhaps in a circle")));
        }
        self.nodes += 1;
        if self.nodes > MAX_NODES {
            return Err(invalid(format!("more than {MAX_NODES} nodes")));
        }
        let own = node.transform().matrix().map(|column| column.map(f64::from));
        let transform = *parent * glam::DMat4::from_cols_array_2d(&own);
        if let Some(mesh) = node.mesh() {
            mesh.primitives().try_for_each(|primitive| self.primitive(&primitive, Some(&transform)))?;
        }
        node.children().try_for_each(|child| self.node(&child, &transform, depth + 1))
    }

    fn primitive(&mut self, primitive: &Primitive<'_>, transform: Option<&glam::DMat4>) -> Result<()> {
        let mode = primitive.mode();
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            return Err(Error::new(ErrorKind::UnsupportedFile, format!("a primitive of mode {mode:?}"))
                .note("only triangles, triangle strips and triangle fans are read"));
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            return Err(invalid("a primitive without positions"));
        };
        self.check_accessor(&positions, DataType::F32, Dimensions::Vec3)?;
        let indices = primitive.indices();
        if let Some(accessor) = &indices {
            self.check_accessor(accessor, accessor.data_type(), Dimensions::Scalar)?;
        }
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(Vec::as_slice));
        let vertices: Vec<[f32; 3]> =
            reader.read_positions().ok_or_else(|| invalid("positions that cannot be read"))?.collect();
        let corners: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None if indices.is_some() => return Err(invalid("indices that cannot be read")),
            None => (0..vertices.len() as u32).collect(),
        };
        if let Some(index) = corners.iter().find(|index| **index as usize >= vertices.len()) {
            return Err(invalid(format!("index {index} of {} vertices", vertices.len())));
        }
        if self.mesh.vertices.len() + vertices.len() > MAX_VERTICES
            || self.mesh.indices.len() + 3 * corners.len() > 6 * MAX_VERTICES
        {
            return Err(invalid(format!("more than {MAX_VERTICES} vertices")));
        }
        let base = self.mesh.vertices.len() as u32;
        self.mesh.indices.extend(triangles(mode, &corners).iter().map(|index| base + index));
        self.mesh.vertices.extend(vertices.iter().map(|vertex| match transform {
            None => *vertex,
            Some(transform) => {
                transform.transform_point3(glam::Vec3::from(*vertex).as_dvec3()).as_vec3().to_array()
            }
        }));
        Ok(())
    }

    /// Checks that an accessor is within its buffer, which the `gltf` crate does not.
    fn check_accessor(&self, accessor: &Accessor<'_>, data: DataType, dimensions: Dimensions) -> Result<()> {
        let index = accessor.index();
        let wrong = |what: &str| Err(invalid(format!("accessor {index} {what}")));
        if accessor.data_type() != data || accessor.dimensions() != dimensions {
            return wrong(&format!("is not {data:?} {dimensions:?}"));
        }
        if accessor.count() == 0 || accessor.count() > MAX_VERTICES {
            return wrong(&format!("has {} elements", accessor.count()));
        }
        if let Some(view) = accessor.view() {
            if !self.view_contains(&view, accessor.offset(), accessor.count(), accessor.size()) {
                return wrong("reaches beyond its buffer");
            }
        } else if accessor.sparse().is_none() {
            return wrong("has no buffer view");
        }
        let Some(sparse) = accessor.sparse() else { return Ok(()) };
        let (indices, values) = (sparse.indices(), sparse.values());
        let count = sparse.count();
        if count == 0
            || count > accessor.count()
            || !self.view_contains(&indices.view(), indices.offset(), count, indices.index_type().size())
            || !self.view_contains(&values.view(), values.offset(), count, accessor.size())
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
        let buffer = self.buffers.get(view.buffer().index()).map_or(0, Vec::len);
        stride >= size
            && end.is_some_and(|end| end <= view.length())
            && view_end.is_some_and(|end| end <= buffer)
    }
}

/// Makes triangles of strips, which alternate their winding, and fans, which share their first
/// corner (glTF 2.0, 3.7.2.1).
fn triangles(mode: Mode, corners: &[u32]) -> Vec<u32> {
    match mode {
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .flat_map(|(i, c)| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] })
            .collect(),
        Mode::TriangleFan => match corners.split_first() {
            Some((first, rest)) => rest.windows(2).flat_map(|pair| [*first, pair[0], pair[1]]).collect(),
            None => Vec::new(),
        },
        _ => corners.chunks_exact(3).flatten().copied().collect(),
    }
}

/// Decodes base64 (RFC 4648, section 4), with or without padding.
fn base64(text: &str) -> Option<Vec<u8>> {
    let digits = text.trim_end_matches('=').bytes().map(|byte| match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    });
    let digits: Vec<u8> = digits.collect::<Option<_>>()?;
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 3);
    for group in digits.chunks(4) {
        if group.len() == 1 {
            return None;
        }
        let bits = group.iter().enumerate().fold(0_u32, |bits, (i, d)| bits | u32::from(*d) << (18 - 6 * i));
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    Some(bytes)
}

fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.bytes();
    while let Some(byte) = rest.next() {
        if byte != b'%' {
            bytes.push(byte);
            continue;
        }
        let digit = |byte: Option<u8>| (byte? as char).to_digit(16);
        bytes.push((digit(rest.next())? * 16 + digit(rest.next())?) as u8);
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::files::EmbeddedFiles;

    /// Four vertices (0,0,0) (1,0,0) (0,1,0) (1,1,0), then the indices 0 1 2 3 as u16.
    fn bytes() -> Vec<u8> {
        let positions = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0_f32];
        let mut bytes: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
        bytes.extend([0, 0, 1, 0, 2, 0, 3, 0]);
        bytes
    }

    fn file(mode: u32, index_count: u32, node: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
            "nodes":[{{"mesh":0{node}}}],
            "meshes":[{{"name":"quad","primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":{mode}}}]}}],
            "buffers":[{{"uri":"my%20data.bin","byteLength":56}}],
            "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":8}}],
            "accessors":[
              {{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
              {{"bufferView":1,"componentType":5123,"count":{index_count},"type":"SCALAR"}}]}}"#
        )
    }

    fn load(text: &str, name: Option<&str>, data: &[u8]) -> Result<Mesh> {
        read(Path::new("dir/m.gltf"), text.as_bytes(), name, &EmbeddedFiles(&[("dir/my data.bin", data)]))
    }

    #[test]
    fn modes_are_cut_into_triangles() {
        // Strip: 0 1 2, then 1 3 2 (winding kept). Fan: 0 1 2, 0 2 3. List: one whole triangle.
        assert_eq!(load(&file(5, 4, ""), None, &bytes()).unwrap().indices, [0, 1, 2, 1, 3, 2]);
        assert_eq!(load(&file(6, 4, ""), None, &bytes()).unwrap().indices, [0, 1, 2, 0, 2, 3]);
        assert_eq!(load(&file(4, 4, ""), None, &bytes()).unwrap().indices, [0, 1, 2]);
        let error = load(&file(1, 4, ""), None, &bytes()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::UnsupportedFile);
    }

    #[test]
    fn node_transforms_apply_to_the_scene_but_not_to_a_named_mesh() {
        let text = file(4, 3, r#","translation":[10,0,0],"scale":[2,3,1]"#);
        let mesh = load(&text, None, &bytes()).unwrap();
        assert_eq!(mesh.vertices, [[10., 0., 0.], [12., 0., 0.], [10., 3., 0.], [12., 3., 0.]]);
        let mesh = load(&text, Some("quad"), &bytes()).unwrap();
        assert_eq!(mesh.vertices[3], [1., 1., 0.]);
        let error = load(&text, Some("quat"), &bytes()).unwrap_err();
        assert!(error.render().contains("the meshes here are: quad"), "{error:?}");
    }

    #[test]
    fn broken_files_say_what_is_wrong() {
        let good = file(4, 3, "");
        for (text, data, wanted) in [
            ("{".to_string(), bytes(), "not glTF"),
            (good.clone(), bytes()[..20].to_vec(), "buffer 0 has 20 bytes"),
            (good.replace(r#""count":4"#, r#""count":5"#), bytes(), "accessor 0 reaches beyond"),
            (good.replace(r#""count":3"#, r#""count":900000000"#), bytes(), "accessor 1 has 900000000"),
            (good.replace("5126", "5123"), bytes(), "accessor 0 is not F32 Vec3"),
            (good.replace("my%20data.bin", "my%2"), bytes(), "broken URI"),
            (good.clone(), [&bytes()[..48], &[0, 0, 1, 0, 77, 0, 0, 0]].concat(), "index 77 of 4 vertices"),
        ] {
            let error = load(&text, None, &data).unwrap_err();
            assert!(error.message().contains(wanted), "{wanted}: {error:?}");
            assert!(error.to_string().contains("m.gltf"), "{error}");
        }
        let error = load(&good.replace("my%20data", "gone"), None, &bytes()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Io);
    }

    /// RFC 4648, section 10.
    #[test]
    fn base64_test_vectors() {
        for (text, plain) in [
            ("", ""),
            ("Zg==", "f"),
            ("Zm8=", "fo"),
            ("Zm9v", "foo"),
            ("Zm9vYg", "foob"),
            ("Zm9vYmFy", "foobar"),
        ] {
            assert_eq!(base64(text).unwrap(), plain.as_bytes());
        }
        assert_eq!(base64("Z"), None);
        assert_eq!(base64("Z!=="), None);
    }
}
