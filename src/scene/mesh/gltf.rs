//! glTF 2.0 (`.gltf` and `.glb`), read by the `gltf` crate. All triangle primitives of the default
//! scene with their nodes' transforms applied, or of one mesh by name without any transform.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::mesh::util::ReadIndices;
use gltf::{Accessor, Document, Node, Primitive, Semantic};

use crate::error::{Error, ErrorKind, Place, Result};
use crate::input::{InputLimit, InputLimits, contained};
use crate::scene::files::Files;
use crate::scene::mesh::Mesh;
use crate::scene::read::list_of;

/// How deep nodes may be nested.
const MAX_DEPTH: usize = 256;

/// The triangles of the default scene, or of the mesh with the given name.
///
/// # Errors
/// `InvalidMesh` for a broken file, or one beyond a limit; `UnsupportedFile` for points and lines.
pub fn read(path: &Path, bytes: &[u8], mesh: Option<&str>, files: &dyn Files) -> Result<Mesh> {
    let read = contained("gltf", ErrorKind::InvalidMesh, || decode(path, bytes, mesh, files));
    read.map_err(|error| error.at(Place::File(path.to_path_buf())))
}

fn decode(path: &Path, bytes: &[u8], mesh: Option<&str>, files: &dyn Files) -> Result<Mesh> {
    let limits = files.limits();
    let values = json_values(json(bytes)?);
    limits.check(InputLimit::MeshValues, values, ErrorKind::InvalidMesh)?;
    let mut file = gltf::Gltf::from_slice(bytes).map_err(|error| invalid(format!("not glTF: {error}")))?;
    let blob = file.blob.take();
    let buffers = buffers(path, &file, blob, files)?;
    let counts = Counts::default();
    let mut reader = Reader { buffers, limits, counts, mesh: Mesh::default() };
    match mesh {
        None => reader.scene(&file.document),
        Some(name) => reader.named(&file.document, name),
    }?;
    if reader.mesh.indices.is_empty() {
        return Err(invalid("the file has no triangles"));
    }
    Ok(reader.mesh)
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidMesh, message)
}

