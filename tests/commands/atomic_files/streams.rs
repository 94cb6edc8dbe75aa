//! Standard output, pipes, devices, and signals.

use std::fs::{self, File};
use std::io::Write;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::{Workplace, anyhit, names, told};
#[cfg(feature = "wgsl")]
use crate::support::skipped::{is_ignored, skipped, test_name};

#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_output_is_an_error() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let sums = "spirv-fixtures/pass/compute/prefix-sum/main.comp.spv";
    let all: &[&[&str]] = &[
        &["--help"],
        &["--version"],
        &["help", "render"],
        &["test", "--help"],
        &["inspect", sums],
        &["inspect", "--json", sums],
        &["run", sums, "--dump", "1"],
        &["smoke", sums],
        &["test", "shaders/pass/testing/leaves"],
        &["test", "shaders/pass/testing/leaves", "--list"],
        &["test", "shaders/pass/testing/leaves", "--format", "json"],
        &["trace-one-ray", "shaders/pass/testing/leaves/scene.toml"],
        &["verify", "tests/driver-golden/aabb_any.safetensors"],
    ];
    for arguments in all {
        let full = File::options().write(true).open("/dev/full").expect("a device");
        let output = anyhit(root).args(*arguments).stdout(full).output().expect("the command starts");
        let (code, text) = told(&output);
        assert_eq!(code, Some(2), "{arguments:?}: {text}");
        assert!(text.contains("error: standard output: No space left on device"), "{arguments:?}: {text}");
    }
    // A mistake on the command line is told on standard error, and asks nothing of the other.
    let full = File::options().write(true).open("/dev/full").expect("a device");
    let (code, text) = told(&anyhit(root).arg("inspct").stdout(full).output().expect("the command starts"));
    assert!(code == Some(2) && text.contains("'inspect'"), "{text}");
}

#[cfg(feature = "wgsl")]
#[test]
fn devices_and_pipes_are_written_directly() {
    let place = Workplace::new();
    let compile = |output: &str| {
        let mut command = anyhit(place.folder.path());
        command.args(["compile", "many.wgsl", "-o", output]);
        command
    };
    assert!(compile("many.spv").output().expect("the command starts").status.success());
    let module = fs::read(place.path("many.spv")).expect("a file");
    // A pipe.
    let output = compile("/dev/stdout").output().expect("the command starts");
    assert!(output.status.success() && output.stdout == module, "{}", told(&output).1);
    // A file that stands behind standard output, and holds something already.
    let mut file = File::create(place.path("all")).expect("a writable folder");
    file.write_all(b"before").expect("a writable folder");
    let ran = compile("/dev/stdout").stdout(file.try_clone().expect("a file")).status();
    assert!(ran.expect("the command starts").success());
    file.write_all(b"behind").expect("a writable folder");
    assert!(fs::read(place.path("all")).expect("a file") == [b"before", &module[..], b"behind"].concat());
    // A FIFO, through a link.
    let made = Command::new("mkfifo").arg(place.path("fifo")).status().expect("a program of every system");
    assert!(made.success());
    std::os::unix::fs::symlink("fifo", place.path("link")).expect("a writable folder");
    let mut child = compile("link").spawn().expect("the command starts");
    assert!(fs::read(place.path("fifo")).expect("a pipe") == module);
    assert!(child.wait().expect("a child").success());
    let mut all = [&["all", "fifo", "link", "many.spv"], &super::GIVEN[..]].concat();
    all.sort_unstable();
    assert_eq!(names(place.folder.path()), all);
    if cfg!(target_os = "linux") {
        let (code, text) = told(&compile("/dev/full").output().expect("the command starts"));
        assert_eq!(code, Some(2), "{text}");
        assert!(text.contains("error: /dev/full: No space left on device"), "{text}");
    }
}

#[cfg(feature = "wgsl")]
#[test]
fn a_signal_that_ends_a_rendering_leaves_no_temporary_file() {
    // Written while it is rendered: 2048 * 4200 * 16 bytes are more than 64 MiB.
    let folder = tempfile::tempdir().expect("a folder");
    let shader = "enable wgpu_ray_tracing_pipeline;
        @group(0) @binding(0) var picture: texture_storage_2d<rgba32float, write>;
        @ray_generation
        fn main(@builtin(ray_invocation_id) id: vec3u) { textureStore(picture, id.xy, vec4f(0.5)); }";
    let scene = "version = 1\nlaunch = [2048, 4200]\n[shaders]\nmain = 'main.wgsl'\n\
        [pipeline]\nraygen = 'main'\n\
        [resources.picture]\ntype = 'storage_image'\nbinding = 0\nformat = 'rgba32f'\noutput = true\n";
    for (name, text) in [("main.wgsl", shader), ("scene.toml", scene), ("out.png", "the old one")] {
        fs::write(folder.path().join(name), text).expect("a writable folder");
    }
    let expected = ["main.wgsl", "out.png", "scene.toml"];
    let signal = |name: &str, process: u32| {
        let sent = Command::new("kill").arg(format!("-{name}")).arg(process.to_string()).status();
        assert!(sent.expect("a program of every system").success());
    };
    // Signals 15, 2 and 1; and one that the caller has it ignore, as Linux tells.
    for (name, number, ignored) in [("TERM", 15, ""), ("INT", 2, ""), ("HUP", 1, ""), ("TERM", 15, "INT")] {
        if !cfg!(target_os = "linux") && (name == "HUP" || !ignored.is_empty()) {
            continue;
        }
        if is_ignored(number) {
            skipped(test_name!(), format_args!("what runs the tests ignores SIG{name}"));
            continue;
        }
        let mut shell = Command::new("sh");
        let trap = if ignored.is_empty() { String::new() } else { format!("trap '' {ignored}; ") };
        shell.arg("-c").arg(format!("{trap}exec \"$0\" render scene.toml")).arg(env!("CARGO_BIN_EXE_anyhit"));
        shell.current_dir(folder.path()).env("ANYHIT_CACHE", "off").env("RAYON_NUM_THREADS", "1");
        shell.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        let mut child = shell.spawn().expect("a shell");
        let begin = Instant::now();
        while names(folder.path()).len() == expected.len() {
            assert!(child.try_wait().expect("a child").is_none(), "it ended before it wrote anything");
            assert!(begin.elapsed() < Duration::from_secs(60), "nothing was written in a minute");
        }
        if !ignored.is_empty() {
            signal(ignored, child.id());
            std::thread::sleep(Duration::from_millis(50));
            assert_eq!(names(folder.path()).len(), expected.len() + 1, "{ignored} is ignored");
            assert!(child.try_wait().expect("a child").is_none(), "{ignored} is ignored");
        }
        signal(name, child.id());
        let status = child.wait().expect("a child");
        assert_eq!(status.signal(), Some(number), "{name}: {status}");
        assert_eq!(names(folder.path()), expected, "{name}");
        assert_eq!(fs::read(folder.path().join("out.png")).expect("a file"), b"the old one");
    }
}
