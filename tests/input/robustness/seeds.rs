//! Files that mutants are made of: those of the repository, and small meshes and pictures that are
//! written here.

use std::path::Path;

use super::subjects::root;
use crate::support::files;

/// What a mutant is made of: a name and its bytes.
pub type Seed = (String, Vec<u8>);

fn below(folder: &str, extension: &str) -> Vec<Seed> {
    let root = root();
    let all = files::with_extension(&root.join(folder), extension);
    let read = |path: &Path| {
        let name = path.strip_prefix(&root).expect("below the root").to_string_lossy().replace('\\', "/");
        (name, std::fs::read(path).expect("a readable file"))
    };
    all.iter().map(|path| read(path)).collect()
}

/// Every compiled module of the repository.
pub fn modules() -> Vec<Seed> {
    below("spirv-fixtures", "spv")
}

/// Every WGSL source.
pub fn wgsl() -> Vec<Seed> {
    below("shaders", "wgsl")
}

/// Every scene and test file that names compiled modules alone: others would start compilers. Their
/// first lines are their paths.
pub fn scenes() -> Vec<Seed> {
    let mut scenes = below("shaders", "toml");
    scenes.extend(below("scenes", "toml"));
    let sources =
        [".slang\"", ".rgen\"", ".rchit\"", ".rmiss\"", ".rahit\"", ".comp\"", ".wgsl\"", ".glsl\""];
    scenes.retain(|(_, bytes)| {
        let text = String::from_utf8_lossy(bytes);
        !sources.iter().any(|source| text.contains(source))
    });
    for (name, bytes) in &mut scenes {
        let text = format!("# {name}\n{}", String::from_utf8_lossy(bytes));
        *bytes = text.into_bytes();
    }
    scenes
}

/// The smaller recordings of the driver.
pub fn recordings() -> Vec<Seed> {
    let mut all = below("tests/driver-golden", "safetensors");
    all.retain(|(_, bytes)| bytes.len() < 1 << 16);
    all
}

/// Pictures of each kind that is read: 8 and 16 bits, with and without colours and alpha.
pub fn pictures() -> Vec<Seed> {
    let mut all = below("tests/commands/test-command", "png");
    all.extend(below("tests/commands/test-command", "hdr"));
    all.extend(below("shaders/demo", "png"));
    let encode = |picture: &image::DynamicImage, format| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, format).expect("a picture that can be written");
        bytes.into_inner()
    };
    let ramp = |x: u32, y: u32| image::Rgb([(x * 31) as u8, (y * 29) as u8, 7]);
    let colours = image::DynamicImage::ImageRgb8(image::RgbImage::from_fn(9, 7, ramp));
    for (name, picture) in [
        ("grey", image::DynamicImage::ImageLuma8(colours.to_luma8())),
        ("grey-16", image::DynamicImage::ImageLuma16(colours.to_luma16())),
        ("grey-alpha", image::DynamicImage::ImageLumaA8(colours.to_luma_alpha8())),
        ("colours-16", image::DynamicImage::ImageRgba16(colours.to_rgba16())),
    ] {
        all.push((format!("{name}.png"), encode(&picture, image::ImageFormat::Png)));
    }
    all.push(("colours.jpg".into(), encode(&colours, image::ImageFormat::Jpeg)));
    let grey = image::DynamicImage::ImageLuma8(colours.to_luma8());
    all.push(("grey.jpg".into(), encode(&grey, image::ImageFormat::Jpeg)));
    all
}

/// The buffer of a mesh: a square's four positions, six indices of 16 bits, and a position that is
/// moved, with the index of its vertex.
fn square() -> Vec<u8> {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    bytes.extend([2_u16, 0].iter().flat_map(|index| index.to_le_bytes()));
    bytes.extend([1.0_f32, 1.0, 0.5].iter().flat_map(|number| number.to_le_bytes()));
    bytes
}

fn square_json(buffer: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
"nodes":[{{"children":[1],"translation":[0,1,0]}},{{"mesh":0,"rotation":[0,0,0,1],"scale":[1,2,1]}}],
"meshes":[{{"name":"square","primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":4}}]}}],
"buffers":[{buffer}],
"bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48,"byteStride":12,"target":34962}},
{{"buffer":0,"byteOffset":48,"byteLength":12,"target":34963}},{{"buffer":0,"byteOffset":60,"byteLength":4}},
{{"buffer":0,"byteOffset":64,"byteLength":12}}],
"accessors":[{{"bufferView":0,"byteOffset":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0.5],
"sparse":{{"count":1,"indices":{{"bufferView":2,"byteOffset":0,"componentType":5123}},"values":{{"bufferView":3,"byteOffset":0}}}}}},
{{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR","normalized":false}}]}}"#
    )
}

