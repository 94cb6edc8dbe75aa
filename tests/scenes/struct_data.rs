//! Data by member name: the expected bytes are written out from the offsets of the modules here.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhit::{ComputeTest, Error, Hit, Module, Ray, ShaderTest, StructData};
use anyhit_engine::pipeline::{BatchWidth, RunOptions};
use anyhit_scene::{Assembled, EmbeddedFiles, LoadOptions, assemble, load};
use pretty_assertions::assert_eq;

use crate::support::assembly::assemble as spirv;

/// A ray-generation shader as glslang and Slang declare things: a struct behind a pointer, one with
/// two layouts of one name, one of Slang's names, a matrix of either order, a block that ends in a
/// runtime array.
const SHADER: &str = r#"
    OpCapability Shader
    OpCapability RayTracingKHR
    OpCapability PhysicalStorageBufferAddresses
    OpExtension "SPV_KHR_ray_tracing"
    OpExtension "SPV_KHR_physical_storage_buffer"
    OpMemoryModel PhysicalStorageBuffer64 GLSL450
    OpEntryPoint RayGenerationKHR %main "main" %push %lights %record
    OpName %Sun "Sun"
    OpMemberName %Sun 0 "direction"
    OpMemberName %Sun 1 "power"
    OpName %SceneInfo "SceneInfo_natural"
    OpMemberName %SceneInfo 0 "useSky"
    OpMemberName %SceneInfo 1 "sun"
    OpMemberName %SceneInfo 2 "instances"
    OpMemberName %SceneInfo 3 "turned"
    OpMemberName %SceneInfo 4 "flat"
    OpMemberName %SceneInfo 5 "weights"
    OpName %Instance "Instance"
    OpMemberName %Instance 0 "mesh"
    OpMemberName %Instance 1 "scale"
    OpName %Push "Push"
    OpMemberName %Push 0 "sceneInfo"
    OpMemberName %Push 1 "frame"
    OpName %LightA "Light"
    OpMemberName %LightA 0 "colour"
    OpMemberName %LightA 1 "on"
    OpName %LightB "Light"
    OpMemberName %LightB 0 "colour"
    OpMemberName %LightB 1 "on"
    OpName %Lights "Lights"
    OpMemberName %Lights 0 "count"
    OpMemberName %Lights 1 "first"
    OpMemberName %Lights 2 "rest"
    OpName %Record "Record"
    OpMemberName %Record 0 "tint"
    OpName %Loose "Loose"
    OpName %ByColumns "_MatrixStorage_float2x3_ColMajornatural"
    OpMemberName %ByColumns 0 "data"
    OpName %ByRows "_MatrixStorage_float3x2_RowMajornatural"
    OpMemberName %ByRows 0 "data"
    OpName %Bones "Bones_natural_0"
    OpMemberName %Bones 0 "a"
    OpMemberName %Bones 1 "b"
    OpName %useSky "USE_SKY"
    OpName %samples "SAMPLES"
    OpDecorate %useSky SpecId 3
    OpDecorate %samples SpecId 5
    OpDecorate %Push Block
    OpDecorate %Lights Block
    OpDecorate %Record Block
    OpMemberDecorate %Sun 0 Offset 0
    OpMemberDecorate %Sun 1 Offset 12
    OpMemberDecorate %SceneInfo 0 Offset 0
    OpMemberDecorate %SceneInfo 1 Offset 4
    OpMemberDecorate %SceneInfo 2 Offset 24
    OpMemberDecorate %SceneInfo 3 Offset 32
    OpMemberDecorate %SceneInfo 3 RowMajor
    OpMemberDecorate %SceneInfo 3 MatrixStride 12
    OpMemberDecorate %SceneInfo 4 Offset 56
    OpMemberDecorate %SceneInfo 4 ColMajor
    OpMemberDecorate %SceneInfo 4 MatrixStride 16
    OpMemberDecorate %SceneInfo 5 Offset 96
    OpDecorate %weights ArrayStride 4
    OpMemberDecorate %Instance 0 Offset 0
    OpMemberDecorate %Instance 1 Offset 8
    OpDecorate %instances ArrayStride 24
    OpMemberDecorate %Push 0 Offset 0
    OpMemberDecorate %Push 1 Offset 8
    OpMemberDecorate %LightA 0 Offset 0
    OpMemberDecorate %LightA 1 Offset 12
    OpMemberDecorate %LightB 0 Offset 0
    OpMemberDecorate %LightB 1 Offset 16
    OpMemberDecorate %Lights 0 Offset 0
    OpMemberDecorate %Lights 1 Offset 16
    OpMemberDecorate %Lights 2 Offset 64
    OpDecorate %lightArray ArrayStride 32
    OpMemberDecorate %Record 0 Offset 0
    OpDecorate %vectors ArrayStride 8
    OpMemberDecorate %ByColumns 0 Offset 0
    OpMemberDecorate %ByRows 0 Offset 0
    OpMemberDecorate %Bones 0 Offset 0
    OpMemberDecorate %Bones 1 Offset 24
    OpDecorate %lights DescriptorSet 0
    OpDecorate %lights Binding 1
    %void = OpTypeVoid
    %fn = OpTypeFunction %void
    %bool = OpTypeBool
    %useSky = OpSpecConstantFalse %bool
    %uint = OpTypeInt 32 0
    %samples = OpSpecConstant %uint 4
    %float = OpTypeFloat 32
    %two = OpConstant %uint 2
    %v2 = OpTypeVector %float 2
    %v3 = OpTypeVector %float 3
    %m3x2 = OpTypeMatrix %v2 3
    %m2x3 = OpTypeMatrix %v3 2
    %weights = OpTypeArray %float %two
    %Sun = OpTypeStruct %v3 %float
    %Loose = OpTypeStruct %float
    %Instance = OpTypeStruct %uint %v3
    %instances = OpTypePointer PhysicalStorageBuffer %Instance
    %SceneInfo = OpTypeStruct %uint %Sun %instances %m3x2 %m2x3 %weights
    %scene = OpTypePointer PhysicalStorageBuffer %SceneInfo
    %Push = OpTypeStruct %scene %uint
    %LightA = OpTypeStruct %v3 %uint
    %LightB = OpTypeStruct %v3 %uint
    %lightArray = OpTypeRuntimeArray %LightB
    %Lights = OpTypeStruct %uint %LightA %lightArray
    %Record = OpTypeStruct %v3
    %three = OpConstant %uint 3
    %vectors = OpTypeArray %v2 %three
    %ByColumns = OpTypeStruct %vectors
    %ByRows = OpTypeStruct %vectors
    %Bones = OpTypeStruct %ByColumns %ByRows
    %pushPointer = OpTypePointer PushConstant %Push
    %push = OpVariable %pushPointer PushConstant
    %lightsPointer = OpTypePointer StorageBuffer %Lights
    %lights = OpVariable %lightsPointer StorageBuffer
    %recordPointer = OpTypePointer ShaderRecordBufferKHR %Record
    %record = OpVariable %recordPointer ShaderRecordBufferKHR
    %countPointer = OpTypePointer StorageBuffer %uint
    %zero = OpConstant %uint 0
    %main = OpFunction %void None %fn
    %begin = OpLabel
    %place = OpAccessChain %countPointer %lights %zero
    OpStore %place %samples
    OpReturn
    OpFunctionEnd