/// The JSON of a file: all of it, or the first chunk of a binary one, whose lengths the crate
/// subtracts without looking (glTF 2.0, 4.4).
fn json(bytes: &[u8]) -> Result<&[u8]> {
    const HEADER: usize = 12;
    const CHUNK_HEADER: usize = 8;
    if !bytes.starts_with(b"glTF") {
        return Ok(bytes);
    }
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
        word.map(|word| u32::from_le_bytes(word) as usize)
    };
    let (Some(length), Some(chunk)) = (word(8), word(HEADER)) else {
        return Err(invalid("not glTF: the file ends in its header"));
    };
    let start = HEADER + CHUNK_HEADER;
    if length < start || length > bytes.len() {
        return Err(invalid(format!(
            "not glTF: the header says {length} bytes, and the file has {}",
            bytes.len()
        )));
    }
    let json = bytes.get(start..).and_then(|rest| rest.get(..chunk));
    json.ok_or_else(|| invalid("not glTF: the JSON chunk reaches beyond the file"))
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
fn buffers(
    path: &Path,
    file: &gltf::Gltf,
    blob: Option<Vec<u8>>,
    files: &dyn Files,
) -> Result<Vec<Rc<Vec<u8>>>> {
    let blob = blob.map(Rc::new);
    let mut named: HashMap<PathBuf, Rc<Vec<u8>>> = HashMap::new();
    let mut all = Vec::new();
    for buffer in file.buffers() {
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => {
                blob.clone().ok_or_else(|| invalid("the file has no binary chunk"))?
            }
            gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(data) => {
                    let (_, digits) = data
                        .split_once(";base64,")
                        .ok_or_else(|| invalid("a data URI that is not base64"))?;
                    let bytes = base64(digits);
                    Rc::new(bytes.ok_or_else(|| invalid("a data URI with broken base64"))?)
                }
                None => {
                    let name = percent_decoded(uri).ok_or_else(|| invalid(format!("broken URI `{uri}`")))?;
                    let name = path.parent().unwrap_or(Path::new("")).join(name);
                    match named.get(&name) {
                        Some(bytes) => bytes.clone(),
                        None => {
                            let bytes = Rc::new(files.read(&name)?);
                            named.insert(name, bytes.clone());
                            bytes
                        }
                    }
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

/// What a file has given so far.
#[derive(Default)]
struct Counts {
    nodes: u64,
    vertices: u64,
    triangles: u64,
    /// Elements of accessors that begin with zeros.
    zeros: u64,
}

struct Reader {
    buffers: Vec<Rc<Vec<u8>>>,
    limits: InputLimits,
    counts: Counts,
    mesh: Mesh,
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
            let names = list_of(document.meshes().filter_map(|mesh| mesh.name()));
            return Err(invalid(format!("no mesh `{name}`")).note(format!("the meshes here are: {names}")));
        };
        mesh.primitives().try_for_each(|primitive| self.primitive(&primitive, None))
    }

    fn node(&mut self, node: &Node<'_>, parent: &glam::DMat4, depth: usize) -> Result<()> {
        if depth > MAX_DEPTH {
            return Err(invalid(format!("nodes are nested more than {MAX_DEPTH} deep, perhaps in a circle")));
        }
        // Two nodes that list a third twice, and so on, double each time.
        self.counts.nodes += 1;
        self.check_limit(InputLimit::MeshNodes, self.counts.nodes)?;
        let own = node.transform().matrix().map(|column| column.map(f64::from));
        let transform = *parent * glam::DMat4::from_cols_array_2d(&own);
        if let Some(mesh) = node.mesh() {
            mesh.primitives().try_for_each(|primitive| self.primitive(&primitive, Some(&transform)))?;
        }
        node.children().try_for_each(|child| self.node(&child, &transform, depth + 1))
    }

    fn check_limit(&self, limit: InputLimit, count: u64) -> Result<()> {
        self.limits.check(limit, count, ErrorKind::InvalidMesh)
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
        self.check_accessor(&positions, &[DataType::F32], Dimensions::Vec3)?;
        let indices = primitive.indices();
        if let Some(accessor) = &indices {
            // glTF 2.0, 3.7.2.1
            self.check_accessor(accessor, &[DataType::U8, DataType::U16, DataType::U32], Dimensions::Scalar)?;
        }
        let count = positions.count();
        let corners = indices.as_ref().map_or(count, Accessor::count);
        let triangles = match mode {
            Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
            _ => corners / 3,
        };
        self.counts.vertices += count as u64;
        self.counts.triangles += triangles as u64;
        self.check_limit(InputLimit::MeshVertices, self.counts.vertices)?;
        self.check_limit(InputLimit::MeshTriangles, self.counts.triangles)?;
        let base = self.mesh.vertices.len();
        if u32::try_from(base + count).is_err() {
            return Err(invalid("more vertices than indices of 32 bits can name"));
        }
        let buffers = &self.buffers;
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|bytes| bytes.as_slice()));
        let read = reader.read_positions().ok_or_else(|| invalid("positions that cannot be read"))?;
        self.mesh.vertices.reserve_exact(count);
        self.mesh.vertices.extend(read.take(count).map(|vertex| match transform {
            None => vertex,
            Some(transform) => {
                transform.transform_point3(glam::Vec3::from(vertex).as_dvec3()).as_vec3().to_array()
            }
        }));
        let given = self.mesh.vertices.len() - base;
        self.mesh.indices.reserve_exact(3 * triangles);
        let mut cut =
            Cut { mode, base: base as u32, given, seen: 0, held: [0; 2], out: &mut self.mesh.indices };
        match reader.read_indices() {
            Some(ReadIndices::U8(corners)) => cut.all(&mut corners.map(u32::from)),
            Some(ReadIndices::U16(corners)) => cut.all(&mut corners.map(u32::from)),
            Some(ReadIndices::U32(mut corners)) => cut.all(&mut corners),
            None if indices.is_some() => Err(invalid("indices that cannot be read")),
            None => cut.all(&mut (0..given as u32)),
        }
    }

    /// Checks that an accessor has a type that is read and is within its buffer, which the `gltf`
    /// crate does not.
    fn check_accessor(
        &mut self,
        accessor: &Accessor<'_>,
        types: &[DataType],
        dimensions: Dimensions,
    ) -> Result<()> {
        let index = accessor.index();
        let wrong = |what: &str| Err(invalid(format!("accessor {index} {what}")));
        if !types.contains(&accessor.data_type()) || accessor.dimensions() != dimensions {
            return wrong(&format!("is not {types:?} {dimensions:?}"));
        }
        let count = accessor.count();
        let limit = match dimensions {
            Dimensions::Scalar => (InputLimit::MeshTriangles, count as u64 / 3),
            _ => (InputLimit::MeshVertices, count as u64),
        };
        if count == 0 {
            return wrong("has 0 elements");
        }
        self.check_limit(limit.0, limit.1).map_err(|error| error.context(format!("accessor {index}")))?;
        if let Some(view) = accessor.view() {
            if !self.view_contains(&view, accessor.offset(), count, accessor.size()) {
                return wrong("reaches beyond its buffer");
            }
        } else if accessor.sparse().is_none() {
            return wrong("has no buffer view");
        } else {
            self.counts.zeros += count as u64;
            self.check_limit(InputLimit::MeshSparse, self.counts.zeros)
                .map_err(|error| error.context(format!("accessor {index}")))?;
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

/// Makes triangles of corners while they are read: of strips, which alternate their winding, and
/// fans, which share their first corner (glTF 2.0, 3.7.2.1).
struct Cut<'a> {
    mode: Mode,
    /// The index of the primitive's first vertex.
    base: u32,
    /// How many vertices it has.
    given: usize,
    /// How many corners were read.
    seen: usize,
    /// The two corners that the next triangle has in common with those before; of a list, those of
    /// a triangle that is not whole yet.
    held: [u32; 2],
    out: &'a mut Vec<u32>,
}

impl Cut<'_> {
    fn all(&mut self, corners: &mut dyn Iterator<Item = u32>) -> Result<()> {
        for corner in corners {
            if corner as usize >= self.given {
                return Err(invalid(format!("index {corner} of {} vertices", self.given)));
            }
            self.push(self.base + corner);
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
            (
                good.replace(r#""count":3"#, r#""count":900000000"#),
                bytes(),
                "accessor 1: 300000000 triangles of a mesh are more than the limit `mesh-triangles`",
            ),
            (
                good.replace(r#""count":4"#, r#""count":900000000"#),
                bytes(),
                "accessor 0: 900000000 vertices of a mesh are more than the limit `mesh-vertices`",
            ),
            (good.replace("5126", "5123"), bytes(), "accessor 0 is not [F32] Vec3"),
            // Indices of floats panicked in the crate.
            (good.replace("5123", "5126"), bytes(), "accessor 1 is not [U8, U16, U32] Scalar"),
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

    /// A sparse accessor without a buffer view, of which one element is not zero.
    fn sparse(count: usize) -> String {
        let accessor = format!(
            r#"{{"componentType":5126,"count":{count},"type":"VEC3","min":[0,0,0],"max":[1,1,0],
            "sparse":{{"count":1,"indices":{{"bufferView":1,"byteOffset":2,"componentType":5123}},
            "values":{{"bufferView":0,"byteOffset":12}}}}}}"#
        );
        let whole =
            r#"{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}"#;
        let text = file(4, 3, "");
        assert!(text.contains(whole));
        text.replace(whole, &accessor)
    }

    #[test]
    fn zeros_that_stand_in_no_buffer_have_a_limit() {
        let mesh = load(&sparse(4), None, &bytes()).unwrap();
        assert_eq!(mesh.vertices, [[0.; 3], [1., 0., 0.], [0.; 3], [0.; 3]]);
        // 2.3 GB from a file of a kilobyte.
        let error = load(&sparse(100_000_000), None, &bytes()).unwrap_err();
        assert!(error.message().contains("the limit `mesh-vertices`"), "{error}");
        let error = load(&sparse(30_000_000), None, &bytes()).unwrap_err();
        assert!(error.message().contains("the limit `mesh-sparse` of 4194304"), "{error}");
    }

    #[test]
    fn meshes_that_nodes_share_count_each_time() {
        // 2^20 nodes and more would be visited: each of 21 levels lists the next one twice.
        let levels: String = (0..21).map(|at| format!(r#"{{"children":[{},{0}]}},"#, at + 1)).collect();
        let nodes = format!(r#""nodes":[{levels}{{"mesh":0}}]"#);
        let text = file(4, 3, "").replace(r#""nodes":[{"mesh":0}]"#, &nodes);
        let error = load(&text, None, &bytes()).unwrap_err();
        assert!(error.message().contains("the limit `mesh-nodes` of 1048576"), "{error}");
    }

    #[test]
    fn values_of_json_are_counted_outside_of_strings() {
        assert_eq!(json_values(br#"{"a": [1, 2], "b,[{": "c\",{"}"#), 5);
        let many = file(4, 3, "")
            .replace(r#""scene":0"#, &format!(r#""scene":0,"extras":[{}0]"#, "0,".repeat(5_000_000)));
        let error = load(&many, None, &bytes()).unwrap_err();
        assert!(error.message().contains("the limit `mesh-values`"), "{error}");
    }

    #[test]
    fn buffers_of_one_file_share_it() {
        let buffer = r#"{"uri":"my%20data.bin","byteLength":56}"#;
        let text = file(4, 3, "").replace(buffer, &[buffer; 3].join(","));
        let json = gltf::Gltf::from_slice(text.as_bytes()).unwrap();
        let data = bytes();
        let files = [("dir/my data.bin", data.as_slice())];
        let all = buffers(Path::new("dir/m.gltf"), &json, None, &EmbeddedFiles(&files)).unwrap();
        assert_eq!(all.len(), 3);
        assert!(Rc::ptr_eq(&all[0], &all[1]) && Rc::ptr_eq(&all[0], &all[2]));
    }

    #[test]
    fn headers_of_binary_files_are_checked() {
        let header = |length: u32, chunk: u32| {
            let words = [2_u32, length, chunk].map(u32::to_le_bytes).concat();
            [b"glTF", &words[..], b"JSON{}  "].concat()
        };
        assert_eq!(json(&header(24, 4)).unwrap(), b"{}  ");
        // Shorter than its own header: the crate subtracts 12.
        for (length, chunk) in [(0, 4), (11, 4), (19, 4), (25, 4), (u32::MAX, 4), (24, 5), (24, u32::MAX)] {
            let error = read(Path::new("m.glb"), &header(length, chunk), None, &EmbeddedFiles(&[]));
            assert!(error.unwrap_err().message().starts_with("not glTF: "), "{length} {chunk}");
        }
        assert!(json(b"glTF").is_err());
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
