//! Readers of other crates on files that were damaged at random, with fixed seeds: each file is
//! read or is an error of its own kind, nothing panics, and nothing allocates what the file cannot
//! back.
//!
//! `ANYHIT_DAMAGED=100000 cargo test --release --test main readers::` draws more.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use anyhit_base::error::{Error, ErrorKind};
use anyhit_base::input::{InputLimit, InputLimits};
use anyhit_cases::recording::Recording;
use anyhit_scene::image::Picture;
use anyhit_scene::mesh::model::{MeshFormat, Model};
use anyhit_scene::{EmbeddedFiles, LoadOptions, load};
use image::ImageFormat;

/// A small generator of its own (xorshift64*), so that the files stay the same.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 16
    }

    fn below(&mut self, end: usize) -> usize {
        self.bits() as usize % end.max(1)
    }
}

/// Numbers at which readers break, as text.
const NUMBERS: &[&str] = &[
    "0",
    "1",
    "-1",
    "3",
    "4",
    "5",
    "255",
    "65535",
    "2147483647",
    "4294967295",
    "4294967296",
    "1e9",
    "1e99",
    "0.5",
    "18446744073709551615",
    "100000000",
    "5120",
    "5121",
    "5123",
    "5125",
    "5126",
    "\"x\"",
    "null",
    "[]",
    "{}",
    "nan",
    "true",
];

/// Changes a few bytes, or a few numbers of a text.
fn damage(bytes: &mut Vec<u8>, random: &mut Random, is_text: bool) {
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            return;
        }
        let at = random.below(bytes.len());
        let end = (at + 1 + random.below(16)).min(bytes.len());
        match random.below(if is_text { 9 } else { 6 }) {
            0 => bytes[at] = random.bits() as u8,
            1 => bytes[at] ^= 1 << random.below(8),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let part = bytes[at..end].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, part);
            }
            4 => {
                let word = [0, 1, 0x7f, 0xff, u32::MAX >> 1, u32::MAX][random.below(6)].to_le_bytes();
                let end = (at + 4).min(bytes.len());
                bytes[at..end].copy_from_slice(&word[..end - at]);
            }
            5 => bytes.truncate(at.max(1)),
            _ => {
                // The next number of a text becomes another one.
                let digit = |byte: &u8| byte.is_ascii_digit() || b".-+e".contains(byte);
                let Some(from) = bytes[at..].iter().position(u8::is_ascii_digit).map(|n| at + n) else {
                    continue;
                };
                let to = bytes[from..].iter().position(|byte| !digit(byte)).map_or(bytes.len(), |n| from + n);
                let number = NUMBERS[random.below(NUMBERS.len())];
                bytes.splice(from..to, number.bytes());
            }
        }
    }
}

fn count() -> usize {
    std::env::var("ANYHIT_DAMAGED").ok().and_then(|count| count.parse().ok()).unwrap_or(3000)
}

/// Reads damaged files; each gives one of these kinds of errors, or none. Some must be read, and
/// some refused, or the damage is not of the kind that tells anything.
fn survives(
    what: &str,
    whole: &[u8],
    is_text: bool,
    kinds: &[ErrorKind],
    mend: &dyn Fn(&mut [u8]),
    read: &dyn Fn(&[u8]) -> anyhit::Result<()>,
) {
    read(whole).unwrap_or_else(|error| panic!("{what} is not whole: {error}"));
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let (mut fine, mut refused) = (0, 0);
    for at in 0..count() {
        let mut bytes = whole.to_vec();
        damage(&mut bytes, &mut random, is_text);
        // Every other file keeps its checksums, which else hide what lies behind them.
        if at % 2 == 0 {
            mend(&mut bytes);
        }
        match catch_unwind(AssertUnwindSafe(|| read(&bytes))) {
            Ok(Ok(())) => fine += 1,
            Ok(Err(error)) if kinds.contains(&error.kind()) => refused += 1,
            Ok(Err(error)) => panic!("{what} {at}: an error of another kind: {error:?}"),
            Err(_) => panic!("{what} {at}: a panic on {:?}", String::from_utf8_lossy(&bytes)),
        }
    }
    assert!(fine > 0 && refused > count() / 10, "{what}: {fine} read, {refused} refused");
}

const MESH: &[ErrorKind] = &[ErrorKind::InvalidMesh, ErrorKind::UnsupportedFile, ErrorKind::Io];