"#;

fn scene(text: &str) -> Result<Assembled, Error> {
    scene_of(SHADER, text)
}

fn scene_of(shader: &str, text: &str) -> Result<Assembled, Error> {
    let text = format!(
        "version = 1\n[shaders.rgen]\npath = 'rgen.spv'\n[pipeline]\nraygen = 'rgen'\n[resources.data]\n\
         type = 'storage_buffer'\nbinding = 1\n{text}\n"
    );
    let module = spirv(shader);
    let files = [("s.toml", text.as_bytes()), ("rgen.spv", &module)];
    load(Path::new("s.toml"), &EmbeddedFiles(&files), &LoadOptions::default()).and_then(|one| assemble(&one))
}

fn bytes(text: &str) -> Vec<u8> {
    let assembled = scene(text).unwrap_or_else(|error| panic!("{text}\n{}", error.render()));
    assembled.resources.buffer(0, 1).expect("a buffer").bytes()
}

/// Words, with floats as their bits.
fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn bits(value: f32) -> u32 {
    value.to_bits()
}

#[track_caller]
fn refused(text: &str, wanted: &[&str]) {
    let report = scene(text).expect_err(text).render();
    for words in wanted {
        assert!(report.contains(words), "no `{words}` for {text}:\n{report}");
    }
}

