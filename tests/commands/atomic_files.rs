//! Files that commands write are whole or as they were: after kills at random moments, on a full
//! disk, when several processes write one, and when a signal ends the program.
//!
//! `ANYHIT_KILLS=1000 cargo test --test main atomic_files::` kills each command so many times;
//! without, a few dozen times.

mod kills;
#[cfg(unix)]
mod limits;
#[cfg(unix)]
mod streams;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use pretty_assertions::assert_eq;

/// The files that every [`Workplace`] has.
const GIVEN: [&str; 5] = ["leaves", "many.wgsl", "picture.wgsl", "picture.toml", "rays.test.toml"];

/// A case of this project that is copied into the folder `leaves` of each, with its modules.
const LEAVES: &str = "pass/testing/leaves";

/// A shader that fills a picture with what does not compress.
const PICTURE: &str = "enable wgpu_ray_tracing_pipeline;
    @group(0) @binding(0) var picture: texture_storage_2d<rgba32float, write>;
    @ray_generation
    fn main(@builtin(ray_invocation_id) id: vec3u) {
        let at = vec2f(id.xy);
        let noise = fract(sin(at.x * 12.9898 + at.y * 78.233) * 43758.5453);
        textureStore(picture, id.xy, vec4f(noise, fract(noise * 57.0), fract(noise * 131.0), 1.0));
    }";

const SCENE: &str = "version = 1\nlaunch = [160, 120]\n[shaders]\nmain = 'picture.wgsl'\n\
    [pipeline]\nraygen = 'main'\n[resources.picture]\ntype = 'storage_image'\nbinding = 0\n\
    format = 'rgba32f'\noutput = true\n";

/// A folder of a test's own, with the commands that write files in it.
struct Workplace {
    folder: tempfile::TempDir,
}

/// A command that writes a file.
struct Writer {
    /// For messages.
    name: &'static str,
    arguments: Vec<String>,
    /// What it writes, in the folder.
    target: &'static str,
    /// What stands there before.
    old: Vec<u8>,
    /// Its exit code where it can write.
    code: i32,
}

impl Workplace {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let texts = [shader(), PICTURE.to_owned(), SCENE.to_owned(), rays(24, 4000)];
        for (name, text) in GIVEN[1..].iter().zip(texts) {
            fs::write(folder.path().join(name), text).expect("a writable folder");
        }
        // A scene may name nothing outside of the folder that is tested.
        let [scene, modules] = ["shaders", "spirv-fixtures"].map(|root| format!("{root}/{LEAVES}"));
        for from in [scene, modules] {
            let to = folder.path().join("leaves").join(&from);
            copy_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join(from), &to);
        }
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Every command whose file is long enough for a part of it to be seen.
    fn writers(&self) -> Vec<Writer> {
        let leaves = format!("leaves/shaders/{LEAVES}");
        let writer = |name, arguments: &[&str], target, old: &[u8], code| Writer {
            name,
            arguments: arguments.iter().map(|&argument| argument.to_owned()).collect(),
            target,
            old: old.to_vec(),
            code,
        };
        let old = "what stood here before\n".repeat(1000);
        let old = old.as_bytes();
        let rays = fs::read(self.path("rays.test.toml")).expect("a file");
        let mut writers = vec![
            writer("bless", &["test", "rays.test.toml", "--bless"], "rays.test.toml", &rays, 0),
            writer(
                "junit",
                &["test", "rays.test.toml", "--no-explanation", "--junit", "junit.xml"],
                "junit.xml",
                old,
                1,
            ),
            writer("coverage", &["test", &leaves, "--coverage", "out.lcov"], "out.lcov", old, 0),
        ];
        if cfg!(feature = "wgsl") {
            let arguments = ["compile", "many.wgsl", "-o", "many.spv"];
            writers.push(writer("compile", &arguments, "many.spv", old, 0));
            let arguments = ["render", "picture.toml", "-o", "out.png"];
            writers.push(writer("render", &arguments, "out.png", old, 0));
            let arguments = ["run", "picture.toml", "--save", "picture=out.png"];
            writers.push(writer("run", &arguments, "out.png", old, 0));
        }
        writers
    }

    fn command(&self, writer: &Writer) -> Command {
        let mut command = anyhit(self.folder.path());
        command.args(&writer.arguments);
        command
    }

    /// Puts the old file in its place.
    fn reset(&self, writer: &Writer) {
        fs::write(self.path(writer.target), &writer.old).expect("a writable folder");
    }

    /// Takes away what a command wrote, or puts it back as it was at first.
    fn clear(&self, writer: &Writer) {
        match GIVEN.contains(&writer.target) {
            true => self.reset(writer),
            false => fs::remove_file(self.path(writer.target)).expect("the file is there"),
        }
    }

    /// Names of all files but those that the tests put here, and one.
    fn others(&self, writer: &Writer) -> Vec<String> {
        let mut names = names(self.folder.path());
        names.retain(|name| *name != writer.target && !GIVEN.contains(&name.as_str()));
        names
    }
}

