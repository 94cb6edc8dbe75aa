//! Tests of valid files with content that is rare, or not read.

use serde_json::json;

use crate::mesh::gltf::test_file::{TestFile, vertices};
use crate::mesh::material::{PictureSource, TextureSlot};
use anyhit_base::error::ErrorKind;
use anyhit_engine::machine::sampler::Filter::{Linear, Nearest};

const TRIANGLE: [[f32; 3]; 3] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]];

/// Vulkan, `VkSamplerCreateInfo`: filters without mip levels have a `maxLod` of 0.25, so that what
/// is minified has the filter of minification and level 0.
#[test]
fn filters_of_samplers_are_those_of_vulkan() {
    const ALL: f32 = 1000.0;
    for (min, wanted) in [
        (9728, (Nearest, Nearest, 0.25)),
        (9729, (Linear, Nearest, 0.25)),
        (9984, (Nearest, Nearest, ALL)),
        (9985, (Linear, Nearest, ALL)),
        (9986, (Nearest, Linear, ALL)),
        (9987, (Linear, Linear, ALL)),
    ] {
        for (mag, filter) in [(9728, Nearest), (9729, Linear)] {
            let mut file = TestFile::triangle();
            file.document["samplers"] = json!([{ "magFilter": mag, "minFilter": min }]);
            file.document["images"] = json!([{ "uri": "a.png" }]);
            file.document["textures"] = json!([{ "source": 0, "sampler": 0 }]);
            let sampler = file.open().unwrap().textures[0].sampler;
            assert_eq!(sampler.mag_filter, filter);
            assert_eq!((sampler.min_filter, sampler.mipmap_mode, sampler.max_lod.min(ALL)), wanted, "{min}");
        }
    }
    let mut file = TestFile::triangle();
    file.document["samplers"] = json!([{ "wrapT": 1 }]);
    file.document["textures"] = json!([{ "sampler": 0 }]);
    assert!(file.mistake().contains("`samplers[0].wrapT` is 1"), "{}", file.mistake());
}

/// KHR_mesh_quantization: integers as they are, or as fractions c / (2^b - 1) and
/// max(c / (2^(b-1) - 1), -1) (glTF 2.0, 3.11).
#[test]
fn quantized_positions_are_read() {
    for (component, normalized, bytes, wanted) in [
        (5122, false, &[0, 0, 0, 0, 0, 0, 100, 0, 0, 0, 0, 0, 0, 0, 156, 255, 0, 0][..], [100., -100.]),
        (5123, true, &[0, 0, 0, 0, 0, 0, 255, 255, 0, 0, 0, 0, 0, 0, 51, 51, 0, 0], [1., 0.2]),
        (5120, true, &[0, 0, 0, 127, 0, 0, 0, 128, 0], [1., -1.]),
        (5121, false, &[0, 0, 0, 255, 0, 0, 0, 7, 0], [255., 7.]),
        (5121, true, &[0, 0, 0, 255, 0, 0, 0, 51, 0], [1., 0.2]),
    ] {
        let mut file = TestFile::triangle();
        let positions = file.add(component, "VEC3", 3, bytes);
        file.document["accessors"][positions]["normalized"] = normalized.into();
        file.document["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = positions.into();
        file.document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let model = file.open().unwrap();
        let [x, y] = wanted;
        assert_eq!(vertices(&model, 0), [[0., 0., 0.], [x, 0., 0.], [0., y, 0.]], "{component}");
        assert_eq!(model.attribute(0, "position").unwrap().values[3], x);
        file.document["extensionsRequired"] = json!([]);
        assert!(file.mistake().contains("expected [Vec3] of [F32]"), "{}", file.mistake());
    }
}

/// Targets of quantized positions are quantized, too.
#[test]
fn quantized_targets_are_read() {
    let mut file = TestFile::triangle();
    let change = file.add(5122, "VEC3", 3, &[0, 0, 0, 0, 7, 0].repeat(3));
    file.document["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": change }]);
    file.document["meshes"][0]["weights"] = json!([1]);
    file.document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    assert_eq!(vertices(&file.open().unwrap(), 0), TRIANGLE.map(|[x, y, _]| [x, y, 7.]));
}