const SCENE_INFO: &str = "useSky = true, sun = { direction = [1, 2, 3], power = 4 }, instances = 0x1_0000_0002, \
                          turned = [[1, 2], [3, 4], [5, 6]], flat = [[1, 2, 3], [4, 5, 6]], weights = [7, 8]";

#[test]
fn members_lie_where_the_module_says() {
    let text = format!("data = {{ struct = 'SceneInfo', shader = 'rgen', value = {{ {SCENE_INFO} }} }}");
    let mut wanted = vec![1, bits(1.0), bits(2.0), bits(3.0), bits(4.0), 0, 2, 1];
    // Row-major: the first components of all columns, then the second ones.
    wanted.extend([1.0, 3.0, 5.0, 2.0, 4.0, 6.0].map(bits));
    // Column-major with a stride of 16 bytes, from 56 on.
    wanted.extend([1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0].map(bits));
    // From byte 84 to 96.
    wanted.extend([0, 0, 0, bits(7.0), bits(8.0)]);
    assert_eq!(bytes(&text), words(&wanted));
    // Through the pointer of the push constants, without a shader, by the name with its suffix.
    for name in ["Push.sceneInfo", "SceneInfo_natural"] {
        let text = format!("data = {{ struct = '{name}', value = {{ {SCENE_INFO} }} }}");
        assert_eq!(bytes(&text), words(&wanted), "{name}");
    }
}

#[test]
fn arrays_follow_the_strides_of_pointers_and_arrays() {
    let text = "data = { struct = 'SceneInfo.instances', value = [{ mesh = 5, scale = [1, 2, 3] }, \
                { mesh = 6 }], rest = 'zeros' }";
    let mut wanted = vec![5, 0, bits(1.0), bits(2.0), bits(3.0), 0, 6];
    wanted.resize(12, 0);
    assert_eq!(bytes(text), words(&wanted));
    // Alone, too, it is as long as its stride, so that pieces can follow.
    let text = "data = [{ struct = 'Instance', value = { mesh = 5 }, rest = 'zeros' }, { u32 = 9 }]";
    assert_eq!(bytes(text), words(&[5, 0, 0, 0, 0, 0, 9]));
    let text =
        "data = { struct = 'Sun', stride = 20, value = [{ power = 1 }, { power = 2 }], rest = 'zeros' }";
    let wanted = [0, 0, 0, bits(1.0), 0, 0, 0, 0, bits(2.0), 0];
    assert_eq!(bytes(text), words(&wanted));
}

