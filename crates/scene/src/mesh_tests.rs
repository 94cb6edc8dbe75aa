//! Tests of models in scenes: geometries, instances, attributes, tables, textures and cameras.

use std::path::Path;

use crate::image::Picture;
use crate::resources::Resource;
use crate::{EmbeddedFiles, LoadOptions, ResolvedScene, load_text};
use anyhit_base::error::Result;
use anyhit_engine::accel::GeometryData;
use anyhit_engine::machine::format::Format;
use anyhit_engine::machine::sampler::{AddressMode, Filter};

/// A floor of one primitive, a lamp of two that share the floor's vertices, and a camera. The
/// first primitive has normals, texture coordinates and colours, the others positions alone.
const ROOM: &str = r#"{
  "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
  "nodes": [
    { "translation": [10, 0, 0], "children": [1, 2, 3] },
    { "name": "ground", "mesh": 0, "scale": [2, 2, 2] },
    { "name": "light", "mesh": 1, "translation": [0, 5, 0] },
    { "name": "eye", "camera": 0, "translation": [0, 0, 3], "scale": [4, 4, 4] }
  ],
  "cameras": [{ "type": "perspective", "perspective": { "yfov": 1, "aspectRatio": 2, "znear": 0.5, "zfar": 8 } }],
  "meshes": [
    { "name": "floor", "primitives": [{ "material": 1, "indices": 4,
      "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3, "_FEATURE_ID_0": 4 } }] },
    { "name": "lamp", "primitives": [
      { "attributes": { "POSITION": 0 }, "indices": 4, "material": 0 },
      { "attributes": { "POSITION": 0 } }] }
  ],
  "materials": [
    { "name": "glow", "emissiveFactor": [1, 0.5, 0.25], "alphaMode": "BLEND",
      "pbrMetallicRoughness": { "metallicFactor": 0 } },
    { "name": "tiles", "doubleSided": true, "normalTexture": { "index": 1, "scale": 0.5, "extensions": {
        "KHR_texture_transform": { "offset": [0, 1], "rotation": 1.57079632679, "scale": [0.5, 0.5], "texCoord": 1 } } },
      "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 0.125, 1], "roughnessFactor": 0.75,
        "baseColorTexture": { "index": 0, "extensions": {
          "KHR_texture_transform": { "offset": [0.5, 0.25], "scale": [2, 4] } } } } }
  ],
  "textures": [{ "source": 0, "sampler": 0 }, { "source": 0 }],
  "samplers": [{ "magFilter": 9728, "minFilter": 9729, "wrapS": 33071 }],
  "images": [{ "uri": "tile.png" }],
  "buffers": [{ "uri": "room.bin", "byteLength": 102 }],
  "bufferViews": [
    { "buffer": 0, "byteLength": 36 }, { "buffer": 0, "byteOffset": 36, "byteLength": 36 },
    { "buffer": 0, "byteOffset": 72, "byteLength": 12 }, { "buffer": 0, "byteOffset": 84, "byteLength": 12 },
    { "buffer": 0, "byteOffset": 96, "byteLength": 6 }
  ],
  "accessors": [
    { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
    { "bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3" },
    { "bufferView": 2, "componentType": 5123, "normalized": true, "count": 3, "type": "VEC2" },
    { "bufferView": 3, "componentType": 5121, "normalized": true, "count": 3, "type": "VEC4" },
    { "bufferView": 4, "componentType": 5123, "count": 3, "type": "SCALAR" }
  ]
}"#;

/// The room with an animation that is at (0, 0, 1) at its end, the translation of all nodes.
fn lift() -> String {
    let indices = r#"{ "bufferView": 4, "componentType": 5123, "count": 3, "type": "SCALAR" }"#;
    let times = r#"{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "SCALAR" }"#;
    let animation = r#"{ "name": "rise", "samplers": [{ "input": 5, "output": 1 }],
        "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }] }"#;
    ROOM.replace(indices, &format!("{indices}, {times}"))
        .replace(r#""cameras": ["#, &format!(r#""animations": [{animation}], "cameras": ["#))
}

/// The room without the picture of its first texture.
fn bare() -> String {
    ROOM.replace(r#"{ "source": 0, "sampler": 0 }"#, r#"{ "sampler": 0 }"#)
}

const HOUSE: &str = "o house\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nusemtl brick\nf 1 2 3\nusemtl glass\nf 2 4 3\n\
    o roof\nf 1 2 4\n";

fn room_bytes() -> Vec<u8> {
    let positions: [f32; 9] = [0., 0., 0., 1., 0., 0., 0., 1., 0.];
    let normals: [f32; 9] = [0., 0., 1., 0., 0., 1., 0., 0., 1.];
    let mut bytes: Vec<u8> = positions.iter().chain(&normals).flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0, 0, 0, 0, 255, 255, 0, 0, 0, 0, 255, 255]);
    bytes.extend([255, 0, 51, 255, 0, 0, 0, 0, 255, 255, 255, 102]);
    bytes.extend([0, 0, 2, 0, 1, 0]);
    bytes
}

fn try_scene(text: &str) -> Result<ResolvedScene> {
    let room = room_bytes();
    let format = Format { srgb: false, ..Format::RGBA8_SRGB };
    let tile = Picture { format, extent: [1, 1], texels: vec![255, 128, 0, 255] }
        .encode_png(crate::image::PixelEncoding::STORED)?;
    let (lift, bare) = (lift(), bare());
    let empty = ROOM.replace(r#"{ "translation": [10, 0, 0],"#, r#"{ "scale": [0, 0, 0],"#);
    let wide = ROOM.replace(r#""yfov": 1"#, r#""yfov": 4"#);
    let files = [
        ("wide.gltf", wide.as_bytes()),
        ("empty.gltf", empty.as_bytes()),
        ("lift.gltf", lift.as_bytes()),
        ("bare.gltf", bare.as_bytes()),
        ("room.gltf", ROOM.as_bytes()),
        ("room.bin", &room[..]),
        ("tile.png", &tile[..]),
        ("house.obj", HOUSE.as_bytes()),
    ];
    let text = format!("version = 1\n{text}");
    load_text(Path::new("s.toml"), &text, &EmbeddedFiles(&files), &LoadOptions::default())
}

fn scene(text: &str) -> ResolvedScene {
    try_scene(text).unwrap_or_else(|error| panic!("{}", error.render()))
}

/// The message of a scene that is wrong, with its notes.
fn mistake(text: &str) -> String {
    try_scene(text).unwrap_err().render()
}

/// The bytes of data in a scene with the room.
fn data(piece: &str) -> Vec<u8> {
    let text = format!("push_constants = {piece}\n[[model]]\nfile = 'room.gltf'\n");
    scene(&text).push_constants.bytes().unwrap().to_vec()
}

fn floats(piece: &str) -> Vec<f32> {
    let bytes = data(piece);
    bytes.as_chunks::<4>().0.iter().map(|word| f32::from_le_bytes(*word)).collect()
}

fn words(piece: &str) -> Vec<u32> {
    let bytes = data(piece);
    bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect()
}

#[test]
fn a_model_makes_geometries_structures_and_instances() {
    let scene = scene(
        "[geometry.own]\ntype = 'plane'\n[[instance]]\ngeometry = 'own'\n[[model]]\nfile = 'room.gltf'\n\
         name = 'room'\ntranslate = [0, 0, 1]\ncustom_index = 'geometry'\nsbt_offset = 2\nopaque = 'alpha_mode'\n\
         [model.meshes.lamp]\nmask = 6\nflags = 'triangle_facing_cull_disable'\nsbt_offset = 'mesh'\n",
    );
    let (name, tlas) = &scene.tlas[0];
    let [own, ground, light] = tlas.instances() else { panic!("{}", tlas.instances().len()) };
    assert_eq!((name.as_str(), own.transform[0][3]), ("main", 0.0));
    // The node's scale, then its parent's shift, then the model's own.
    assert_eq!(ground.transform, [[2., 0., 0., 10.], [0., 2., 0., 0.], [0., 0., 2., 1.]]);
    assert_eq!(light.transform, [[1., 0., 0., 10.], [0., 1., 0., 5.], [0., 0., 1., 1.]]);
    assert_eq!((ground.custom_index, ground.mask, ground.sbt_record_offset), (0, 0xff, 2));
    assert_eq!((light.custom_index, light.mask, light.sbt_record_offset), (1, 6, 1));
    assert_eq!((ground.flags.0, light.flags.0), (0, 1));
    let names = [vec!["own"], vec!["room.floor"], vec!["room.lamp.0", "room.lamp.1"]];
    assert!(scene.geometry_names[0].iter().map(|list| &list[..]).eq(names));
    // `glow` is blended; the last primitive has the default material.
    let opaque = |at: usize| light.blas.geometries()[at].flags.0;
    assert_eq!([ground.blas.geometries()[0].flags.0, opaque(0), opaque(1)], [1, 0, 1]);
    let GeometryData::Triangles { vertices, indices, transform } = &ground.blas.geometries()[0].data else {
        panic!()
    };
    assert_eq!(vertices[..], [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
    assert_eq!((indices.as_deref(), transform), (Some(&[0, 2, 1][..]), &None));
}

#[test]
fn objects_and_groups_of_obj_are_geometries() {
    let scene =
        scene("[[model]]\nfile = 'house.obj'\n[[model]]\nfile = 'house.obj'\nname = 'b'\ntlas = 'b'\n");
    let names = |structure: usize| scene.geometry_names[structure].iter().map(|list| &list[..]);
    assert!(names(0).eq([vec!["house.0", "house.1"], vec!["roof"]]));
    assert!(names(1).eq([vec!["b.house.0", "b.house.1"], vec!["b.roof"]]));
}

#[test]
fn names_that_clash_are_mistakes() {
    let own = "[geometry.floor]\ntype = 'plane'\n[[model]]\nfile = 'room.gltf'\n";
    assert!(mistake(own).contains("two geometries or meshes are named `floor`"), "{}", mistake(own));
    let twice = mistake("[[model]]\nfile = 'room.gltf'\n[[model]]\nfile = 'room.gltf'\n");
    assert!(twice.contains("two geometries or meshes are named `lamp.1`"), "{twice}");
    assert!(twice.contains("set `name = \"...\"` on the model to prefix the names of its meshes"), "{twice}");
    let unknown = mistake("[[model]]\nfile = 'room.gltf'\n[model.meshes.flor]\nmask = 1\n");
    assert!(unknown.contains("the file has no mesh `flor`"), "{unknown}");
    assert!(unknown.contains("did you mean `floor`?"), "{unknown}");
    assert!(mistake("[[model]]\nfile = 'room.bin'\n").contains("mesh files end in .gltf, .glb or .obj"));
}

#[test]
fn a_geometry_of_several_primitives_says_which() {
    let geometry = |keys: &str| format!("[geometry.a]\n{keys}\n[[instance]]\ngeometry = 'a'\n");
    let count = |keys: &str| {
        let scene = scene(&geometry(keys));
        scene.tlas[0].1.instances()[0].blas.geometries()[0].data.primitive_count()
    };
    let all = mistake(&geometry("type = 'gltf'\nfile = 'room.gltf'"));
    assert!(all.contains("the file has 3 primitives, but a geometry holds one"), "{all}");
    assert!(all.contains("available: floor, lamp (2 primitives)"), "{all}");
    assert!(all.contains("select one with `mesh` and `primitive`, merge all with `merge = true`"), "{all}");
    let lamp = mistake(&geometry("type = 'gltf'\nfile = 'room.gltf'\nmesh = 'lamp'"));
    assert!(lamp.contains("`lamp` has 2 primitives, but a geometry holds one"), "{lamp}");
    let house = mistake(&geometry("type = 'obj'\nfile = 'house.obj'"));
    assert!(house.contains("available: house (2 primitives), roof"), "{house}");
    let beyond = mistake(&geometry("type = 'gltf'\nfile = 'room.gltf'\nmesh = 'lamp'\nprimitive = 2"));
    assert!(beyond.contains("primitive 2 is out of range: there are 2 (counted from 0)"), "{beyond}");
    assert_eq!(count("type = 'gltf'\nfile = 'room.gltf'\nmerge = true"), 3);
    assert_eq!(count("type = 'gltf'\nfile = 'room.gltf'\nmesh = 'lamp'\nprimitive = 1"), 1);
    assert_eq!(count("type = 'obj'\nfile = 'house.obj'\nobject = 'house'\nmerge = true"), 2);
    assert_eq!(count("type = 'obj'\nfile = 'house.obj'\nobject = 'roof'"), 1);
}

#[test]
fn textures_are_transformed_as_their_extension_says() {
    let columns = "'base_color_transform', 'base_color_texcoord'";
    let piece = format!("{{ mesh = 'floor', material = [{columns}] }}");
    let found = floats(&piece);
    assert_eq!(found[..6], [2.0, 0.0, 0.5, 0.0, 4.0, 0.25]);
    assert_eq!(found[6].to_bits(), 0);
    // The extension's example: the lower left quarter of the picture, turned. v counts down, so
    // that (u, v) becomes (v / 2, 1 - u / 2); a float is not exactly a quarter of a turn.
    let found = floats("{ mesh = 'floor', material = ['normal_transform', 'normal_texcoord'] }");
    let wanted = [0.0, 0.5, 0.0, -0.5, 0.0, 1.0];
    assert!(found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-7), "{found:?}");
    assert_eq!(found[6].to_bits(), 1);
    // The lamp's first material has no textures: nothing is transformed.
    let found = floats("{ mesh = 'lamp', material = ['base_color_transform'] }");
    assert_eq!(found[..6], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    // Coordinates (0, 0), (1, 1), (0, 0) as 65535ths, by 2 and 4 and moved.
    let found = floats("{ mesh = 'floor', attribute = 'texcoord', texture_transform = 'base_color' }");
    let plain = floats("{ mesh = 'floor', attribute = 'texcoord' }");
    let moved = plain.chunks(2).flat_map(|pair| [2.0 * pair[0] + 0.5, 4.0 * pair[1] + 0.25]);
    assert_eq!(found, moved.collect::<Vec<_>>());
    // Other attributes stay.
    let normals = floats("{ mesh = 'floor', attribute = 'normal', texture_transform = 'base_color' }");
    assert_eq!(normals, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
}

#[test]
fn attributes_of_an_application_have_their_name_with_its_underscore() {
    assert_eq!(words("{ mesh = 'floor', attribute = '_feature_id_0', format = 'u32' }"), [0, 2, 1]);
}

#[test]
fn attributes_are_converted_to_formats() {
    assert_eq!(floats("{ mesh = 'floor', attribute = 'normal' }"), [0., 0., 1.].repeat(3));
    // 65535 of 65535 is 1; of three components the fourth is 1.
    let coordinates = floats("{ mesh = 'floor', attribute = 'texcoord', format = 'f32x4' }");
    assert_eq!(coordinates, [0., 0., 0., 1., 1., 0., 0., 1., 0., 1., 0., 1.]);
    // 51 / 255 = 0.2, 102 / 255 = 0.4
    let colors = floats("{ mesh = 'floor', attribute = 'color_0' }");
    assert_eq!(colors, [1., 0., 0.2, 1., 0., 0., 0., 0., 1., 1., 1., 0.4]);
    let bytes = data("{ mesh = 'floor', attribute = 'color_0', format = 'u8x4' }");
    assert_eq!(bytes, [255, 0, 51, 255, 0, 0, 0, 0, 255, 255, 255, 102]);
    assert_eq!(data("{ mesh = 'floor', attribute = 'index', format = 'u16' }"), [0, 0, 2, 0, 1, 0]);
    assert_eq!(words("{ mesh = 'lamp', attribute = 'index' }"), [0, 2, 1, 0, 1, 2]);
}

#[test]
fn several_attributes_are_interleaved_with_a_stride() {
    let piece = "{ mesh = 'lamp.0', attribute = ['position', 'normal'], format = ['f32x2', 'snorm8x4'], \
                 missing = [0, 0, -1, 0], stride = 16 }";
    let row = |x: f32, y: f32| [x.to_bits(), y.to_bits(), 0x0081_0000, 0];
    assert_eq!(words(piece), [row(0., 0.), row(1., 0.), row(0., 1.)].concat());
}

#[test]
fn tables_have_the_columns_that_are_asked_for() {
    // The columns of the matrix: twice each axis, then the place; the mesh, its first geometry, how
    // many there are, and the first one's material.
    let ground = words("{ mesh = 'floor', table = 'instances' }");
    let matrix = |s: f32, x: f32, y: f32| {
        [s, 0., 0., 0., 0., s, 0., 0., 0., 0., s, 0., x, y, 0., 1.].map(f32::to_bits).to_vec()
    };
    let parts = [matrix(2., 10., 0.), matrix(0.5, -5., -0.0), vec![0, 0, 1, 1]];
    let with_positive_zeros = |words: &[u32]| -> Vec<u32> {
        words.iter().map(|word| if *word == 0x8000_0000 { 0 } else { *word }).collect()
    };
    assert_eq!(with_positive_zeros(&ground), with_positive_zeros(&parts.concat()));
    let rows =
        words("{ table = 'instances', columns = ['object_to_world_3x4', 'material', 'mesh', 'mask'] }");
    let light = [1., 0., 0., 10., 0., 1., 0., 5., 0., 0., 1., 0_f32].map(f32::to_bits);
    assert_eq!(rows[15..], [&light[..], &[0, 1, 0xff]].concat());
    // Two geometries of three vertices and three indices each; the default material is the third.
    let lamp = words("{ mesh = 'lamp', table = 'geometries' }");
    assert_eq!(lamp, [[0, 3, 0, 3, 1, 0], [3, 3, 3, 3, 1, 2]].concat());
    let columns = "columns = ['emissive', 'alpha_mode', 'base_color_texture', 'double_sided']";
    let materials = words(&format!("{{ mesh = 'floor', table = 'materials', {columns} }}"));
    let glow = [1.0_f32.to_bits(), 0.5_f32.to_bits(), 0.25_f32.to_bits(), 2, u32::MAX, 0];
    assert_eq!(materials, [glow, [0, 0, 0, 0, 0, 1], [0, 0, 0, 0, u32::MAX, 0]].concat());
    let own = floats("{ mesh = 'floor', material = ['base_color', 'roughness', 'normal_scale'] }");
    assert_eq!(own, [0.5, 0.25, 0.125, 1.0, 0.75, 0.5]);
}

#[test]
fn tables_have_numbers_of_the_scene_and_of_materials() {
    let lamp =
        |columns: &str| data(&format!("{{ mesh = 'lamp', table = 'geometries', columns = [{columns}] }}"));
    // A material of the renderer's own for each geometry, of two bytes, and one flag for all.
    let own = lamp("'first_index', { u16 = [4, 2] }, { u8 = 7 }, { zeros = 1 }");
    assert_eq!(own, [0, 0, 0, 0, 4, 0, 7, 0, 3, 0, 0, 0, 2, 0, 7, 0]);
    let vectors = lamp("{ f16 = [[1, 2], [3, 4]] }, { every = { i8 = [-1, -2] } }");
    assert_eq!(vectors, [0, 0x3c, 0, 0x40, 255, 254, 0, 0x42, 0, 0x44, 255, 254]);
    // Geometry 0 has the material 0, and the other one the default material, 2.
    let narrow =
        lamp("{ column = 'material', type = 'u8' }, { column = 'base_color_texture', type = 'u16' }");
    assert_eq!(narrow, [0, 255, 255, 2, 255, 255]);
    let wide = lamp("{ column = 'material', type = 'u64' }, { column = 'normal_texture', type = 'u64' }");
    assert_eq!(wide[16..], [[2, 0, 0, 0, 0, 0, 0, 0], [255; 8]].concat());
    // What the materials say: `glow` is no metal, and the default is one.
    let of_material =
        words("{ mesh = 'lamp', table = 'geometries', columns = ['metallic', 'alpha_mode', 'material'] }");
    assert_eq!(of_material, [0, 2, 0, 1.0_f32.to_bits(), 0, 2]);
    let textures = "columns = ['base_color_texture', 'normal_texture', 'first_vertex']";
    assert_eq!(words(&format!("{{ mesh = 'floor', table = 'geometries', {textures} }}")), [0, 1, 0]);
    // The instances are the floor and the lamp, whose first geometry counts.
    let instances = "{ table = 'instances', columns = ['normal_texture', 'roughness', { u32 = [8, 9] }] }";
    let (rough, whole) = (0.75_f32.to_bits(), 1.0_f32.to_bits());
    assert_eq!(words(instances), [1, rough, 8, u32::MAX, whole, 9]);
    let row = words("{ mesh = 'floor', material = ['normal_texture', { u32 = 3 }] }");
    assert_eq!(row, [1, 3]);

    let of = |columns: &str| {
        let piece = format!("{{ mesh = 'lamp', table = 'geometries', columns = [{columns}] }}");
        mistake(&format!("push_constants = {piece}\n[[model]]\nfile = 'room.gltf'\n"))
    };
    for (columns, words) in [
        ("{ u32 = [1, 2, 3] }", "the column has 3 rows, but the table has 2"),
        ("{ u32 = [[1, 2], [3]] }", "all rows of a column must have the same number of values"),
        ("{ u8 = [1, 256] }", "256"),
        ("{ u8 = 1, u16 = 2 }", "a column must have numbers of one type"),
        ("{ every = {} }", "one list of numbers with their type"),
        ("{ column = 'metallic', type = 'u8' }", "`type` applies only to columns of integers"),
        ("{ column = 'material', type = 'f32' }", "`f32`"),
        ("'base_colour'", "did you mean `base_color`?"),
    ] {
        let error = of(columns);
        assert!(error.contains(words), "{columns}: {error}");
    }
}

#[test]
fn a_number_that_does_not_fit_its_column_is_a_mistake() {
    let vertices: String = (0..86).map(|at| format!("v {at} 0 0\nv {at} 1 0\nv {at} 0 1\n")).collect();
    let first: String =
        (0..85).map(|at| format!("f {} {} {}\n", 3 * at + 1, 3 * at + 2, 3 * at + 3)).collect();
    let wide = format!("{vertices}o first\n{first}o second\nf 256 257 258\n");
    let load = |column: &str| {
        let piece = format!("{{ mesh = 'm', table = 'geometries', columns = [{column}] }}");
        let text =
            format!("version = 1\npush_constants = {piece}\n[[model]]\nfile = 'wide.obj'\nname = 'm'\n");
        let files = [("wide.obj", wide.as_bytes())];
        load_text(Path::new("s.toml"), &text, &EmbeddedFiles(&files), &LoadOptions::default())
    };
    // 85 triangles are before the second: 255, which would be what is not there.
    let error = load("{ column = 'first_index', type = 'u8' }").unwrap_err().render();
    assert!(error.contains("the number 255 in row 1 is too large for its column"), "{error}");
    let scene = load("{ column = 'first_index', type = 'u16' }").unwrap();
    assert_eq!(scene.push_constants.bytes().unwrap(), [0, 0, 255, 0]);
}

#[test]
fn tables_point_to_what_their_numbers_count() {
    let addresses = |piece: &str| {
        let text = format!(
            "push_constants = {piece}\n[resources.vertices]\ntype = 'buffer'\nsize = 96\n[geometry.own]\n\
             type = 'plane'\n[[instance]]\ngeometry = 'own'\n[[model]]\nfile = 'room.gltf'\n"
        );
        let (bytes, addresses) = scene(&text).push_constants.flattened();
        let places: Vec<_> = addresses.iter().map(|(at, of)| (*at, of.offset.value)).collect();
        (bytes, places)
    };
    // Two geometries of three vertices, 12 bytes each, behind 8 bytes of something else.
    let column = "{ address_of = 'vertices', offset = 8, stride = 12, by = 'first_vertex' }";
    let lamp =
        format!("{{ mesh = 'lamp', table = 'geometries', columns = ['vertex_count', 'padding', {column}] }}");
    assert_eq!(
        addresses(&lamp),
        ([[3, 0, 0, 0].to_vec(), vec![0; 12]].concat().repeat(2), vec![(8, 8), (24, 44)])
    );
    // The plane is in no file and has no geometry there: null. Then `floor`, 0, and `lamp`, 1.
    let column = "{ address_of = 'vertices', stride = 16, by = 'geometry' }";
    let rows = format!("{{ table = 'instances', columns = {column}, stride = 12, repeat = 2 }}");
    assert_eq!(addresses(&rows), (vec![0; 72], vec![(12, 0), (24, 16), (48, 0), (60, 16)]));

    let of = |piece: &str| mistake(&format!("push_constants = {piece}\n[[model]]\nfile = 'room.gltf'\n"));
    let count = of(
        "{ mesh = 'lamp', table = 'geometries', columns = { address_of = 'a', stride = 4, by = 'vertex_count' } }",
    );
    assert!(count.contains("`by` must name a column of indices"), "{count}");
    assert!(count.contains("one of: first_vertex, first_index, first_triangle, mesh, material"), "{count}");
    let missing =
        of("{ mesh = 'lamp', table = 'geometries', columns = { address_of = 'a', by = 'material' } }");
    assert!(missing.contains("`stride` is missing"), "{missing}");
}

#[test]
fn mistakes_in_pieces_list_what_there_is() {
    let of = |piece: &str| mistake(&format!("push_constants = {piece}\n[[model]]\nfile = 'room.gltf'\n"));
    let tangent = of("{ mesh = 'floor', attribute = 'tangent' }");
    assert!(tangent.contains("`floor` has no attribute `tangent`"), "{tangent}");
    for name in ["position", "normal", "texcoord_0", "color_0", "index"] {
        assert!(tangent.lines().any(|line| line.contains("it has: ") && line.contains(name)), "{tangent}");
    }
    let unknown = of("{ mesh = 'flor', attribute = 'normal' }");
    assert!(unknown.contains("no mesh is named `flor`"), "{unknown}");
    assert!(unknown.contains("available: floor, lamp, lamp.0, lamp.1"), "{unknown}");
    assert!(of("{ mesh = 'floor' }").contains("needs one of `attribute`, `table` and `material`"));
    assert!(of("{ table = 'materials' }").contains("`mesh` is missing"));
    let stride = of("{ mesh = 'floor', attribute = 'normal', stride = 8 }");
    assert!(stride.contains("the `stride` is less than the 12 bytes of a row"), "{stride}");
    let formats = of("{ mesh = 'floor', attribute = ['normal', 'position'], format = 'f32x3' }");
    assert!(formats.contains("1 formats for 2 attributes"), "{formats}");
    let index = of("{ mesh = 'floor', attribute = 'index', format = 'f32x3' }");
    assert!(index.contains("the format of indices must be `u16` or `u32`"), "{index}");
}

#[test]
fn textures_and_samplers_come_from_materials() {
    let image = |name: &str, binding: u32, texture: &str| {
        format!(
            "[resources.{name}]\ntype = 'combined_image_sampler'\nbinding = {binding}\nfile = {{ {texture} }}\n\
             sampler = {{ {texture} }}\n"
        )
    };
    let color = "mesh = 'floor', texture = 'base_color'";
    let text = [
        image("a", 0, color),
        image("b", 1, "mesh = 'floor', texture = 'normal'"),
        image("c", 2, "mesh = 'floor', texture = 1"),
    ];
    let scene = scene(&format!("{}[[model]]\nfile = 'room.gltf'\n", text.concat()));
    let of = |at: usize| match &scene.resources[at].resource {
        Resource::CombinedImageSampler(image, sampler) => (image, sampler),
        other => panic!("{other:?}"),
    };
    let (image, sampler) = of(0);
    assert_eq!(
        (image.format, &*image.texels.bytes().unwrap()),
        (Format::RGBA8_SRGB, &[255, 128, 0, 255][..])
    );
    assert_eq!(
        (sampler.mag_filter, sampler.min_filter, sampler.max_lod),
        (Filter::Nearest, Filter::Linear, 0.25)
    );
    assert_eq!(sampler.address_mode[..2], [AddressMode::ClampToEdge, AddressMode::Repeat]);
    // A normal map is no colour.
    assert_eq!(of(1).0.format, Format { srgb: false, ..Format::RGBA8_SRGB });
    assert_eq!(*of(2).0.texels.bytes().unwrap(), [255, 128, 0, 255]);
    let missing = |texture: &str| mistake(&format!("{}[[model]]\nfile = 'room.gltf'\n", image_of(texture)));
    let emissive = missing("mesh = 'floor', texture = 'emissive'");
    assert!(emissive.contains("`floor` has no texture `emissive`"), "{emissive}");
    assert!(emissive.contains("its material has: base_color, normal"), "{emissive}");
    let beyond = missing("mesh = 'floor', texture = 2");
    assert!(beyond.contains("texture 2 is out of range: there are 2 (counted from 0)"), "{beyond}");
}

/// The floor's base colour is texture 0, its normal map texture 1; each has its own sampler.
#[test]
fn all_textures_of_a_file_are_the_elements_of_an_array() {
    let model = "[[model]]\nfile = 'room.gltf'\n[[model]]\nfile = 'house.obj'\nname = 'house'\n";
    let text = |keys: &str, mesh: &str| {
        format!(
            "[resources.all]\nbinding = 6\nfile = {{ mesh = '{mesh}', textures = 'all' }}\n{keys}\n{model}"
        )
    };
    let combined = scene(&text("type = 'combined_image_sampler'\nelement = 2", "floor"));
    let of = |at: usize| match &combined.resources[at].resource {
        Resource::CombinedImageSampler(image, sampler) => (image, sampler),
        other => panic!("{other:?}"),
    };
    let names: Vec<_> = combined.resources.iter().map(|one| (one.name.as_str(), one.element)).collect();
    assert_eq!(names, [("all", 2), ("all[1]", 3)]);
    let linear = Format { srgb: false, ..Format::RGBA8_SRGB };
    assert_eq!((of(0).0.format, of(1).0.format), (Format::RGBA8_SRGB, linear), "a normal map is no colour");
    assert_eq!((of(0).1.mag_filter, of(1).1.mag_filter), (Filter::Nearest, Filter::Linear));
    // A format and a sampler that are given count for all.
    let keys = "type = 'combined_image_sampler'\nformat = 'rgba8'\nsampler = { filter = 'linear' }";
    let given = scene(&text(keys, "floor"));
    for one in &given.resources {
        let Resource::CombinedImageSampler(image, sampler) = &one.resource else { panic!() };
        assert_eq!((image.format, sampler.mag_filter), (linear, Filter::Linear));
    }
    let separate = "[resources.samplers]\ntype = 'sampler'\nbinding = 7\nsampler = { mesh = 'floor', textures = 'all' }\n";
    let separate = scene(&(separate.to_owned() + &text("type = 'sampled_image'", "floor")));
    let kinds: Vec<_> = separate.resources.iter().map(|one| std::mem::discriminant(&one.resource)).collect();
    assert_eq!((kinds.len(), kinds[0] == kinds[1], kinds[2] == kinds[3]), (4, true, true));
    // A file without textures has one white texel.
    let white = scene(&text("type = 'combined_image_sampler'\nlevels = 3", "house"));
    let [one] = &white.resources[..] else { panic!("{:?}", white.resources) };
    let Resource::CombinedImageSampler(image, _) = &one.resource else { panic!() };
    assert_eq!(
        (image.format, image.shape.extent, &*image.texels.bytes().unwrap()),
        (linear, [1; 3], &[255; 4][..])
    );
}

#[test]
fn arrays_of_textures_that_are_none() {
    let of = |keys: &str| {
        mistake(&format!(
            "[resources.a]\ntype = 'sampled_image'\nbinding = 0\n{keys}\n[[model]]\nfile = 'room.gltf'\n"
        ))
    };
    let some = of("file = { mesh = 'floor', textures = 'some' }");
    assert!(some.contains("`textures` must be `\"all\"`"), "{some}");
    let both = of("file = { mesh = 'floor', texture = 0, textures = 'all' }");
    assert!(both.contains("`texture` and `textures` exclude each other"), "{both}");
    let layers = of("dimension = '2d_array'\nfile = [{ mesh = 'floor', textures = 'all' }, 'tile.png']");
    assert!(
        layers.contains("`textures = \"all\"` fills the elements of an array of descriptors"),
        "{layers}"
    );
    let unknown = of("file = { mesh = 'flor', textures = 'all' }");
    assert!(unknown.contains("no mesh is named `flor`"), "{unknown}");
}

fn image_of(texture: &str) -> String {
    format!("[resources.a]\ntype = 'sampled_image'\nbinding = 0\nfile = {{ {texture} }}\n")
}

#[test]
fn a_texture_without_a_picture_is_an_error_where_it_is_used() {
    let error = mistake(&format!(
        "{}[[model]]\nfile = 'bare.gltf'\n",
        image_of("mesh = 'floor', texture = 'base_color'")
    ));
    assert!(error.contains("the texture has no picture: `textures[0]` has no `source`"), "{error}");
    scene(&format!("{}[[model]]\nfile = 'bare.gltf'\n", image_of("mesh = 'floor', texture = 'normal'")));
}

/// A scale of zero hides a node, and a model without visible nodes has no instances.
#[test]
fn a_model_of_hidden_nodes_has_no_instances() {
    let scene = scene("[[model]]\nfile = 'empty.gltf'\n");
    assert!(scene.tlas.is_empty());
    let [instances, content] = &scene.notes[..] else { panic!("{:?}", scene.notes) };
    assert!(instances.starts_with("empty.gltf: no visible node of its scene has a mesh"), "{instances}");
    assert_eq!(content, "empty.gltf: not read: 2 hidden nodes");
}

#[test]
fn animations_are_read_at_a_time_or_noted() {
    let rest = scene("[[model]]\nfile = 'lift.gltf'\n");
    assert_eq!(rest.notes, ["lift.gltf: not read: 1 animation"]);
    assert_eq!(rest.unread_contents[0].contents, ["1 animation"]);
    let at = |more: &str| format!("[[model]]\nfile = 'lift.gltf'\n{more}");
    let moved = scene(&at("time = 1\nanimation = 'rise'\n"));
    assert!(moved.notes.is_empty() && moved.unread_contents.is_empty());
    let ground = |scene: &ResolvedScene| scene.tlas[0].1.instances()[0].transform;
    assert_eq!(ground(&rest), [[2., 0., 0., 10.], [0., 2., 0., 0.], [0., 0., 2., 0.]]);
    assert_eq!(ground(&moved), [[2., 0., 0., 0.], [0., 2., 0., 0.], [0., 0., 2., 1.]]);
    for (more, wanted) in [
        ("animation = 'rise'\n", "`animation` requires a time"),
        ("time = nan\n", "`time` must be finite"),
        ("time = 1\nanimation = 'fall'\n", "the file has no animation `fall`"),
    ] {
        assert!(mistake(&at(more)).contains(wanted), "{}", mistake(&at(more)));
    }
    let obj = mistake("[[model]]\nfile = 'house.obj'\ntime = 1\n");
    assert!(obj.contains("OBJ files have no animations"), "{obj}");
}

#[test]
fn cameras_of_files_are_used() {
    let camera = "{ file = 'room.gltf', name = 'eye', translate = [0, 1, 0] }";
    let matrices =
        floats(&format!("{{ camera = {camera}, matrices = ['view_inverse', 'view', 'projection'] }}"));
    // The parent's shift, its own and the scene's; its scale does not count.
    assert_eq!(matrices[..16], [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 10., 1., 3., 1.]);
    assert_eq!(matrices[28..32], [-10., -1., -3., 1.]);
    // 1 / tan(1 / 2) = 1.830488, half of it along x.
    assert!(
        (matrices[32] - 0.915_244).abs() < 1e-6 && (matrices[37] + 1.830_488).abs() < 1e-6,
        "{matrices:?}"
    );
    assert_eq!(matrices[42..44], [-8.0 / 7.5, -1.0]);
    let unknown = mistake("push_constants = { view = { file = 'room.gltf', name = 'ear' } }\n");
    assert!(unknown.contains("the file has no camera `ear`"), "{unknown}");
    assert!(unknown.contains("cameras in the file: eye"), "{unknown}");
    let none = mistake("push_constants = { view = { file = 'house.obj' } }\n");
    assert!(none.contains("the file has no camera"), "{none}");
    // 4 radians are more than half a turn.
    let wide = mistake("push_constants = { view = { file = 'wide.gltf' } }\n");
    assert!(wide.contains("`cameras[0]` of the file: the vertical angle of view is not between"), "{wide}");
    assert!(wide.contains("`yfov` is in radians"), "{wide}");
}

#[test]
fn matrices_have_orders() {
    let camera = "{ eye = [1, 2, 3], look_at = [1, 2, 0] }";
    let shift = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., -1., -2., -3., 1.];
    let rows = [1., 0., 0., -1., 0., 1., 0., -2., 0., 0., 1., -3., 0., 0., 0., 1.];
    assert_eq!(floats(&format!("{{ view = {camera} }}")), shift);
    assert_eq!(floats(&format!("{{ view = {camera}, transposed = true }}")), rows);
    assert_eq!(floats(&format!("{{ view = {camera}, order = 'row_major' }}")), rows);
    assert_eq!(floats(&format!("{{ view = {camera}, order = 'row_major', transposed = true }}")), shift);
    assert_eq!(data(&format!("{{ camera = {camera} }}")).len(), 128);
    let both = mistake(&format!("push_constants = {{ view = {camera}, projection = {camera} }}\n"));
    assert!(both.contains("several matrices in one piece"), "{both}");
}
