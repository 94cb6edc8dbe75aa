//! Finding files for tests.

use std::path::{Path, PathBuf};

/// The folder of the repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The Rust sources of this project's crates: those of `src` and of `crates/*/src`, sorted.
pub fn sources() -> Vec<PathBuf> {
    let mut found = with_extension(&root().join("src"), "rs");
    for entry in std::fs::read_dir(root().join("crates")).expect("the folder of crates") {
        found.extend(with_extension(&entry.expect("a readable entry").path().join("src"), "rs"));
    }
    found.sort();
    assert!(found.len() > 700, "only {} sources", found.len());
    found
}

/// All files below a folder whose name ends in `.extension`, sorted.
pub fn with_extension(root: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a readable folder") {
            let path = entry.expect("a readable entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|found| found == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}
