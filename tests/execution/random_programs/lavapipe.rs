//! Running the modules on lavapipe, Mesa's Vulkan driver for the CPU, through a small program in
//! C++ (`vulkan_compute.cpp`) that whoever wants this judge has compiled.

use std::path::Path;
use std::process::Command;

/// Runs each module on the same inputs and gives what it leaves in its outputs.
pub fn run(command: &str, modules: &[Vec<u8>], inputs: &[u32], outputs: usize, groups: u32) -> Vec<Vec<u32>> {
    let folder = match std::env::var_os("ANYHIT_VULKAN_FOLDER") {
        Some(folder) => tempfile::tempdir_in(folder),
        None => tempfile::tempdir(),
    };
    let folder = folder.expect("a folder");
    let bytes = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    std::fs::write(folder.path().join("in"), bytes(inputs)).expect("the inputs");
    for (at, module) in modules.iter().enumerate() {
        std::fs::write(folder.path().join(format!("{at}.spv")), module).expect("a module");
    }
    let mut words = command.split_whitespace();
    let program = words.next().expect("a program");
    // Relative to the folder, which the surroundings may know by another path.
    let inside = std::env::var("ANYHIT_VULKAN_FOLDER_INSIDE").ok();
    let seen = match &inside {
        Some(inside) => Path::new(inside).join(folder.path().file_name().expect("a name")),
        None => folder.path().to_path_buf(),
    };
    let status = Command::new(program)
        .args(words)
        .arg(seen)
        .args([modules.len().to_string(), (outputs * 4).to_string(), groups.to_string()])
        .status()
        .unwrap_or_else(|error| panic!("{command}: {error}"));
    assert!(status.success(), "{command}: {status}");
    (0..modules.len())
        .map(|at| {
            let bytes = std::fs::read(folder.path().join(format!("{at}.out"))).expect("the outputs");
            bytemuck::pod_collect_to_vec(&bytes)
        })
        .collect()
}