#[test]
fn blocks_are_known_by_where_the_data_is_bound() {
    let text = "data = { rest = 'zeros', value = { count = 2, first = { on = 1 }, rest = [{ colour = [1, 2, 3] }, \
                { on = 3 }] } }";
    let mut wanted = vec![0; 32];
    (wanted[0], wanted[7]) = (2, 1);
    wanted[16..19].copy_from_slice(&[1.0, 2.0, 3.0].map(bits));
    wanted[28] = 3;
    assert_eq!(bytes(text), words(&wanted));
    // A runtime array that is not given is empty; the size of the buffer adds zeros.
    let text = "size = 96\ndata = { value = { count = 1, first = { colour = [0, 0, 0], on = 1 } } }";
    let mut wanted = vec![0; 24];
    (wanted[0], wanted[7]) = (1, 1);
    assert_eq!(bytes(text), words(&wanted));
    let text = "size = 64\n";
    let head = "push_constants = { value = { sceneInfo = 64, frame = 7 } }\n";
    let module = spirv(SHADER);
    let whole = format!(
        "version = 1\n{head}[shaders.rgen]\npath = 'rgen.spv'\n[pipeline]\nraygen = {{ shader = 'rgen', record = \
         {{ value = {{ tint = [1, 2, 3] }} }} }}\n[resources.data]\ntype = 'storage_buffer'\nbinding = 1\n{text}"
    );
    let files = [("s.toml", whole.as_bytes()), ("rgen.spv", &module)];
    let loaded = load(Path::new("s.toml"), &EmbeddedFiles(&files), &LoadOptions::default()).unwrap();
    let assembled = assemble(&loaded).unwrap();
    assert_eq!(assembled.resources.push_constants.as_ref().unwrap().bytes(), words(&[64, 0, 7]));
    let record = loaded.pipeline.sbt.raygen[0].data.bytes().unwrap();
    assert_eq!(record, words(&[1.0, 2.0, 3.0].map(bits)));
}

