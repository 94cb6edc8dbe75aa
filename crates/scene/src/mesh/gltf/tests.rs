//! Tests of the glTF reader.

use std::collections::HashSet;

use super::*;
use crate::files::EmbeddedFiles;
use crate::mesh::gltf::container::parse;
use crate::mesh::model::{MeshFormat, Model};

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

fn open_text(text: &str, data: &[u8]) -> Result<Model> {
    let files = EmbeddedFiles(&[("dir/my data.bin", data)]);
    Model::open(MeshFormat::Gltf, Path::new("dir/m.gltf"), text.as_bytes().to_vec(), &files)
}

fn load(text: &str, name: Option<&str>, data: &[u8]) -> Result<Mesh> {
    let (model, limits) = (open_text(text, data)?, InputLimits::default());
    let parts = match name {
        None => model.placed(&limits)?,
        Some(name) => {
            let parts = model.parts_named(name, "mesh")?;
            parts.into_iter().map(|part| (part, glam::DMat4::IDENTITY)).collect()
        }
    };
    model.merged(&parts, &limits)
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

/// Elements a stride apart, so many that several threads decode them.
#[test]
fn large_meshes_do_not_depend_on_the_number_of_threads() {
    let count = 150_000_u32;
    let vertex = |at: u32| [at as f32, -0.5, 1.0 / (at + 1) as f32];
    let mut data: Vec<u8> = (0..count)
        .flat_map(|at| [vertex(at).map(f32::to_le_bytes).as_flattened(), &[at as u8, 255, 0, 0]].concat())
        .collect();
    let split = data.len();
    let corners = |last: u32| (0..count + 1).map(move |at| if at == count { last } else { at });
    data.extend(corners(7).flat_map(u32::to_le_bytes));
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":1}},"indices":2}}]}}],
        "buffers":[{{"uri":"my%20data.bin","byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{split},"byteStride":16}},
          {{"buffer":0,"byteOffset":{split},"byteLength":{}}}],
        "accessors":[
          {{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
          {{"bufferView":0,"byteOffset":12,"componentType":5121,"count":{count},"type":"VEC3",
            "normalized":true}},
          {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}]}}"#,
        data.len(),
        data.len() - split,
        count + 1
    );
    let wrong = [&data[..data.len() - 4], &count.to_le_bytes()].concat();
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let model = open_text(&text, &data).unwrap();
            let mesh = model.triangles(0).unwrap();
            assert!(mesh.vertices.iter().copied().eq((0..count).map(vertex)));
            // The last corner makes no whole triangle.
            assert!(mesh.indices.iter().copied().eq(0..count));
            let colors = model.attribute(0, "color_0").unwrap();
            let wanted = (0..count).flat_map(|at| [f32::from(at as u8) / 255.0, 1.0, 0.0]);
            assert!(colors.components == 3 && colors.values.into_iter().eq(wanted));
            let error = open_text(&text, &wrong).unwrap().triangles(0).unwrap_err();
            assert!(error.message().contains("index 150000 is out of range"), "{error}");
        });
    }
}

#[test]
fn node_transforms_apply_to_the_scene_but_not_to_a_named_mesh() {
    let text = file(4, 3, r#","translation":[10,0,0],"scale":[2,3,1]"#);
    let mesh = load(&text, None, &bytes()).unwrap();
    assert_eq!(mesh.vertices, [[10., 0., 0.], [12., 0., 0.], [10., 3., 0.], [12., 3., 0.]]);
    let mesh = load(&text, Some("quad"), &bytes()).unwrap();
    assert_eq!(mesh.vertices[3], [1., 1., 0.]);
    let error = load(&text, Some("quat"), &bytes()).unwrap_err();
    assert!(error.render().contains("meshes in the file: quad"), "{error:?}");
}

#[test]
fn broken_files_say_what_is_wrong() {
    let good = file(4, 3, "");
    for (text, data, wanted) in [
        ("{".to_string(), bytes(), "not glTF"),
        (good.clone(), bytes()[..20].to_vec(), "`buffers[0]` has 20 bytes"),
        (good.replace(r#""count":4"#, r#""count":5"#), bytes(), "`accessors[0]` extends beyond"),
        (
            good.replace(r#""count":3"#, r#""count":900000000"#),
            bytes(),
            "accessors[1]: 300000000 triangles of a mesh exceed the limit `mesh-triangles`",
        ),
        (
            good.replace(r#""count":4"#, r#""count":900000000"#),
            bytes(),
            "accessors[0]: 900000000 vertices of a mesh exceed the limit `mesh-vertices`",
        ),
        (good.replace("5126", "5123"), bytes(), "`accessors[0]` is Vec3 of U16, expected [Vec3] of [F32]"),
        (
            good.replace("5123", "5126"),
            bytes(),
            "`accessors[1]` is Scalar of F32, expected [Scalar] of [U8, U16, U32]",
        ),
        (good.replace("my%20data.bin", "my%2"), bytes(), "invalid URI"),
        (
            good.clone(),
            [&bytes()[..48], &[0, 0, 1, 0, 77, 0, 0, 0]].concat(),
            "index 77 is out of range: there are 4 vertices",
        ),
    ] {
        let error = load(&text, None, &data).unwrap_err();
        assert!(error.message().contains(wanted), "{wanted}: {error:?}");
        assert!(error.to_string().contains("m.gltf"), "{error}");
    }
    let error = load(&good.replace("my%20data", "gone"), None, &bytes()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Io);
    assert!(error.message().starts_with("`buffers[0].uri`: "), "{error}");
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
fn values_of_json_have_a_limit() {
    let many = file(4, 3, "")
        .replace(r#""scene":0"#, &format!(r#""scene":0,"extras":[{}0]"#, "0,".repeat(5_000_000)));
    let error = load(&many, None, &bytes()).unwrap_err();
    assert!(error.message().contains("the limit `mesh-values`"), "{error}");
}

#[test]
fn buffers_of_one_file_share_it() {
    let buffer = r#"{"uri":"my%20data.bin","byteLength":56}"#;
    let text = file(4, 3, "").replace(buffer, &[buffer; 3].join(","));
    let (mut document, _) = parse(text.into_bytes(), &InputLimits::default()).unwrap();
    let data = bytes();
    let files = EmbeddedFiles(&[("dir/my data.bin", data.as_slice())]);
    let used = HashSet::from([0, 2]);
    let all = buffers::load(Path::new("dir/m.gltf"), &mut document, &used, None, &files).unwrap();
    let [Some(first), None, Some(last)] = &all[..] else { panic!("{}", all.len()) };
    assert!(Arc::ptr_eq(first, last));
}

#[test]
fn headers_of_binary_files_are_checked() {
    let header = |length: u32, chunk: u32| {
        let words = [2_u32, length, chunk].map(u32::to_le_bytes).concat();
        [b"glTF", &words[..], b"JSON{}  "].concat()
    };
    // A whole header with a document that is not glTF.
    let error = parse(header(24, 4), &InputLimits::default()).unwrap_err();
    assert!(error.message().contains("missing field `asset`"), "{error}");
    for (length, chunk) in [(0, 4), (11, 4), (19, 4), (25, 4), (u32::MAX, 4), (24, 5), (24, u32::MAX)] {
        let bytes = header(length, chunk);
        let error =
            Model::open(MeshFormat::Gltf, Path::new("m.glb"), bytes, &EmbeddedFiles(&[])).unwrap_err();
        assert!(error.message().starts_with("not glTF: the "), "{length} {chunk}: {error}");
    }
    assert!(parse(b"glTF".to_vec(), &InputLimits::default()).is_err());
}
