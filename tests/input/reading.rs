//! What is read from where: pipes and standard input on the command line, regular files alone
//! inside of files, folders that a scene may not leave, limits, and how many mistakes are shown.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use pretty_assertions::assert_eq;

use crate::support::files::root;

const MODULE: &str = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";

/// What a command wrote, and its exit code. One that does not end is an error.
struct Ran {
    code: Option<i32>,
    out: String,
    err: String,
}

fn anyhit(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).current_dir(folder).stdin(Stdio::null());
    command
}

/// Runs a command to its end, which comes within half a minute: none of these waits for anything.
fn ended(mut command: Command, input: Vec<u8>) -> Ran {
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the command starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    let writer = std::thread::spawn(move || stdin.write_all(&input));
    let begin = Instant::now();
    while child.try_wait().expect("a child").is_none() {
        if begin.elapsed() > Duration::from_secs(30) {
            child.kill().expect("a child");
            panic!("{command:?} does not end");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let _ = writer.join();
    let Output { status, stdout, stderr } = child.wait_with_output().expect("a child");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    Ran { code: status.code(), out: text(stdout), err: text(stderr) }
}

fn run(folder: &Path, arguments: &[&str]) -> Ran {
    ended(anyhit(folder, arguments), Vec::new())
}

fn write(folder: &Path, name: &str, text: impl AsRef<[u8]>) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("a writable folder");
    std::fs::write(path, text).expect("a writable folder");
}

#[cfg(unix)]
fn fifo(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().expect("mkfifo").success());
}

#[test]
fn standard_input_is_a_file_like_others() {
    let bytes = std::fs::read(root().join(MODULE)).expect("a fixture");
    let named = run(root(), &["inspect", MODULE]);
    let piped = ended(anyhit(root(), &["inspect", "-"]), bytes.clone());
    assert_eq!((piped.code, piped.err.as_str()), (Some(0), ""));
    assert_eq!(piped.out.split_once('\n').unwrap().1, named.out.split_once('\n').unwrap().1);
    let smoke = ended(anyhit(root(), &["smoke", "-"]), bytes.clone());
    assert_eq!(smoke.out, run(root(), &["smoke", MODULE]).out);
    let ran = ended(anyhit(root(), &["run", "-", "--groups", "2"]), bytes.clone());
    assert_eq!((ran.code, &ran.out), (Some(0), &run(root(), &["run", MODULE, "--groups", "2"]).out));
    // A scene's paths start at the current folder.
    let scene = format!("version = 1\n[shaders.sum]\npath = '{MODULE}'\n[[dispatch]]\nshader = 'sum'\n");
    let text = format!("{scene}[resources.x]\ntype = 'storage_buffer'\nbinding = 99\nsize = 4\n");
    let ran = ended(anyhit(root(), &["run", "-"]), text.into());
    assert!(!ran.err.contains("No such file"), "{}", ran.err);
    let ran = ended(anyhit(root(), &["run", "-"]), b"version = 1\nlaunhc = 1\n".to_vec());
    assert!(
        ran.err.contains("standard input:2:1") && ran.err.contains("did you mean `launch`?"),
        "{}",
        ran.err
    );
    let recording = std::fs::read(root().join("tests/driver-golden/flags_sphere_none.safetensors")).unwrap();
    let ran = ended(anyhit(root(), &["verify", "-"]), recording);
    assert_eq!(ran.code, Some(0), "{}", ran.err);
}

#[cfg(unix)]
#[test]
fn a_pipe_on_the_command_line_is_read_to_its_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = std::fs::read(root().join(MODULE)).expect("a fixture");
    let pipe = folder.path().join("module");
    fifo(&pipe);
    let name = pipe.to_str().expect("UTF-8");
    for (arguments, wanted) in [
        (vec!["inspect", name], vec!["inspect", MODULE]),
        (vec!["run", name, "--groups", "2"], vec!["run", MODULE, "--groups", "2"]),
    ] {
        let (to, bytes) = (pipe.clone(), bytes.clone());
        let writer = std::thread::spawn(move || std::fs::write(to, bytes));
        let ran = run(root(), &arguments);
        writer.join().expect("a thread").expect("the pipe");
        assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
        let lines = |ran: &Ran| ran.out.lines().filter(|line| !line.contains(name)).count();
        assert!(lines(&ran) + 1 >= lines(&run(root(), &wanted)), "{}", ran.out);
    }
}