/// Slang stores `float2x3` as an array of three columns, or `float3x2` as one of three rows: the
/// value has the rows, which are the source's `m[0]`, `m[1]`.
#[test]
fn matrices_that_slang_stores_as_arrays_are_written_by_rows() {
    let text =
        "data = { struct = 'Bones', value = { a = [[1, 2, 3], [4, 5, 6]], b = [[1, 2], [3, 4], [5, 6]] } }";
    let wanted = [1.0, 4.0, 2.0, 5.0, 3.0, 6.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    assert_eq!(bytes(text), words(&wanted.map(bits)));
    // A piece in place of the value lies as it is, and the array can be named.
    let text = "data = { struct = 'Bones', value = { a = { f32 = [1, 2, 3, 4, 5, 6] }, b = { data = [[1, 2], [3, 4], \
                [5, 6]] } } }";
    assert_eq!(bytes(text), words(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(bits).repeat(2)));
    let report = scene("data = { struct = 'Bones', value = { a = [[1, 2], [3, 4]] } }").unwrap_err().render();
    assert!(report.contains("`a[0]` is"), "{report}");
    assert!(report.contains("expected 3 elements, found 2"), "{report}");
}

/// Shaders declare as much of the push constants as they use.
#[test]
fn a_block_that_begins_another_is_no_ambiguity() {
    let short = SHADER
        .replace("OpMemberName %Push 1 \"frame\"", "")
        .replace("OpMemberDecorate %Push 1 Offset 8", "")
        .replace("%Push = OpTypeStruct %scene %uint", "%Push = OpTypeStruct %scene");
    let renamed = SHADER.replace("OpMemberName %Push 1 \"frame\"", "OpMemberName %Push 1 \"sample\"");
    let push_constants = |other: &str| {
        let text = "version = 1\npush_constants = { value = { sceneInfo = 64, frame = 7 } }\n[shaders]\n\
                    a = 'other.spv'\nb = 'rgen.spv'\n[pipeline]\nraygen = ['a', 'b']\n";
        let modules = [spirv(other), spirv(SHADER)];
        let files = [("s.toml", text.as_bytes()), ("other.spv", &modules[0]), ("rgen.spv", &modules[1])];
        load(Path::new("s.toml"), &EmbeddedFiles(&files), &LoadOptions::default())
    };
    let scene = push_constants(&short).unwrap();
    assert_eq!(scene.push_constants.bytes().unwrap(), words(&[64, 0, 7]));
    let report = push_constants(&renamed).unwrap_err().render();
    assert!(report.contains("the block of push constants differs between the shaders"), "{report}");
}

#[test]
fn pieces_of_data_stand_for_members() {
    let flat = "flat = { f32 = [1, 2, 3, 4, 5, 6] }, turned = { f32 = [1, 2, 3, 4, 5, 6] }, weights = { f32 = [7, 8] }";
    let text = format!(
        "data = {{ struct = 'SceneInfo', rest = 'zeros', value = {{ {flat}, instances = {{ u64 = 0x10000000A }} }} }}"
    );
    let found = bytes(&text);
    assert_eq!(found[24..32], words(&[10, 1]));
    // A piece is the bytes that a program on a device copies there, whichever way the matrix lies.
    assert_eq!(found[32..56], words(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(bits)));
    assert_eq!(found[56..84], words(&[1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0].map(bits)));
    assert_eq!(found[96..], words(&[7.0, 8.0].map(bits)));
    refused(
        "data = { struct = 'Sun', value = { direction = { f32 = [1, 2] }, power = 1 } }",
        &["`direction` is vec3 of 12 bytes, but the piece has 8", "s.toml:9:"],
    );
}

#[test]
fn members_hold_addresses() {
    let text = "data = [{ u32 = 7 }, { align = 8 }, { struct = 'SceneInfo', rest = 'zeros', repeat = 2, value = { useSky = 1, \
                instances = { address_of = 'meshes', offset = 24 }, weights = [0, 8] } }]\n[resources.meshes]\n\
                type = 'buffer'\naddress = 0x1_0000_0100\ndata = { struct = 'Instance', value = [{ mesh = 5 }, \
                { mesh = 6 }], rest = 'zeros' }";
    let mut one = vec![0; 26];
    (one[0], one[6], one[7], one[25]) = (1, 0x118, 1, bits(8.0));
    let wanted = [vec![7, 0], one.clone(), one].concat();
    assert_eq!(bytes(text), words(&wanted));
    refused(
        "data = { struct = 'SceneInfo', rest = 'zeros', value = { instances = { address_of = 'mesh' } } }",
        &["no buffer or acceleration structure is named `mesh`", "s.toml:9:"],
    );
    refused(
        "data = { struct = 'Sun', rest = 'zeros', value = { power = { address_of = 'data' } } }",
        &["`power` is float of 4 bytes, but the piece has 8"],
    );
}

#[test]
fn a_name_with_several_layouts_is_no_guess() {
    refused(
        "data = { struct = 'Light', value = { on = 1 } }",
        &[
            "`Light` has 2 layouts in the module: select one of them",
            "`Lights.first`: 16 bytes",
            "`Lights.rest`: 20 bytes",
            "s.toml:9:",
        ],
    );
    let text = "data = { struct = 'Lights.rest', value = { on = 1 }, rest = 'zeros' }";
    assert_eq!(bytes(text), words(&[0, 0, 0, 0, 1, 0, 0, 0]));
    refused(
        "data = { struct = 'Loose', value = {} }",
        &["struct `Loose` has no layout", "its structs with a layout: Sun, Instance, SceneInfo_natural"],
    );
    refused("data = { struct = 'Sum', value = {} }", &["no struct of the module is named `Sum`", "`Sun`?"]);
    refused(
        "data = { struct = 'SceneInfo.useSky', value = {} }",
        &["the member `useSky` of struct SceneInfo_natural is neither a struct nor a pointer to one"],
    );
    let stripped: Vec<&str> = SHADER.lines().filter(|line| !line.contains("Name %")).collect();
    let error = scene_of(&stripped.join("\n"), "data = { struct = 'Sun', value = {} }").unwrap_err();
    assert!(error.render().contains("the module contains no struct names"), "{}", error.render());
    let without_members: Vec<&str> = SHADER.lines().filter(|line| !line.contains("OpMemberName")).collect();
    let error = scene_of(&without_members.join("\n"), "data = { struct = 'Sun', value = {} }").unwrap_err();
    assert!(error.render().contains("the members of struct Sun have no names"), "{}", error.render());
}

#[test]
fn mistakes_show_the_layout() {
    let sun = |value: &str| format!("data = {{ struct = 'Sun', value = {{ {value} }} }}");
    let layout = ["struct Sun: 16 bytes", "    0  vec3 direction", "   12  float power", "s.toml:9:"];
    for (value, message) in [
        ("direction = [1, 2, 3]", "missing value for `power`"),
        ("direction = [1, 2, 3]", "add them, or write `rest = \"zeros\"`"),
        ("direction = [1, 2, 3], powr = 1", "struct Sun has no member `powr`"),
        ("direction = [1, 2, 3], powr = 1", "did you mean `power`?"),
        ("direction = [1, 2], power = 1", "`direction` is vec3: expected 3 elements, found 2"),
        ("direction = 1, power = 1", "`direction` is vec3: expected an array, found an integer"),
        ("direction = [1, 2, 3], power = 'x'", "`power` is float: expected a number, found a string"),
        ("direction = [1, 2, 3], power = 1e39", "`1e39` is out of the range of float"),
    ] {
        refused(&sun(value), &[&layout[..], &[message]].concat());
    }
    for (value, message) in [
        ("useSky = -1", "uint ranges from 0 to 4294967295"),
        ("useSky = 0.5", "`useSky` is uint: expected an integer, found a float"),
        ("instances = 'x'", "expected `{ address_of = \"BUFFER\" }` or a number"),
        ("flat = 3", "`flat` is mat2x3: expected an array of its columns"),
        ("flat = [[1, 2, 3]]", "`flat` is mat2x3: expected 2 elements, found 1"),
        ("flat = [[1, 2], [1, 2, 3]]", "`flat[0]` is vec3: expected 3 elements, found 2"),
        ("weights = [1, 2, 3]", "expected 2 elements, found 3"),
        ("sun = 3", "`sun` is struct Sun: expected a table of its members"),
        (
            "sun = { power = true, direction = [0, 0, 0] }",
            "`sun.power` is float: expected a number, found a Boolean",
        ),
    ] {
        let text = format!("data = {{ struct = 'SceneInfo', value = {{ {value} }}, rest = 'zeros' }}");
        refused(&text, &[message, "s.toml:9:", "struct SceneInfo_natural: 104 bytes"]);
    }
    refused("data = { struct = 'SceneInfo', value = { weights = [1] } }", &["`weights[1]`", "`sun`"]);
    refused("data = { struct = 'Sun' }", &["a struct needs a `value`"]);
    refused(
        "data = { struct = 'Sun', shader = 'rgem', value = {} }",
        &["no shader is named `rgem`", "`rgen`?"],
    );
    refused("data = { struct = 'Sun', value = {}, rest = 'ones' }", &["`ones`", "one of: zeros"]);
    refused("data = { struct = 'Sun', value = [{}], rest = 'zeros' }", &["set `stride"]);
    refused(
        "data = { struct = 'Sun', value = [{}], rest = 'zeros', stride = 8 }",
        &["less than the 16 bytes of the struct"],
    );
    refused("data = [{ u32 = 1 }, { value = {} }]", &["`value` needs the name of a `struct`"]);
}

#[test]
fn specialization_constants_have_names() {
    let stored = |key: &str| {
        let text = format!(
            "version = 1\n[shaders.rgen]\npath = 'rgen.spv'\nspecialization = {{ {key} }}\n[pipeline]\nraygen = 'rgen'\n\
             [resources.data]\ntype = 'storage_buffer'\nbinding = 1\nsize = 64\n"
        );
        let module = spirv(SHADER);
        let files = [("s.toml", text.as_bytes()), ("rgen.spv", &module)];
        let loaded = load(Path::new("s.toml"), &EmbeddedFiles(&files), &LoadOptions::default())?;
        let assembled = assemble(&loaded)?;
        assembled.run(&assembled.resources, RunOptions::of(BatchWidth::One))?;
        Ok::<_, Error>(assembled.resources.buffer(0, 1).expect("a buffer").bytes()[0])
    };
    assert_eq!(stored("").unwrap(), 4);
    assert_eq!(stored("SAMPLES = 9, USE_SKY = true").unwrap(), 9);
    assert_eq!(stored("5 = 8").unwrap(), 8);
    let report = stored("SAMPLE = 9").unwrap_err().render();
    for wanted in [
        "the module has no specialization constant named `SAMPLE`",
        "did you mean `SAMPLES`?",
        "available: USE_SKY (3), SAMPLES (5)",
        "s.toml:4:20",
    ] {
        assert!(report.contains(wanted), "{report}");
    }
}

#[test]
fn what_is_left_over_of_a_buffer_is_noted() {
    // 64 bytes before the array, then elements of 32.
    for size in [64, 96, 128] {
        assert_eq!(scene(&format!("size = {size}")).unwrap().notes, Vec::<String>::new());
    }
    let note = "s.toml:6: the buffer `data` (set 0, binding 1) has 120 bytes: 64 bytes before the array, 1 element of 32 \
                and 24 left over, which no index into `lights` reaches";
    let found = scene("size = 120").unwrap().notes;
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].replace("`Lights`", "`lights`"), note);
}

