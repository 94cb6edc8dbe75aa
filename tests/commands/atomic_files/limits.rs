//! Writes that fail after some bytes: a limit of the length of files (`ulimit -f`) stands for a
//! full disk, as nothing may be mounted in a test.

use std::fs;
use std::process::{Command, Stdio};

use super::{Workplace, anyhit, told};

/// Runs a command under a limit of so many blocks, of 512 or 1024 bytes as the shell likes.
/// Where the signal of the limit is not ignored, it ends a program that does not handle it.
fn limited(command: &Command, blocks: u32, ignores_signal: bool) -> Command {
    let trap = if ignores_signal { "trap '' XFSZ; " } else { "" };
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(format!("{trap}ulimit -f {blocks} && exec \"$@\"")).arg("sh");
    shell.arg(command.get_program()).args(command.get_args());
    for (name, value) in command.get_envs() {
        shell.env(name, value.expect("a value"));
    }
    shell.current_dir(command.get_current_dir().expect("a folder"));
    shell.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    shell
}

#[test]
fn a_full_disk_leaves_the_old_file_and_is_an_error() {
    let place = Workplace::new();
    for writer in &place.writers() {
        let mut failures = 0;
        for (blocks, ignores) in [(0, true), (0, false), (1, true), (2, false), (1 << 20, false)] {
            place.reset(writer);
            let output = limited(&place.command(writer), blocks, ignores).output().expect("a shell");
            let (code, text) = told(&output);
            let what = format!("{} with {blocks} blocks: {text}", writer.name);
            let found = fs::read(place.path(writer.target)).expect("the file is there");
            if blocks == 1 << 20 || (code == Some(writer.code) && blocks > 0) {
                assert_eq!(code, Some(writer.code), "{what}");
                assert!(found != writer.old, "{what}");
            } else {
                failures += 1;
                assert_eq!(code, Some(2), "{what}");
                assert!(found == writer.old, "{what}: {} bytes", found.len());
                assert!(text.contains(&format!("error: {}: File too large", writer.target)), "{what}");
                assert!(text.contains(&format!("{} is unchanged", writer.target)), "{what}");
            }
            assert_eq!(place.others(writer), [""; 0], "{what}");
        }
        assert!(failures >= 2, "{}", writer.name);
        place.clear(writer);
    }
}

#[test]
fn the_other_files_and_the_summary_come_all_the_same() {
    let place = Workplace::new();
    let arguments =
        ["test", "rays.test.toml", "--no-explanation", "--junit", "no/junit.xml", "--coverage", "out.lcov"];
    let output = anyhit(place.folder.path()).args(arguments).output().expect("the command starts");
    let (code, text) = told(&output);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("24 failed"), "{text}");
    assert!(text.contains("error: no/junit.xml: No such file or directory"), "{text}");
    assert!(place.path("out.lcov").is_file());
}

#[cfg(feature = "wgsl")]
#[test]
fn a_cache_that_cannot_be_written_is_no_error_and_keeps_nothing_broken() {
    let place = Workplace::new();
    let cache = place.path("cache");
    let mut command = anyhit(place.folder.path());
    command.args(["smoke", "many.wgsl"]).env("ANYHIT_CACHE", &cache);
    for _ in 0..2 {
        let (code, text) = told(&limited(&command, 1, false).output().expect("a shell"));
        assert_eq!(code, Some(0), "{text}");
        assert_eq!(super::names(&cache), [""; 0]);
    }
    let (code, text) = told(&command.output().expect("the command starts"));
    assert_eq!((code, super::names(&cache).len()), (Some(0), 1), "{text}");
    // A limit beyond all disks keeps what is there: 2^44 MiB are 2^64 bytes.
    fs::write(place.path("one.wgsl"), "@compute @workgroup_size(1) fn main() {}").expect("a folder");
    let mut other = anyhit(place.folder.path());
    other.args(["smoke", "one.wgsl"]).env("ANYHIT_CACHE", &cache);
    let output = other.env("ANYHIT_CACHE_LIMIT", "17592186044416").output().expect("the command starts");
    assert_eq!((output.status.code(), super::names(&cache).len()), (Some(0), 2));
}