#[cfg(unix)]
#[test]
fn what_never_ends_is_read_up_to_a_limit() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join("zero.rmiss");
    std::os::unix::fs::symlink("/dev/zero", &source).expect("a link");
    let source = source.to_str().expect("UTF-8");
    for (arguments, limit) in [
        // The default of each is as well an end, which takes longer.
        (vec!["inspect", "/dev/zero", "--limit", "module-bytes=1MiB"], "`module-bytes` of 1048576"),
        (vec!["smoke", "/dev/zero", "--limit", "module-bytes=1MiB"], "`module-bytes` of 1048576"),
        (vec!["run", "/dev/zero", "--limit", "module-bytes=1MiB"], "`module-bytes` of 1048576"),
        (vec!["smoke", source, "--limit", "source-bytes=1MiB"], "`source-bytes` of 1048576"),
        (vec!["compile", source], "`source-bytes` of 67108864"),
        (vec!["verify", "/dev/zero", "--limit", "file-bytes=1MiB"], "`file-bytes` of 1048576"),
        (vec!["render", "/dev/zero"], "`scene-bytes` of 16777216"),
        (vec!["trace-one-ray", "/dev/zero"], "`scene-bytes` of 16777216"),
    ] {
        let ran = run(root(), &arguments);
        assert_eq!(ran.code, Some(5), "{arguments:?}");
        assert!(ran.err.contains(limit), "{arguments:?}: {}", ran.err);
        assert!(ran.err.contains("--limit"), "{}", ran.err);
    }
}

/// Scenes that name `NAME` in every way that a path can stand in one.
const NAMING: &[&str] = &[
    "include = 'NAME'\n",
    "[shaders.a]\npath = 'NAME'\n[pipeline]\nraygen = 'a'\n",
    "[shaders.a]\nsource = 'NAME'\n[pipeline]\nraygen = 'a'\n",
    "[resources.a]\ntype = 'storage_buffer'\nbinding = 0\ndata = { file = 'NAME' }\n",
    "[resources.a]\ntype = 'sampled_image'\nbinding = 0\nfile = 'NAME'\n",
    "[geometry.a]\ntype = 'obj'\nfile = 'NAME'\n",
    "[geometry.a]\ntype = 'gltf'\nfile = 'NAME'\n",
    "[geometry.a]\ntype = 'triangles'\nvertex_data = { file = 'NAME' }\n",
];

const GLTF: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"uri":"NAME","byteLength":36}],
    "bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,
    "type":"VEC3","min":[0,0,0],"max":[1,1,0]}]}"#;