#[test]
fn rust_writes_members_by_their_names() {
    let module = Module::from_spirv(&spirv(SHADER)).unwrap();
    let data = StructData::push_constants(&module).unwrap();
    let data = data.set("sceneInfo", 0x1_0000_0040_u64).unwrap().set("frame", 3).unwrap();
    assert_eq!(data.bytes(), words(&[0x40, 1, 3]));
    let data = StructData::buffer(&module, 0, 1).unwrap().set("rest[1].on", 3).unwrap();
    let data = data.set("rest[0].colour", [1.0, 2.0, 3.0]).unwrap();
    assert_eq!(data.bytes().len(), 64 + 2 * 32);
    assert_eq!(data.bytes()[64..76], words(&[1.0, 2.0, 3.0].map(bits)));
    assert_eq!(data.bytes()[112..116], words(&[3]));
    let turned = StructData::of(&module, "SceneInfo").unwrap();
    let turned = turned.set("turned", [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]).unwrap();
    assert_eq!(turned.bytes()[32..56], words(&[1.0, 3.0, 5.0, 2.0, 4.0, 6.0].map(bits)));
    assert_eq!(StructData::shader_record(&module).unwrap().bytes().len(), 12);

    let error = turned.clone().set("sun.powr", 1.0).unwrap_err().render();
    assert!(error.contains("no member `powr`"), "{error}");
    assert!(error.contains("   16  float sun.power"), "{error}");
    let error = turned.clone().set("sun.power", 1).unwrap_err().render();
    assert!(
        error.contains("`sun.power` of struct SceneInfo_natural: 1 is an integer, not a float"),
        "{error}"
    );
    let error = turned.set("weights[2]", 1.0).unwrap_err().render();
    assert!(error.contains("no element `weights[2]`"), "{error}");
    let error = StructData::of(&module, "Light").unwrap_err();
    assert!(error.message().contains("has 2 layouts"), "{error:?}");
    // An index beyond all memory is refused by a limit.
    let huge = StructData::buffer(&module, 0, 1).unwrap().set("rest[9999999999].on", 1).unwrap_err();
    assert!(huge.message().contains("`buffer-bytes`"), "{huge:?}");

    #[derive(Clone, Copy, Debug, bytemuck::NoUninit)]
    #[repr(C)]
    struct Sun {
        direction: [f32; 3],
        power: f32,
    }
    let sun = Sun { direction: [1.0, 2.0, 3.0], power: 4.0 };
    let data = StructData::of(&module, "Sun").unwrap().write(&sun).unwrap();
    assert_eq!(data.bytes(), words(&[1.0, 2.0, 3.0, 4.0].map(bits)));
    assert!(StructData::of(&module, "Push").unwrap().write(&[1.0_f32; 9]).is_err());
}

