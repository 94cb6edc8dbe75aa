//! Tests of morph targets, skins and transforms that hide or flatten.

use glam::{DMat4, DVec3};
use serde_json::json;

use crate::mesh::gltf::test_file::{TestFile, vertices};

/// A triangle whose vertices follow joints, and a second node, which is the first joint.
fn skinned(joints: [[u8; 4]; 3], weights: [[f32; 4]; 3]) -> TestFile {
    let mut file = TestFile::triangle();
    let joints = file.add(5121, "VEC4", 3, joints.as_flattened());
    let weights = file.floats("VEC4", weights.as_flattened());
    let attributes = &mut file.document["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = joints.into();
    attributes["WEIGHTS_0"] = weights.into();
    file.document["scenes"][0]["nodes"] = json!([0, 1]);
    file.document["nodes"] =
        json!([{ "mesh": 0, "skin": 0, "translation": [100, 0, 0] }, { "translation": [0, 0, 5] }]);
    file.document["skins"] = json!([{ "joints": [1] }]);
    file
}

const FIRST: [f32; 4] = [1., 0., 0., 0.];

/// three.js, GLTFLoader: z is 5 and x is not moved. glTF 2.0, 3.7.3.3: the transform of the node
/// with the skin is ignored.
#[test]
fn joints_move_vertices_and_the_node_does_not() {
    let model = skinned([[0; 4]; 3], [FIRST; 3]).open().unwrap();
    assert_eq!(vertices(&model, 0), [[0., 0., 5.], [1., 0., 5.], [0., 1., 5.]]);
    assert_eq!(model.nodes[0].world, DMat4::IDENTITY);
    assert!(model.unread.is_empty(), "{:?}", model.unread);
}

/// Vertex 0 follows joint 0, vertex 1 the mean of both, vertex 2 joint 1. Joint 1 is a child of
/// joint 0 and turned by 90 degrees about z: (x, y, z) becomes (-y, x, z); its inverse bind matrix
/// moves by (0, -1, 0) first.
#[test]
fn weights_are_those_of_several_joints() {
    let half = [0.5, 0.5, 0., 0.];
    let mut file = skinned([[0; 4], [0, 1, 0, 0], [1, 0, 0, 0]], [FIRST, half, FIRST]);
    let turned = 0.5_f32.sqrt();
    file.document["nodes"][1]["children"] = json!([2]);
    let nodes = file.document["nodes"].as_array_mut().unwrap();
    nodes.push(json!({ "rotation": [0, 0, turned, turned], "translation": [0, 0, 1] }));
    let mut bind = DMat4::IDENTITY.to_cols_array().map(|x| x as f32).to_vec();
    bind.extend(DMat4::from_translation(DVec3::new(0., -1., 0.)).to_cols_array().map(|x| x as f32));
    let bind = file.floats("MAT4", &bind);
    file.document["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": bind }]);
    let normal = file.floats("VEC3", &[1., 0., 0., 1., 0., 0., 1., 0., 0.]);
    file.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normal.into();
    let model = file.open().unwrap();
    // Joint 1: (1, 0, 0) -> (1, -1, 0) -> (1, 1, 0) -> (1, 1, 6); (0, 1, 0) -> (0, 0, 6).
    let wanted = [[0., 0., 5.], [1., 0.5, 5.5], [0., 0., 6.]];
    let close = |one: &[f32], other: &[f32]| one.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-6);
    let found = vertices(&model, 0);
    assert!(close(found.as_flattened(), wanted.as_flattened()), "{found:?}");
    // The normal (1, 0, 0) of joint 1 is (0, 1, 0); the mean has unit length.
    let normals = model.attribute(0, "normal").unwrap().values;
    assert!(close(&normals, &[1., 0., 0., turned, turned, 0., 0., 1., 0.]), "{normals:?}");
}

/// three.js normalizes the weights of skins, and moves a vertex without weights by its first joint.
#[test]
fn weights_without_a_sum_of_1_are_normalized() {
    let file = skinned([[0; 4]; 3], [[0.5, 0.5, 0.5, 0.5], [0.25, 0., 0., 0.], [0.; 4]]);
    let model = file.open().unwrap();
    assert_eq!(vertices(&model, 0), [[0., 0., 5.], [1., 0., 5.], [0., 1., 5.]]);
}