#[cfg(unix)]
#[test]
fn a_path_inside_a_file_names_a_regular_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    fifo(&path.join("pipe"));
    std::fs::create_dir(path.join("folder")).expect("a folder");
    std::os::unix::fs::symlink("/dev/zero", path.join("link")).expect("a link");
    write(path, "m.gltf", GLTF.replace("NAME", "pipe"));
    for (name, what) in
        [("pipe", "a FIFO"), ("folder", "a folder"), ("link", "a device"), ("/dev/zero", "a device")]
    {
        for (at, naming) in NAMING.iter().enumerate() {
            write(path, "s.toml", format!("version = 1\n{}", naming.replace("NAME", name)));
            let ran = run(path, &["run", "s.toml"]);
            assert_eq!(ran.code, Some(2), "{name} {at}");
            assert!(ran.err.contains(&format!("{what}, not a regular file")), "{name} {at}: {}", ran.err);
            assert!(ran.err.contains("s.toml:"), "{name} {at}: {}", ran.err);
        }
    }
    // A file that a mesh names.
    write(path, "s.toml", "version = 1\n[geometry.a]\ntype = 'gltf'\nfile = 'm.gltf'\n");
    let ran = run(path, &["run", "s.toml"]);
    assert!(ran.err.contains("pipe: a FIFO, not a regular file"), "{}", ran.err);
    // A recording and a scene in a folder, which nobody typed.
    let recordings = path.join("recordings");
    std::fs::create_dir(&recordings).expect("a folder");
    fifo(&recordings.join("a.safetensors"));
    let ran = run(path, &["verify", "recordings"]);
    assert!(ran.err.contains("a FIFO, not a regular file"), "{}", ran.err);
    let cases = path.join("cases");
    std::fs::create_dir(&cases).expect("a folder");
    fifo(&cases.join("scene.toml"));
    let ran = run(path, &["test", "cases"]);
    assert_eq!(ran.code, Some(2), "{}", ran.out);
    assert!(ran.out.contains("a FIFO, not a regular file"), "{}", ran.out);
}

#[cfg(unix)]
#[test]
fn a_root_confines_what_a_scene_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "secret", [0; 36]);
    std::fs::create_dir(path.join("inside")).expect("a folder");
    std::os::unix::fs::symlink("../secret", path.join("inside/link")).expect("a link");
    write(path, "inside/own", [0; 36]);
    write(path, "inside/m.gltf", GLTF.replace("NAME", "../secret"));
    let absolute = path.join("secret").display().to_string();
    let scene = |naming: &str, name: &str| {
        write(path, "inside/s.toml", format!("version = 1\n{}", naming.replace("NAME", name)));
    };
    for (at, naming) in NAMING.iter().enumerate() {
        for name in ["../secret", "link", "../inside/../secret", &absolute] {
            scene(naming, name);
            let ran = run(path, &["run", "inside/s.toml", "--root", "inside"]);
            assert_eq!(ran.code, Some(2), "{at} {name}");
            assert!(ran.err.contains("outside the folder"), "{at} {name}: {}", ran.err);
            assert!(ran.err.contains("--root DIR"), "{at} {name}: {}", ran.err);
        }
        // Without a root, or inside of it, the file is read, whatever it is then said to be.
        for root in [&["--root", "inside"][..], &[]] {
            let name = if root.is_empty() { "../secret" } else { "../inside/own" };
            scene(naming, name);
            let ran = run(path, &[&["run", "inside/s.toml"], root].concat());
            assert!(!ran.err.contains("outside"), "{at} {name}: {}", ran.err);
        }
    }
    scene("[geometry.a]\ntype = 'gltf'\nfile = 'm.gltf'\n", "");
    for command in ["run", "render", "trace-one-ray"] {
        let ran = run(path, &[command, "inside/s.toml", "--root", "inside"]);
        assert!(ran.err.contains("outside the folder"), "{command}: {}", ran.err);
    }
}

#[cfg(unix)]
#[test]
fn tests_keep_to_their_repository() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    write(path, "secret", [0; 4]);
    let text = "version = 1\n[resources.a]\ntype = 'storage_buffer'\nbinding = 0\ndata = { file = 'NAME' }\n";
    write(path, "repository/tests/case/scene.toml", text.replace("NAME", "../../../secret"));
    let refused = |arguments: &[&str], at: &Path| {
        let ran = run(at, &[&["test"], arguments].concat());
        ran.out.contains("outside the folder")
    };
    let tests = path.join("repository/tests");
    // The folder that is searched, where there is no repository and the current folder is another.
    assert!(refused(&[tests.to_str().expect("UTF-8")], root()));
    // The current folder, in which the test lies.
    assert!(!refused(&["repository/tests"], path));
    // The repository, wherever the command runs.
    write(path, "repository/.git/HEAD", "");
    assert!(refused(&["repository/tests"], path));
    assert!(refused(&["."], &path.join("repository/tests/case")));
    assert!(!refused(&["repository/tests", "--root", "."], path));
    // A scene that is itself a link to elsewhere.
    write(path, "elsewhere.toml", "version = 1\n");
    std::os::unix::fs::symlink(path.join("elsewhere.toml"), tests.join("a.test.toml")).expect("a link");
    assert!(refused(&["repository/tests/a.test.toml"], path));
}