/// A quad with indices, and the same one from a sparse accessor without a buffer view.
fn gltf_text(uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1]}}],
        "nodes":[{{"mesh":0,"children":[2],"scale":[2,3,1]}},{{"mesh":1}},{{"mesh":0,"rotation":[0,0,0,1]}}],
        "meshes":[{{"name":"quad","primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":5}}]}},
        {{"primitives":[{{"attributes":{{"POSITION":2}},"mode":4}}]}}],
        "buffers":[{{{uri}"byteLength":56}}],
        "bufferViews":[{{"buffer":0,"byteLength":48,"byteStride":12}},{{"buffer":0,"byteOffset":48,"byteLength":8}}],
        "accessors":[
        {{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
        {{"bufferView":1,"componentType":5123,"count":4,"type":"SCALAR"}},
        {{"componentType":5126,"count":6,"type":"VEC3","min":[0,0,0],"max":[1,1,0],"sparse":{{"count":2,
        "indices":{{"bufferView":1,"componentType":5123}},"values":{{"bufferView":0,"byteOffset":12}}}}}}]}}"#
    )
}

fn gltf_buffer() -> Vec<u8> {
    let positions = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0_f32];
    let mut bytes: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0, 0, 1, 0, 2, 0, 3, 0]);
    bytes
}

fn glb() -> Vec<u8> {
    let mut json = gltf_text("").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let data = gltf_buffer();
    let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
    let body = [&length(&json)[..], b"JSON", &json, &length(&data), b"BIN\0", &data].concat();
    [b"glTF", &2_u32.to_le_bytes()[..], &(12 + body.len() as u32).to_le_bytes(), &body].concat()
}

/// Writes the true lengths into a GLB's header and chunk, where those still stand.
fn mend_glb(bytes: &mut [u8]) {
    if bytes.len() >= 20 && bytes.starts_with(b"glTF") {
        let length = (bytes.len() as u32).to_le_bytes();
        bytes[8..12].copy_from_slice(&length);
        if let Some(end) = bytes.windows(4).position(|word| word == b"BIN\0")
            && let Some(json) = end.checked_sub(24)
        {
            bytes[12..16].copy_from_slice(&(json as u32).to_le_bytes());
        }
    }
}

#[test]
fn damaged_gltf_files_are_read_or_refused() {
    let data = gltf_buffer();
    let files = [("a.bin", data.as_slice())];
    let read = |bytes: &[u8]| read_mesh(MeshFormat::Gltf, "m.gltf", bytes, &files);
    let text = gltf_text(r#""uri":"a.bin","#);
    survives("glTF", text.as_bytes(), true, MESH, &|_| (), &read);
    survives("GLB", &glb(), true, MESH, &mend_glb, &read);
}

#[test]
fn damaged_obj_files_are_read_or_refused() {
    let text = "mtllib a.mtl\no quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nvt 0 1\nvn 0 0 1\nusemtl a\n\
        f 1/1/1 2/1/1 3//1 -1\ng other\nv 5 5 5\nf -1 1 2\nl 1 2\np 1\nf 1 2 3 4 5\n";
    let read = |bytes: &[u8]| read_mesh(MeshFormat::Obj, "m.obj", bytes, &[]);
    survives("OBJ", text.as_bytes(), true, MESH, &|_| (), &read);
}

/// Opens a mesh file and decodes all that it carries.
fn read_mesh(format: MeshFormat, name: &str, bytes: &[u8], files: &[(&str, &[u8])]) -> Result<(), Error> {
    let model = Model::open(format, Path::new(name), bytes.to_vec(), &EmbeddedFiles(files))?;
    for (at, part) in model.parts.iter().enumerate() {
        model.triangles(at)?;
        part.attributes.iter().try_for_each(|name| model.attribute(at, name).map(drop))?;
    }
    Ok(())
}

/// Pictures as the crate writes them, of 24 x 16 texels.
fn picture(format: ImageFormat) -> Vec<u8> {
    let mut bytes = Vec::new();
    let texel = |x: u32, y: u32| [x as u8 * 9, y as u8 * 13, (x * y) as u8];
    let image = image::RgbImage::from_fn(24, 16, |x, y| image::Rgb(texel(x, y)));
    let image = image::DynamicImage::from(image);
    let image = match format {
        ImageFormat::Hdr => image.into_rgb32f().into(),
        _ => image,
    };
    image.write_to(&mut Cursor::new(&mut bytes), format).expect("a picture");
    bytes
}

/// Gives every chunk of a PNG the checksum of what it holds now (PNG, 5.5).
fn mend_png(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes(head.try_into().expect("four bytes")) as usize;
        let (from, Some(end)) = (at + 4, (at + 8).checked_add(length)) else { return };
        let Some(data) = bytes.get(from..end) else { return };
        let mut crc = u32::MAX;
        for byte in data {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
            }
        }
        let Some(sum) = bytes.get_mut(end..end + 4) else { return };
        sum.copy_from_slice(&(!crc).to_be_bytes());
        at = end + 4;
    }
}

