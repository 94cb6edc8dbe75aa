//! Running modules on a Vulkan driver, lavapipe as a rule, through a small program in C++
//! (`vulkan_modules.cpp`) that whoever wants this judge has compiled.

use std::path::Path;
use std::process::Command;

use super::evaluate::Memory;
use super::generate::{BUFFERS, Generated};

/// The command that `ANYHIT_VULKAN_MODULES` names.
fn command(line: &str) -> Command {
    let mut words = line.split_whitespace();
    let mut command = Command::new(words.next().expect("a program"));
    command.args(words);
    command
}

/// How many invocations the driver's subgroups have.
pub fn subgroup_size(line: &str) -> u32 {
    let output = command(line).output().unwrap_or_else(|error| panic!("{line}: {error}"));
    assert!(output.status.success(), "{line}: {}", output.status);
    String::from_utf8_lossy(&output.stdout).trim().parse().expect("the size of a subgroup")
}

/// What each module leaves in its buffers, or how the driver failed.
pub fn run(line: &str, modules: &[(&Generated, Vec<u32>, &Memory)]) -> Result<Vec<Memory>, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: String| folder.path().join(name);
    for (at, (generated, words, before)) in modules.iter().enumerate() {
        let write = |end: &str, bytes: &[u8]| {
            std::fs::write(path(format!("{at}.{end}")), bytes).expect("a writable folder");
        };
        write("spv", &words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>());
        write("groups", generated.groups.to_string().as_bytes());
        for (binding, bytes) in before.buffers.iter().enumerate() {
            // No buffer is empty.
            write(&binding.to_string(), if bytes.is_empty() { &[0; 4] } else { bytes });
        }
    }
    let status = command(line).arg(folder.path() as &Path).arg(modules.len().to_string()).status();
    let status = status.unwrap_or_else(|error| panic!("{line}: {error}"));
    if !status.success() {
        return Err(format!("{line}: {status}"));
    }
    let left = |at: usize, before: &Memory| {
        let mut buffers: Vec<Vec<u8>> = (0..BUFFERS)
            .map(|binding| std::fs::read(path(format!("{at}.{binding}.out"))).expect("a buffer"))
            .collect();
        // There stands the address that the driver gave.
        buffers[0][..8].copy_from_slice(&before.buffers[0][..8]);
        buffers.iter_mut().zip(&before.buffers).for_each(|(left, before)| left.truncate(before.len()));
        Memory { buffers, address: before.address }
    };
    Ok(modules.iter().enumerate().map(|(at, (_, _, before))| left(at, before)).collect())
}