/// The square with a skin, a morph target, instances, a texture and an animation, whose accessors
/// are zeros.
fn posed_json(buffer: &str) -> String {
    let more = r#""skins":[{"joints":[0],"inverseBindMatrices":4}],
"animations":[{"name":"a","channels":[{"sampler":0,"target":{"node":0,"path":"translation"}},
{"sampler":1,"target":{"node":1,"path":"weights"}}],
"samplers":[{"input":5,"output":6},{"input":5,"output":7,"interpolation":"CUBICSPLINE"}]}],
"materials":[{"normalTexture":{"index":0,"scale":0.5}}],"textures":[{"sampler":0,"source":0}],
"samplers":[{"minFilter":9728,"wrapS":10497}],"images":[{"bufferView":3,"mimeType":"image/png"}],
"extensionsRequired":["KHR_mesh_quantization","EXT_mesh_gpu_instancing"],"buffers""#;
    let zeros = r#"{"componentType":5123,"count":4,"type":"VEC4"},
{"componentType":5126,"count":4,"type":"VEC4"},{"componentType":5126,"count":1,"type":"MAT4"},
{"componentType":5126,"count":2,"type":"SCALAR"},{"componentType":5126,"count":2,"type":"VEC3"},
{"componentType":5126,"count":6,"type":"SCALAR"}]}"#;
    let text = square_json(buffer)
        .replace(r#""mesh":0,"#, r#""mesh":0,"skin":0,"weights":[0.5],"#)
        .replace(r#""nodes":[{"children":[1],"#, r#""nodes":[{"children":[1,2],"#)
        .replace(
            r#""scale":[1,2,1]}"#,
            r#""scale":[1,2,1]},
{"mesh":0,"scale":[1,0,1],"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":0}}}}"#,
        )
        .replace(
            r#""POSITION":0},"#,
            r#""POSITION":0,"JOINTS_0":2,"WEIGHTS_0":3},"targets":[{"POSITION":0}],"material":0,"#,
        )
        .replace(r#""buffers""#, more);
    let (begin, _) = text.rsplit_once("]}").unwrap_or_default();
    format!("{begin},{zeros}")
}

/// A square as glTF with its buffer inside, and as GLB; posed as glTF.
pub fn gltf() -> Vec<Seed> {
    let bytes = square();
    let inside = format!(
        r#"{{"byteLength":{},"uri":"data:application/octet-stream;base64,{}"}}"#,
        bytes.len(),
        base64(&bytes)
    );
    let mut json = square_json(&format!(r#"{{"byteLength":{}}}"#, bytes.len()));
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend(((28 + json.len() + bytes.len()) as u32).to_le_bytes());
    glb.extend((json.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(json.bytes());
    glb.extend((bytes.len() as u32).to_le_bytes());
    glb.extend(b"BIN\0");
    glb.extend(bytes);
    let posed = posed_json(&inside).into_bytes();
    vec![
        ("square.gltf".into(), square_json(&inside).into_bytes()),
        ("square.glb".into(), glb),
        ("posed.gltf".into(), posed),
    ]
}

/// Bytes as base64 (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let word =
            three.iter().fold(0_u32, |word, &byte| word << 8 | u32::from(byte)) << (8 * (3 - three.len()));
        for digit in 0..4 {
            let is_there = digit <= three.len();
            text.push(if is_there {
                char::from(DIGITS[(word >> (18 - 6 * digit)) as usize & 63])
            } else {
                '='
            });
        }
    }
    text
}

/// Triangles, quadrilaterals and groups as OBJ, with indices from both ends.
pub fn obj() -> Vec<Seed> {
    let square = "mtllib none.mtl\no square\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n\
                  g one\nusemtl red\ns off\nf 1/1/1 2/1/1 3/1/1\no two\nf -4//1 -2//1 -1//1\nf 1 2 3 4\n";
    vec![("square.obj".into(), square.into())]
}

/// Command lines, of an argument a line.
pub fn command_lines() -> Vec<Seed> {
    let lines = [
        "trace-one-ray\nscenes/swept-spheres.toml\n--pixel\n3,4\n--precision\nexact",
        "run\nshaders/pass/compute/prefix-sum/scene.toml\n--dump\nsums=hex\n--lanes\n64\n--fuel\n1000",
        "test\nshaders\n--filter\nsphere\n--shard\n1/3\n--junit\nout.xml\n--jobs\n2\n--bless",
        "render\nscenes/swept-spheres.toml\n-o\nout.png\n--size\n64x48",
        "smoke\nspirv-fixtures\n--at-least\n90\n--seed\n7",
        "compile\nmain.rgen\n-o\nmain.spv\n-g",
        "inspect\nmain.spv",
        "verify\nrecording.safetensors",
        "stress\n--seed\n1\n--cases\n100",
        "--help",
    ];
    lines.iter().map(|line| (line.replace('\n', " "), line.as_bytes().to_vec())).collect()
}

/// Results of shares as commands write them.
#[cfg(feature = "cli")]
pub fn share_results() -> Vec<Seed> {
    let folder = crate::support::program::scratch("robustness-shares");
    let module = "spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv";
    let commands = [
        &["test", "shaders/pass/testing/leaves", "--shadow", "--sanitize", "--coverage", "x.lcov"][..],
        &["test", "tests/commands/test-command/trap", "tests/commands/test-command/rays", "--no-explanation"],
        &["smoke", module, "spirv-fixtures/pass/sphere/closest-hit/main.rmiss.spv"],
        &["render", "scenes/swept-spheres.toml", "--size", "8x8", "--shard", "1/2"],
    ];
    let result = |(number, command): (usize, &&[&str])| {
        let path = folder.join(format!("{number}.json"));
        let file = path.to_str().expect("UTF-8");
        let command: Vec<String> = command
            .iter()
            .map(|word| match *word {
                "x.lcov" => folder.join("x.lcov").to_str().expect("UTF-8").to_owned(),
                word => word.to_owned(),
            })
            .collect();
        let command: Vec<&str> = command.iter().map(String::as_str).collect();
        let ran = crate::support::program::anyhit(&[&command[..], &["--result", file]].concat());
        let bytes = std::fs::read(&path).unwrap_or_else(|_| panic!("{command:?}: {}{}", ran.out, ran.err));
        (format!("share-{number}.json"), bytes)
    };
    commands.iter().enumerate().map(result).collect()
}