fn inspect(arguments: &[&str]) -> (Option<i32>, String, String) {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("struct-data.spv");
    std::fs::write(&path, spirv(SHADER)).expect("a writable folder");
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.arg("inspect").arg(path).args(arguments).stdin(Stdio::null());
    let output = command.output().expect("the command starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn inspect_prints_layouts() {
    let wanted = "\
struct SceneInfo_natural: 104 bytes
  offset    size  stride  type and name
       0       4          uint                                               useSky
       4      16          struct Sun                                         sun
       4      12          vec3                                               sun.direction
      16       4          float                                              sun.power
      24       8          pointer to PhysicalStorageBuffer struct Instance   instances
      32      24      12  row_major mat3x2                                   turned
      56      28      16  mat2x3                                             flat
      96       8       4  float[2]                                           weights
";
    let (code, out, err) = inspect(&["--layout", "SceneInfo"]);
    let squeeze = |text: &str| {
        text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>()
    };
    assert_eq!((code, squeeze(&out), err.as_str()), (Some(0), squeeze(wanted), ""));
    let (_, out, _) = inspect(&["--layout"]);
    assert!(out.contains("struct Instance: 20 bytes, stride 24\n"), "{out}");
    assert!(out.contains("struct Lights: 64 bytes\n"), "{out}");
    let (_, out, _) = inspect(&["--layout", "Instance", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!(json[0]["strides"][0], 24);
    assert_eq!(json[0]["members"][1]["offset"], 8);
    let (code, _, err) = inspect(&["--layout", "Light"]);
    assert_eq!(code, Some(2));
    assert!(err.contains("`Lights.rest`: 20 bytes"), "{err}");
}

#[test]
fn a_shader_by_itself_takes_data_by_the_names_of_members() {
    let folder = "spirv-fixtures/pass/resources/record-and-push-constants";
    let module = Module::open(format!("{folder}/main.rchit.spv")).unwrap();
    let constants = StructData::push_constants(&module).unwrap().set("values[1]", 0.5).unwrap();
    let record = StructData::shader_record(&module).unwrap();
    let record = record.set("colour", [0.25, 0.5, 8.0, 9.0]).unwrap().set("tag", 7).unwrap();
    let record = record.set("table[0]", 1.5).unwrap();
    let hit = Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let test = ShaderTest::new(&module, "main").unwrap().hit(hit);
    let outcome = test.push_constants_data(&constants).shader_record_data(&record).run().unwrap();
    // The record's colour.xy and tag; of geometry 0 table[0], plus values[1], which lies at 52.
    assert_eq!(outcome.payload.vec4(), [0.25, 0.5, 7.0, 2.0]);

    let module = Module::open("spirv-fixtures/pass/compute/print/main.comp.spv").unwrap();
    let constants = StructData::push_constants(&module).unwrap().set("scale", 3.0).unwrap();
    let test = ComputeTest::new(&module, "main").unwrap().buffer(0, 1, &[[0.0_f32; 2]; 2]);
    let outcome = test.push_constants_data(&constants).run().unwrap();
    // halves[at] = vec2(at, scale) / 2, for the two invocations of a workgroup.
    assert_eq!(outcome.read_buffer::<[f32; 2]>(0, 1).unwrap(), [[0.0, 1.5], [0.5, 1.5]]);
    assert_eq!(outcome.printed.len(), 1);
}

/// naga puts the struct of a uniform buffer into a block whose member has no name.
#[cfg(feature = "wgsl")]
#[test]
fn a_block_of_one_nameless_member_is_written_like_the_member() {
    let module = Module::from_source(
        "scale.wgsl",
        "struct Settings { offset: vec3f, scale: f32 }
         @group(0) @binding(0) var<uniform> settings: Settings;
         @group(0) @binding(1) var<storage, read_write> out: array<f32>;
         @compute @workgroup_size(1) fn main() { out[0] = settings.offset.x * settings.scale; }",
    );
    let data = StructData::buffer(&module.unwrap(), 0, 0).unwrap().set("scale", 8.0).unwrap();
    // A vec3f takes 12 bytes, and a float lies in the four behind them.
    assert_eq!(data.bytes(), [[0; 12].as_slice(), &8.0_f32.to_le_bytes()].concat());
    let error = data.set("scael", 1.0).unwrap_err();
    assert!(error.message().ends_with("no member `scael`"), "{error}");
}