/// What a scene expects is read, and with `--bless` written, inside the root alone.
#[test]
fn expected_pictures_keep_to_the_root() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    let module = root().join(MODULE).display().to_string();
    let scene = |picture: &str| {
        format!(
            "version = 1\n[shaders.a]\npath = 'module.spv'\n[[dispatch]]\nshader = 'a'\n\
             [resources.image]\ntype = 'storage_image'\nbinding = 7\nsize = [2, 2]\nformat = 'rgba8'\n\
             [resources.input]\ntype = 'storage_buffer'\nbinding = 0\nsize = 4096\n\
             [resources.output]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4096\n\
             [resources.sums]\ntype = 'storage_buffer'\nbinding = 2\nsize = 4096\n\
             [[expect.image]]\nname = 'image'\nfile = '{picture}'\n"
        )
    };
    std::fs::create_dir(path.join("inside")).expect("a folder");
    std::fs::copy(&module, path.join("inside/module.spv")).expect("a fixture");
    for (picture, written) in [("../new.png", false), ("new.png", true)] {
        write(path, "inside/scene.toml", scene(picture));
        let ran = run(path, &["test", "inside", "--root", "inside", "--bless"]);
        assert_eq!(path.join("inside").join(picture).exists(), written, "{picture}: {}{}", ran.out, ran.err);
    }
    #[cfg(unix)]
    {
        std::fs::remove_file(path.join("inside/new.png")).expect("a picture");
        std::os::unix::fs::symlink("../secret", path.join("inside/new.png")).expect("a link");
        write(path, "secret", "text");
        run(path, &["test", "inside", "--root", "inside", "--bless"]);
        assert_eq!(std::fs::read(path.join("secret")).expect("a file"), b"text");
    }
}

#[test]
fn thousands_of_mistakes_are_counted_and_few_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let keys: String = (0..20_000).map(|at| format!("key{at} = 1\n")).collect();
    write(folder.path(), "s.toml", format!("version = 1\n{keys}"));
    let begin = Instant::now();
    let ran = run(folder.path(), &["run", "s.toml"]);
    // Some 4 s before, in release; this is half a second of a debug build.
    assert!(begin.elapsed() < Duration::from_secs(4), "{:?}", begin.elapsed());
    assert_eq!(ran.code, Some(2));
    assert_eq!(ran.err.matches("unknown key").count(), 50);
    assert!(ran.err.ends_with("error: 19950 more errors are not shown\n"), "{}", ran.err);
    let ran = run(folder.path(), &["run", "s.toml", "--limit", "errors-shown=2"]);
    assert_eq!(ran.err.matches("unknown key").count(), 2);
    assert!(ran.err.contains("19998 more errors"), "{}", ran.err);
}

#[test]
fn limits_are_set_by_name() {
    let ran = run(root(), &["inspect", MODULE, "--limit", "module-bytes=16"]);
    assert_eq!(ran.code, Some(5));
    assert!(
        ran.err.contains("more bytes of a module than the limit `module-bytes` of 16 allows"),
        "{}",
        ran.err
    );
    let ran = run(root(), &["inspect", MODULE, "--limit", "module_bites=16"]);
    assert_eq!(ran.code, Some(2));
    assert!(ran.err.contains("unknown limit `module_bites`"), "{}", ran.err);
}