#[test]
fn damaged_pictures_are_read_or_refused() {
    for (format, name) in
        [(ImageFormat::Png, "a.png"), (ImageFormat::Jpeg, "a.jpg"), (ImageFormat::Hdr, "a.hdr")]
    {
        let read = |bytes: &[u8]| Picture::decode(Path::new(name), bytes, None).map(drop);
        let kinds = [ErrorKind::InvalidImage, ErrorKind::UnsupportedTool];
        let mend = |bytes: &mut [u8]| {
            if format == ImageFormat::Png {
                mend_png(bytes)
            }
        };
        survives(name, &picture(format), format == ImageFormat::Hdr, &kinds, &mend, &read);
    }
}

#[test]
fn damaged_scenes_are_read_or_refused() {
    let text = "version = 1\nlaunch = [4, 4]\n\
        [geometry.grass]\ntype = 'grass'\ncount = 20\narea = [2, 2]\n\
        [geometry.hair]\ntype = 'hair'\ncount = 5\nsegments = 4\n\
        [geometry.hills]\ntype = 'heightfield'\ndivisions = [4, 4]\n\
        [geometry.tri]\ntype = 'triangles'\nvertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\nindices = [0, 1, 2]\n\
        [[instance]]\ngeometry = ['grass', 'hair']\nmask = 255\n\
        [[instance]]\ngeometry = 'tri'\ntranslate = [1, 2, 3]\n\
        [[instance]]\ngeometry = 'hills'\ntlas = 'other'\n\
        [resources.out]\ntype = 'storage_image'\nbinding = 0\nformat = 'rgba8'\nsize = [4, 4]\noutput = true\n\
        [resources.data]\ntype = 'storage_buffer'\nbinding = 1\nsize = 64\n\
        data = [{ f32 = [1, 2, 3], repeat = 2 }, { zeros = 8 }, { align = 16 }]\n\
        [[ray]]\npixel = [1, 2]\n[[ray]]\norigin = [0, 0, 1]\ndirection = [0, 0, -1]\n";
    // Smaller than by default, so that a scene of millions of blades takes no time.
    let limits = InputLimits::default()
        .with(InputLimit::ScenePrimitives, 20_000)
        .with(InputLimit::SceneMemory, 1 << 20);
    struct Small<'a>(EmbeddedFiles<'a>, InputLimits);
    impl anyhit_scene::Files for Small<'_> {
        fn read_limited(&self, path: &Path, limit: InputLimit) -> anyhit::Result<Vec<u8>> {
            self.0.read_limited(path, limit)
        }
        fn limits(&self) -> InputLimits {
            self.1
        }
    }
    let kinds = [
        ErrorKind::InvalidScene,
        ErrorKind::InvalidArgument,
        ErrorKind::UnsupportedFile,
        ErrorKind::UnsupportedModule,
        ErrorKind::Io,
    ];
    let read = |bytes: &[u8]| {
        let files = [("s.toml", bytes)];
        let files = Small(EmbeddedFiles(&files), limits);
        load(Path::new("s.toml"), &files, &LoadOptions::default()).map(drop)
    };
    survives("TOML", text.as_bytes(), true, &kinds, &|_| (), &read);
}

#[test]
fn damaged_recordings_are_read_or_refused() {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/driver-golden/flags_sphere_none.safetensors");
    let whole = std::fs::read(path).expect("a recording");
    let read = |bytes: &[u8]| Recording::of(bytes).map(drop);
    let kinds = [ErrorKind::InvalidRecording];
    survives("safetensors", &whole, true, &kinds, &|_| (), &read);
}

/// All of the above once more in a process that may have no more than 2.5 GB of address space: what
/// is allocated for nothing ends it.
#[cfg(target_os = "linux")]
#[test]
fn damaged_files_make_nothing_large() {
    let program = std::env::current_exe().expect("this program");
    let command =
        "ulimit -v 2500000 && exec \"$0\" readers::damaged --skip make_nothing_large --test-threads=1";
    let output = std::process::Command::new("sh")
        .args(["-c", command])
        .arg(program)
        .env("ANYHIT_DAMAGED", "1000")
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .expect("a shell");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    assert!(text(&output.stdout).contains("5 passed"), "{}", text(&output.stdout));
    // The panics that were caught say nothing.
    assert!(!text(&output.stderr).contains("panicked"), "{}", text(&output.stderr));
}