#[test]
fn a_mesh_of_several_skins_is_a_mesh_for_each() {
    let mut file = skinned([[0; 4]; 3], [FIRST; 3]);
    file.document["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4, 5]);
    let nodes = file.document["nodes"].as_array_mut().unwrap();
    nodes.push(json!({ "mesh": 0, "skin": 1, "name": "bob" }));
    nodes.push(json!({ "translation": [0, 0, 7] }));
    nodes.push(json!({ "mesh": 0, "skin": 1 }));
    nodes.push(json!({ "mesh": 0, "translation": [0, 0, 9] }));
    file.document["skins"] = json!([{ "joints": [1] }, { "joints": [3] }]);
    file.document["meshes"][0]["name"] = "body".into();
    let model = file.open().unwrap();
    let names: Vec<_> = model.meshes.iter().map(|mesh| mesh.name.as_str()).collect();
    assert_eq!(names, ["body", "body@bob", "body@node#5"]);
    let meshes: Vec<_> = model.nodes.iter().map(|node| node.mesh).collect();
    assert_eq!(meshes, [0, 1, 1, 2]);
    assert_eq!([0, 1, 2].map(|part| vertices(&model, part)[0][2]), [5., 7., 0.]);
    assert_eq!(model.nodes[3].world.w_axis.z, 9.0);
}

#[test]
fn broken_skins_are_errors_with_their_path() {
    let file = skinned([[0; 4], [3, 0, 0, 0], [0; 4]], [FIRST; 3]);
    let error = file.open().unwrap().triangles(0).unwrap_err();
    let wanted = "joint 3 of `meshes[0].primitives[0].attributes.JOINTS_0` is out of range: the skin has 1";
    assert!(error.message().contains(wanted), "{error}");
    let mut file = skinned([[0; 4]; 3], [FIRST; 3]);
    file.document["skins"][0]["joints"] = json!([8]);
    assert!(file.mistake().contains("`skins[0].joints[0]` names `nodes[8]`"), "{}", file.mistake());
    file.document["skins"] = json!([{ "joints": [1, 1], "inverseBindMatrices": 2 }]);
    assert!(file.mistake().contains("`accessors[2]` is Vec4 of F32, expected [Mat4]"), "{}", file.mistake());
}

/// A skin of a mesh without joints has no effect, and is listed.
#[test]
fn a_skin_of_a_mesh_without_joints_is_not_read() {
    let mut file = skinned([[0; 4]; 3], [FIRST; 3]);
    file.document["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 0 });
    let model = file.open().unwrap();
    assert_eq!(model.nodes[0].world.w_axis.x, 100.0);
    assert_eq!(model.unread, ["1 skin of a mesh without joints"]);
}

fn morphed() -> TestFile {
    let mut file = TestFile::triangle();
    let up = file.floats("VEC3", &[0., 0., 3., 0., 0., 3., 0., 0., 3.]);
    let right = file.floats("VEC3", &[2., 0., 0., 2., 0., 0., 2., 0., 0.]);
    file.document["meshes"][0]["primitives"][0]["targets"] =
        json!([{ "POSITION": up }, { "POSITION": right }, {}]);
    file.document["meshes"][0]["weights"] = json!([1, 0, 0]);
    file
}

/// three.js, GLTFLoader: z is 3.
#[test]
fn weights_of_a_mesh_move_its_vertices() {
    let model = morphed().open().unwrap();
    assert_eq!(vertices(&model, 0), [[0., 0., 3.], [1., 0., 3.], [0., 1., 3.]]);
}

/// glTF 2.0, 3.7.2.2: the weights of a node replace those of its mesh.
#[test]
fn weights_of_nodes_replace_those_of_the_mesh() {
    let mut file = morphed();
    file.document["scenes"][0]["nodes"] = json!([0, 1, 2]);
    file.document["nodes"] =
        json!([{ "mesh": 0, "weights": [0.5, 0.25, 1] }, { "mesh": 0, "weights": [0, 0, 0] }, { "mesh": 0 }]);
    let model = file.open().unwrap();
    let first: Vec<_> = (0..3).map(|part| vertices(&model, part)[0]).collect();
    assert_eq!(first, [[0.5, 0., 1.5], [0., 0., 0.], [0., 0., 3.]]);
    assert!(model.nodes.iter().map(|node| node.mesh).eq(0..3));
}

/// Normals and tangents have unit length after the change, colours are clamped (glTF 2.0, 3.7.2.2).
#[test]
fn targets_change_normals_tangents_coordinates_and_colors() {
    let mut file = TestFile::triangle();
    let mut three = |shape: &str, value: &[f32]| file.floats(shape, &value.repeat(3));
    let attributes = [
        three("VEC3", &[0., 0., 1.]),
        three("VEC4", &[1., 0., 0., -1.]),
        three("VEC2", &[0.25, 0.5]),
        three("VEC3", &[0.5, 0.5, 0.5]),
    ];
    let targets = [
        three("VEC3", &[0., 3., 3.]),
        three("VEC3", &[0., 1., 0.]),
        three("VEC2", &[0.5, 0.]),
        three("VEC3", &[1., 0.25, -1.]),
    ];
    let names = ["NORMAL", "TANGENT", "TEXCOORD_0", "COLOR_0"];
    let primitive = &mut file.document["meshes"][0]["primitives"][0];
    primitive["targets"] = json!([{}]);
    for (name, (own, target)) in names.into_iter().zip(attributes.into_iter().zip(targets)) {
        primitive["attributes"][name] = own.into();
        primitive["targets"][0][name] = target.into();
    }
    file.document["nodes"][0]["weights"] = json!([1]);
    let model = file.open().unwrap();
    let first = |name: &str| {
        let numbers = model.attribute(0, name).unwrap();
        numbers.values[..numbers.components].to_vec()
    };
    assert_eq!(first("normal"), [0., 0.6, 0.8]);
    let diagonal = 0.5_f64.sqrt() as f32;
    assert_eq!(first("tangent"), [diagonal, diagonal, 0., -1.]);
    assert_eq!(first("texcoord_0"), [0.75, 0.5]);
    assert_eq!(first("color_0"), [1., 0.75, 0.]);
}

#[test]
fn targets_of_another_size_are_errors_with_their_path() {
    let mut file = morphed();
    let short = file.floats("VEC3", &[0.; 6]);
    file.document["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = short.into();
    let error = file.open().unwrap().triangles(0).unwrap_err();
    let wanted = "`meshes[0].primitives[0].targets[0].POSITION` has 2 elements for 3 vertices";
    assert!(error.message().contains(wanted), "{error}");
}

/// glTF 2.0, 3.5.2: a scale of zero hides a node and those below it.
#[test]
fn a_scale_of_zero_hides_a_node() {
    let mut file = TestFile::triangle();
    file.document["scenes"][0]["nodes"] = json!([0, 1]);
    file.document["nodes"] = json!([{ "mesh": 0 }, { "scale": [0, 0, 0], "children": [2] }, { "mesh": 0 }]);
    let model = file.open().unwrap();
    assert_eq!((model.nodes.len(), &model.unread[..]), (1, &["1 hidden node".to_string()][..]));
}

/// three.js draws a node of scale (2, 3, 0): a flat triangle, which no invertible transform places.
#[test]
fn a_flat_node_moves_the_vertices() {
    let mut file = TestFile::triangle();
    let normals = file.floats("VEC3", &[0., 0.6, 0.8].repeat(3));
    file.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals.into();
    file.document["nodes"][0] = json!({ "mesh": 0, "scale": [2, 3, 0], "translation": [0, 0, 4] });
    let model = file.open().unwrap();
    assert_eq!(vertices(&model, 0), [[0., 0., 4.], [2., 0., 4.], [0., 3., 4.]]);
    assert_eq!(model.nodes[0].world, DMat4::IDENTITY);
    // The plane of a flat surface has the normal z.
    assert_eq!(model.attribute(0, "normal").unwrap().values[..3], [0., 0., 1.]);
    // Below a parent of scale (1, 1, 0), a node that is turned about x is flat, too.
    file.document["nodes"] =
        json!([{ "scale": [1, 1, 0], "children": [1] }, { "mesh": 0, "rotation": [0.6, 0, 0, 0.8] }]);
    let found = vertices(&file.open().unwrap(), 0);
    // cos = 0.8^2 - 0.6^2
    assert!((found[2][1] - 0.28).abs() < 1e-6 && found[2][2] == 0.0, "{found:?}");
}

/// EXT_mesh_gpu_instancing: each instance is the node's transform times its own.
#[test]
fn a_node_has_several_instances() {
    let mut file = TestFile::triangle();
    let translations = file.floats("VEC3", &[1., 0., 0., 0., 2., 0.]);
    // (0, 0, 1, 0) as normalized bytes: half a turn about z.
    let rotations = file.add(5120, "VEC4", 2, &[0, 0, 0, 127, 0, 0, 127, 0]);
    file.document["accessors"][rotations]["normalized"] = true.into();
    file.document["nodes"][0] = json!({ "mesh": 0, "scale": [2, 2, 2], "extensions": {
        "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": translations, "ROTATION": rotations } } } });
    file.document["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let model = file.open().unwrap();
    let place = |at: usize, point: DVec3| model.nodes[at].world.transform_point3(point).to_array();
    assert_eq!(place(0, DVec3::X), [4., 0., 0.]);
    assert_eq!(place(1, DVec3::X), [-2., 4., 0.]);
    let short = file.floats("VEC3", &[1., 1., 1.]);
    file.document["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] = short.into();
    assert!(file.mistake().contains("different numbers of elements"), "{}", file.mistake());
}

/// glTF 2.0, 3.10.2: the scale of the node of a camera does not count.
#[test]
fn cameras_are_not_mirrored() {
    let mut file = TestFile::triangle();
    file.document["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1, "znear": 0.1 } }]);
    let turned = 0.5_f32.sqrt();
    for (scale, rotation, wanted) in [
        ([-1., 1., 1.], [0., 0., 0., 1.], [DVec3::X, DVec3::Y, DVec3::Z]),
        ([1., 1., -1.], [0., 0., 0., 1.], [DVec3::X, DVec3::Y, DVec3::Z]),
        ([-1., -1., 1.], [0., 0., 0., 1.], [DVec3::X, DVec3::Y, DVec3::Z]),
        // 90 degrees about z.
        ([-1., 1., 1.], [0., 0., turned, turned], [DVec3::Y, -DVec3::X, DVec3::Z]),
    ] {
        for node in [
            json!({ "camera": 0, "scale": scale, "rotation": rotation }),
            json!({ "scale": scale, "rotation": rotation, "children": [1] }),
        ] {
            file.document["nodes"] = json!([node, { "camera": 0 }]);
            let world = file.open().unwrap().cameras[0].world;
            let axes = [world.x_axis, world.y_axis, world.z_axis].map(|axis| axis.truncate());
            assert!(axes.iter().zip(wanted).all(|(one, other)| one.distance(other) < 1e-6), "{axes:?}");
        }
    }
}

/// glTF 2.0, 3.5.2: matrices are column-major and apply to what is below them.
#[test]
fn matrices_are_column_major() {
    let mut file = TestFile::triangle();
    // x to y, y to -x, z doubled, then (5, 6, 7).
    let matrix = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1];
    file.document["nodes"] =
        json!([{ "matrix": matrix, "children": [1] }, { "mesh": 0, "translation": [1, 0, 3] }]);
    let world = file.open().unwrap().nodes[0].world;
    assert_eq!(world.transform_point3(DVec3::new(0., 1., 0.)).to_array(), [4., 7., 13.]);
    file.document["nodes"][0]["matrix"] = json!([[1, 0, 0, 0]]);
    assert!(file.mistake().contains("`nodes[0].matrix[0]`: invalid type"), "{}", file.mistake());
}

/// KHR_node_visibility: a node that is not visible hides those below it.
#[test]
fn invisible_nodes_are_hidden() {
    let mut file = TestFile::triangle();
    let hidden = json!({ "KHR_node_visibility": { "visible": false } });
    file.document["scenes"][0]["nodes"] = json!([0, 1]);
    file.document["nodes"] =
        json!([{ "mesh": 0 }, { "mesh": 0, "extensions": hidden, "children": [2] }, { "mesh": 0 }]);
    file.document["extensionsRequired"] = json!(["KHR_node_visibility"]);
    let model = file.open().unwrap();
    assert_eq!((model.nodes.len(), &model.unread[..]), (1, &["2 hidden nodes".to_string()][..]));
}