fn anyhit(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.current_dir(folder).env("ANYHIT_CACHE", "off").env("RAYON_NUM_THREADS", "2");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Copies the files of a folder into another, which is made.
fn copy_files(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a writable folder");
    for name in names(from) {
        fs::copy(from.join(&name), to.join(name)).expect("a file");
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Exit code and everything that was printed.
fn told(output: &Output) -> (Option<i32>, String) {
    let text = [&output.stdout[..], &output.stderr[..]].concat();
    (output.status.code(), String::from_utf8_lossy(&text).into_owned())
}

/// Rays down on one leaf at t = 4, of which a record says otherwise; and lines of comments, so that
/// the file takes a while to be written.
fn rays(count: usize, comments: usize) -> String {
    let mut text = format!("version = 1\ninclude = \"leaves/shaders/{LEAVES}/leaves.toml\"\n");
    for ray in 0..count {
        text += &format!(
            "\n[[ray]]\nname = \"ray-{ray}-\" # kept\norigin = [1, 0, 4]\ndirection = [0, 0, -1]\n\
             expect = {{ t = 3.5, payload = {{ seen = 9 }} }}\n"
        );
    }
    text + &"# A line that stays as it is, whatever is renewed above it, and that makes the file longer.\n"
        .repeat(comments)
}

/// The file of [`rays`] when it was blessed: the leaf lies in z = 0, the rays begin at z = 4, and
/// each sees one leaf.
fn blessed(rays: &str) -> String {
    rays.replace("t = 3.5", "t = 4.0").replace("seen = 9", "seen = 1")
}

/// A shader of many functions, whose module is some 100 KB long.
fn shader() -> String {
    let function = |number: usize| {
        format!(
            "fn wave{number}(x: f32) -> f32 {{ return sin(x * {number}.5) + cos(x + {number}.25) * x; }}\n"
        )
    };
    let calls: Vec<String> = (0..200).map(|number| format!("wave{number}(1.0)")).collect();
    let functions: String = (0..200).map(function).collect();
    format!(
        "@group(0) @binding(0) var<storage, read_write> out: f32;\n{functions}\
         @compute @workgroup_size(1) fn main() {{ out = {}; }}\n",
        calls.join(" + ")
    )
}

#[test]
fn two_blessings_at_once_lose_nothing() {
    let place = Workplace::new();
    let (before, path) = (rays(6, 10), place.path("rays.test.toml"));
    for round in 0..3 {
        fs::write(&path, &before).expect("a writable folder");
        let begin = |ray| {
            let filter = format!("ray-{ray}-");
            anyhit(place.folder.path())
                .args(["test", "rays.test.toml", "--bless", "--filter", &filter])
                .spawn()
                .expect("the command starts")
        };
        let children: Vec<_> = (0..6).map(begin).collect();
        for child in children {
            let (code, text) = told(&child.wait_with_output().expect("its output"));
            assert_eq!(code, Some(0), "{text}");
        }
        assert_eq!(fs::read_to_string(&path).expect("a file"), blessed(&before), "round {round}");
    }
    let mut given = GIVEN;
    given.sort_unstable();
    assert_eq!(names(place.folder.path()), given);
}