/// Every limit stands in docs/reading.md with its default.
#[test]
fn limits_are_documented() {
    use anyhit_base::input::InputLimit;
    let text = std::fs::read_to_string(root().join("docs/reading.md")).expect("docs/reading.md");
    for limit in InputLimit::ALL {
        let value = limit.default_value();
        let shown = match value.is_power_of_two() && value > 1 << 16 {
            true => format!("2^{}", value.ilog2()),
            false => value.to_string(),
        };
        let row = format!("| `{}` | {shown} |", limit.name());
        assert!(text.contains(&row), "no row `{row}`");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_kilobyte_makes_no_gigabytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path();
    // A sparse accessor without a buffer view, of a hundred million vertices.
    let sparse = GLTF.replace("NAME", "a.bin").replace(
        r#""bufferView":0,"componentType":5126,"count":3,"#,
        r#""componentType":5126,"count":100000000,"sparse":{"count":1,"indices":{"bufferView":0,"componentType":5125},
        "values":{"bufferView":0}},"#,
    );
    assert!(sparse.contains("sparse"));
    write(path, "a.bin", [0; 36]);
    write(path, "m.gltf", sparse);
    // A picture of one texel with a colour profile of 2^30 zeros, deflated.
    write(path, "a.png", with_profile());
    write(path, "mesh.toml", "version = 1\n[geometry.a]\ntype = 'gltf'\nfile = 'm.gltf'\n");
    let image = "version = 1\n[resources.a]\ntype = 'sampled_image'\nbinding = 0\nfile = 'a.png'\n";
    write(path, "image.toml", image);
    // Many buffers of a gigabyte each.
    let buffer = |at| {
        format!(
            "[resources.b{at}]\ntype = 'storage_buffer'\nbinding = {at}\ndata = {{ zeros = 1073741824 }}\n"
        )
    };
    let buffers: String = (0..40).map(buffer).collect();
    write(path, "buffers.toml", format!("version = 1\n{buffers}"));
    let grass = |at| format!("[geometry.g{at}]\ntype = 'grass'\ncount = 20000000\n");
    let meadow: String = (0..40).map(grass).collect();
    write(path, "meadow.toml", format!("version = 1\n{meadow}"));
    // Level 0 of an image in numbers would be 2 GB.
    let levels = "version = 1\n[resources.a]\ntype = 'sampled_image'\nbinding = 0\nformat = 'r8'\n\
                  size = [8192, 8192]\nlevels = 2\ndata = { zeros = 67108864 }\n";
    write(path, "levels.toml", levels);
    let limited = |scene: &str, more: &str| {
        let line = format!("ulimit -v 1000000 && exec \"$0\" run {scene} {more}");
        let mut command = Command::new("sh");
        command.args(["-c", &line, env!("CARGO_BIN_EXE_anyhit")]).current_dir(path);
        command.env("RAYON_NUM_THREADS", "2");
        ended(command, Vec::new())
    };
    let ran = limited("mesh.toml", "");
    assert!(ran.err.contains("the limit `mesh-vertices`"), "{}", ran.err);
    let ran = limited("image.toml", "");
    assert!(!ran.err.contains("allocat") && !ran.err.contains("limit"), "{}", ran.err);
    // The picture is read; what the command then lacks is something to run.
    assert!(!ran.err.contains("a.png"), "{}", ran.err);
    let ran = limited("levels.toml", "");
    assert!(!ran.err.contains("allocat") && !ran.err.contains("levels.toml"), "{}", ran.err);
    for scene in ["buffers.toml", "meadow.toml"] {
        let ran = limited(scene, "--limit scene-memory=100MiB --limit errors-shown=1");
        assert!(ran.err.contains("the limit `scene-memory` of 104857600"), "{scene}: {}", ran.err);
    }
}

/// A PNG of one texel whose `iCCP` chunk inflates to 2^30 zeros.
#[cfg(target_os = "linux")]
fn with_profile() -> Vec<u8> {
    let mut encoded = Vec::new();
    let mut encoder = png::Encoder::new(&mut encoded, 1, 1);
    encoder.set_color(png::ColorType::Rgba);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_chunk(png::chunk::ChunkType(*b"iCCP"), &[b"p\0\0", &zeros()[..]].concat()).expect("a chunk");
    writer.write_image_data(&[1, 2, 3, 4]).expect("a texel");
    writer.finish().expect("an end");
    encoded
}