/// trimesh and three.js read the triangle beside a line.
#[test]
fn lines_and_points_are_left_out() {
    let mut file = TestFile::triangle();
    let attributes = json!({ "POSITION": 0 });
    file.document["meshes"] = json!([
        { "name": "a", "primitives": [{ "attributes": attributes, "mode": 1 }, { "attributes": attributes }] },
        { "name": "b", "primitives": [{ "attributes": attributes, "mode": 0 }] },
        { "name": "c", "primitives": [{ "attributes": {} }] }
    ]);
    let model = file.open().unwrap();
    let names: Vec<_> = model.parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["a"]);
    assert_eq!(vertices(&model, 0), TRIANGLE);
    let wanted =
        ["1 primitive of points", "1 primitive of lines", "1 primitive of triangles without positions"];
    assert_eq!(model.unread, wanted);
    for mode in [0, 1, 2, 3] {
        file.document["meshes"] = json!([{ "primitives": [{ "attributes": attributes, "mode": mode }] }]);
        assert_eq!(file.open().unwrap_err().kind(), ErrorKind::UnsupportedFile);
        let kind = if mode == 0 { "points" } else { "lines" };
        assert!(file.mistake().contains(&format!("not read: 1 primitive of {kind}")), "{}", file.mistake());
    }
    file.document["meshes"] = json!([{ "primitives": [{ "attributes": attributes, "mode": 7 }] }]);
    assert!(file.mistake().contains("`meshes[0].primitives[0].mode`: 7 is not a mode"), "{}", file.mistake());
}

/// glTF 2.0, 3.6.2.2: an accessor without a buffer view is zeros.
#[test]
fn accessors_without_a_buffer_view_are_zeros() {
    let mut file = TestFile::triangle();
    let zeros = json!({ "componentType": 5126, "count": 3, "type": "VEC3" });
    file.document["accessors"].as_array_mut().unwrap().push(zeros);
    let attributes = &mut file.document["meshes"][0]["primitives"][0]["attributes"];
    attributes["NORMAL"] = 1.into();
    let model = file.open().unwrap();
    assert_eq!(model.attribute(0, "normal").unwrap().values, [0.; 9]);
    file.document["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 1 });
    assert_eq!(vertices(&file.open().unwrap(), 0), [[0.; 3]; 3]);
    file.document["accessors"][1]["count"] = 5_000_000.into();
    assert!(file.mistake().contains("the limit `mesh-sparse`"), "{}", file.mistake());
}

/// The validator of Khronos accepts a texture without `source`. Only a scene that uses its picture
/// needs one.
#[test]
fn textures_without_a_picture_do_not_refuse_a_model() {
    let mut file = TestFile::triangle();
    file.document["textures"] = json!([
        {}, { "extensions": { "KHR_texture_basisu": { "source": 0 } } }, { "source": 1 }, { "source": 2 }
    ]);
    file.document["images"] = json!([{ "uri": "a.ktx2" }, { "uri": "http://example.com/a.png" }, {}]);
    file.document["materials"] = json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 } } }]);
    file.document["meshes"][0]["primitives"][0]["material"] = 0.into();
    file.document["extensionsUsed"] = json!(["KHR_texture_basisu"]);
    let model = file.open().unwrap();
    let reasons: Vec<_> = model
        .textures
        .iter()
        .map(|texture| match &texture.picture {
            PictureSource::Missing(reason) => reason.as_str(),
            other => panic!("{other:?}"),
        })
        .collect();
    let wanted = [
        "`textures[0]` has no `source`",
        "`textures[1]` has no `source` besides that of KHR_texture_basisu, which is not read",
        "`images[1].uri`: URIs of the scheme `http:` are not read",
        "`images[2]` has neither `uri` nor `bufferView`",
    ];
    assert_eq!(reasons, wanted);
    assert!(model.texture(0, TextureSlot::BaseColor).is_some());
    assert_eq!(model.unread, ["2 textures without a picture", "the extension KHR_texture_basisu"]);
}

/// The validator of Khronos accepts channels without a node, and scenes without nodes.
#[test]
fn animations_and_empty_scenes_do_not_refuse_a_model() {
    let mut file = TestFile::triangle();
    file.document["scenes"] = json!([{ "nodes": [0] }, {}, { "name": "empty" }]);
    let sampler = json!({ "input": 8, "output": 9 });
    file.document["animations"] = json!([{ "channels": [{ "sampler": 0, "target": { "path": "translation" } }], "samplers": [sampler] }]);
    let model = file.open().unwrap();
    assert_eq!(vertices(&model, 0), TRIANGLE);
    assert_eq!(model.unread, ["1 animation", "2 further scenes"]);
}

/// three.js: the file fails. Validator of Khronos: the buffer has no data.
#[test]
fn a_second_buffer_without_a_uri_has_no_data() {
    let mut file = TestFile::triangle();
    file.document["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 36 }));
    let model = file.open().unwrap();
    assert_eq!(vertices(&model, 0), TRIANGLE);
    file.document["bufferViews"][0]["buffer"] = 1.into();
    assert!(file.mistake().contains("`buffers[1]`, which has no data"), "{}", file.mistake());
}

/// What nothing uses is not opened.
#[test]
fn unused_buffers_are_not_read() {
    let mut file = TestFile::triangle();
    let unused = json!({ "uri": "http://example.com/a.bin", "byteLength": 4 });
    file.document["buffers"].as_array_mut().unwrap().push(unused);
    file.document["bufferViews"].as_array_mut().unwrap().push(json!({ "buffer": 1, "byteLength": 4 }));
    assert_eq!(vertices(&file.open().unwrap(), 0), TRIANGLE);
    file.document["bufferViews"][0]["buffer"] = 1.into();
    let mistake = file.mistake();
    assert!(mistake.contains("`buffers[1].uri`: URIs of the scheme `http:` are not read"), "{mistake}");
}

#[test]
fn required_extensions_are_read_skipped_or_refused_by_name() {
    for name in [
        "KHR_lights_punctual",
        "KHR_materials_unlit",
        "KHR_materials_clearcoat",
        "KHR_materials_variants",
        "KHR_texture_basisu",
        "EXT_texture_webp",
        "KHR_animation_pointer",
        "EXT_mesh_features",
    ] {
        let mut file = TestFile::triangle();
        file.document["extensionsUsed"] = json!([name]);
        file.document["extensionsRequired"] = json!([name]);
        assert_eq!(file.open().unwrap().unread, [format!("the extension {name}")]);
    }
    for name in ["KHR_materials_ior", "KHR_texture_transform", "KHR_mesh_quantization"] {
        let mut file = TestFile::triangle();
        file.document["extensionsRequired"] = json!([name]);
        assert!(file.open().unwrap().unread.is_empty());
    }
    let mut file = TestFile::triangle();
    file.document["extensionsRequired"] = json!(["KHR_materials_unlit", "ACME_voxels"]);
    assert_eq!(file.open().unwrap_err().kind(), ErrorKind::UnsupportedFile);
    assert!(file.mistake().starts_with("error: ACME_voxels: "), "{}", file.mistake());
}

/// Extensions that objects have are listed, whether the file declares them or not.
#[test]
fn extensions_of_objects_are_listed() {
    let mut file = TestFile::triangle();
    file.document["materials"] = json!([{ "extensions": {
        "KHR_materials_clearcoat": { "clearcoatFactor": 1 }, "KHR_materials_ior": { "ior": 1.25 } } }]);
    file.document["nodes"][0]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    file.document["extensionsUsed"] = json!(["KHR_materials_clearcoat", "KHR_materials_ior"]);
    let model = file.open().unwrap();
    assert_eq!(model.unread, ["the extensions KHR_lights_punctual, KHR_materials_clearcoat"]);
    assert_eq!(model.materials[0].ior, 1.25);
}

#[test]
fn compressed_triangles_are_refused_by_name() {
    let mut file = TestFile::triangle();
    let draco = json!({ "KHR_draco_mesh_compression": { "bufferView": 0, "attributes": { "POSITION": 0 } } });
    file.document["meshes"][0]["primitives"][0]["extensions"] = draco;
    file.document["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    // The accessors have the triangles, too.
    assert_eq!(vertices(&file.open().unwrap(), 0), TRIANGLE);
    file.document["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    file.document["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    let mistake = file.mistake();
    assert!(mistake.starts_with("error: KHR_draco_mesh_compression: "), "{mistake}");
    assert!(mistake.contains("`meshes[0].primitives[0]`"), "{mistake}");

    let mut file = TestFile::triangle();
    file.document["extensionsRequired"] = json!(["EXT_meshopt_compression"]);
    assert_eq!(vertices(&file.open().unwrap(), 0), TRIANGLE);
    file.document["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 36,
        "extensions": { "EXT_meshopt_compression": { "fallback": true } } }));
    file.document["bufferViews"][0] = json!({ "buffer": 1, "byteLength": 36,
        "extensions": { "EXT_meshopt_compression": { "buffer": 0, "byteLength": 36, "byteStride": 12,
            "mode": "ATTRIBUTES", "count": 3 } } });
    let mistake = file.mistake();
    assert!(mistake.starts_with("error: EXT_meshopt_compression: "), "{mistake}");
    assert!(mistake.contains("`bufferViews[0]`"), "{mistake}");
}

#[test]
fn indices_beyond_their_lists_are_errors_with_their_path() {
    let mut base = TestFile::triangle();
    base.document["cameras"] = json!([{ "type": "orthographic" }]);
    base.document["images"] = json!([{ "uri": "a.png" }]);
    for (pointer, value, wanted) in [
        ("/scene", json!(4), "`scene` names `scenes[4]`, but there are 1"),
        ("/scenes/0/nodes", json!([7]), "`scenes[0].nodes` names `nodes[7]`"),
        ("/nodes/0", json!({ "mesh": 3 }), "`nodes[0]` names `meshes[3]`"),
        ("/nodes/0", json!({ "children": [5] }), "`nodes[0].children` names `nodes[5]`"),
        ("/nodes/0", json!({ "camera": 2 }), "`nodes[0]` names `cameras[2]`"),
        ("/nodes/0", json!({ "camera": 0 }), "`cameras[0]` has the type `orthographic` without"),
        ("/nodes/0", json!({ "mesh": 0, "skin": 1 }), "names `skins[1]`"),
        ("/accessors/0/bufferView", json!(9), "`accessors[0]` names `bufferViews[9]`"),
        ("/bufferViews/0/buffer", json!(9), "`bufferViews[0]` names `buffers[9]`"),
        (
            "/bufferViews/0/byteLength",
            json!(1000),
            "`bufferViews[0]` extends beyond its buffer, `buffers[0]`",
        ),
        ("/bufferViews/0/byteStride", json!(8), "`bufferViews[0].byteStride` is less than the 12 bytes"),
        (
            "/accessors/0/componentType",
            json!(5124),
            "`accessors[0].componentType`: 5124 is not a component type",
        ),
        ("/meshes/0/primitives/0/material", json!(1), "names `materials[1]`, but there are 0"),
        ("/meshes/0/primitives/0/indices", json!(1), "primitives[0].indices` names `accessors[1]`"),
        ("/textures", json!([{ "source": 3 }]), "`textures[0]` names `images[3]`"),
        ("/textures", json!([{ "source": 0, "sampler": 2 }]), "`textures[0]` names `samplers[2]`"),
        ("/materials", json!([{ "normalTexture": { "index": 1 } }]), "`materials[0].normalTexture` names"),
        (
            "/materials",
            json!([{ "extensions": { "KHR_materials_ior": { "ior": "x" } } }]),
            "`materials[0].extensions.KHR_materials_ior.ior`: invalid type",
        ),
        ("/materials", json!([{ "alphaMode": "NONE" }]), "`materials[0].alphaMode`: unknown variant `NONE`"),
    ] {
        let mut file = TestFile { document: base.document.clone(), ..TestFile::triangle() };
        if value["skin"] == 1 {
            let primitive = &mut file.document["meshes"][0]["primitives"][0];
            primitive["attributes"] = json!({ "POSITION": 0, "JOINTS_0": 0, "WEIGHTS_0": 0 });
        }
        match file.document.pointer_mut(pointer) {
            Some(place) => *place = value,
            None => {
                let (parent, key) = pointer.rsplit_once('/').unwrap();
                file.document.pointer_mut(parent).unwrap()[key] = value;
            }
        }
        assert!(file.mistake().contains(wanted), "{wanted}: {}", file.mistake());
    }
}