/// 2^30 zeros in the form of zlib (RFC 1950, 1951), without its checksum: one block with fixed
/// codes, in which a zero and then repetitions of 258 at a distance of 1 take 13 bits each.
#[cfg(target_os = "linux")]
fn zeros() -> Vec<u8> {
    struct Bits(Vec<u8>, u32);
    impl Bits {
        fn push(&mut self, bits: u32, count: u32) {
            for at in 0..count {
                if self.1.is_multiple_of(8) {
                    self.0.push(0);
                }
                *self.0.last_mut().expect("a byte") |= ((bits >> at & 1) as u8) << (self.1 % 8);
                self.1 += 1;
            }
        }
        /// Huffman codes begin with their most significant bit.
        fn code(&mut self, bits: u32, count: u32) {
            self.push(bits.reverse_bits() >> (32 - count), count);
        }
    }
    let mut bits = Bits(vec![0x78, 0x9c], 0);
    bits.push(1, 1);
    bits.push(1, 2);
    // Literal 0 is 00110000; length 258 (285) is 11000101; distance 1 is 00000; the end is 0000000.
    bits.code(0b0011_0000, 8);
    for _ in 0..(1 << 30) / 258 {
        bits.code(0b1100_0101, 8);
        bits.code(0, 5);
    }
    bits.code(0, 7);
    bits.0
}

#[test]
fn statistics_list_the_files_that_nothing_reads() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["a.png", "b.png", "c.png", "d.png"] {
        std::fs::write(folder.path().join(name), "no picture").expect("a file");
    }
    let module = root().join(MODULE);
    let scene = format!(
        "version = 1\n[shaders]\nsum = '{}'\n[[dispatch]]\nshader = 'sum'\n[resources.sums]\n\
         type = 'storage_buffer'\nbinding = 1\nsize = 1024\n[resources.maps]\ntype = 'sampled_image'\n\
         binding = 7\nelements = [{{ file = 'a.png' }}, {{ file = 'b.png' }}, {{ file = 'c.png' }}, \
         {{ file = 'd.png' }}]\n",
        module.to_str().expect("a path of UTF-8")
    );
    std::fs::write(folder.path().join("scene.toml"), scene).expect("a file");
    let ran = run(folder.path(), &["run", "scene.toml", "--stats"]);
    assert_eq!((ran.code, ran.err.as_str()), (Some(0), ""));
    let wanted =
        "not read: resource `maps` (a.png, b.png, c.png, 1 more): no shader declares its set and binding\n";
    assert!(ran.out.ends_with(wanted), "{}", ran.out);
    // What is to be printed is read, and so is everything on request.
    for arguments in [&["run", "scene.toml", "--dump", "sums"][..], &["run", "scene.toml", "--read-all"]] {
        let ran = run(folder.path(), arguments);
        assert_eq!(ran.code, Some(2), "{arguments:?}: {}", ran.err);
        assert!(ran.err.contains("unknown image format") && ran.err.contains("scene.toml:"), "{}", ran.err);
    }
}

#[test]
fn flags_of_a_ray_and_of_a_pixel_exclude_each_other() {
    let scene = "shaders/pass/sphere/closest-hit/scene.toml";
    for flag in [["--cull-mask", "1"], ["--t-min", "0.5"], ["--miss-index", "0"]] {
        let ran = run(root(), &["trace-one-ray", scene, "--pixel", "0,0", flag[0], flag[1]]);
        assert_eq!(ran.code, Some(2), "{}", ran.err);
        assert!(ran.err.contains("cannot be used with"), "{flag:?}: {}", ran.err);
    }
    let ran = run(root(), &["scene", "--init", MODULE, "--output", "-"]);
    assert_eq!(ran.code, Some(2));
    assert!(ran.err.contains("`--output -`: a scene is written to a file"), "{}", ran.err);
}
