//! Every file of `tests/` is a module of the test executable: one that no `mod` names would be
//! neither compiled nor run, and nobody would notice.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::support::files;

/// Roots of executables.
const ROOTS: &[&str] = &["main.rs", "cases.rs"];

#[test]
fn every_file_is_named_by_its_parent() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let mut mistakes = Vec::new();
    for path in files::with_extension(&tests, "rs") {
        let folder = path.parent().expect("a folder");
        let is_root = folder == tests && ROOTS.iter().any(|root| path.ends_with(root));
        // The parent of `a/b.rs` is `a.rs` or `a/mod.rs`; that of `a/mod.rs` names `a`.
        let (folder, name) = match path.file_stem() {
            Some(name) if name == "mod" => (folder.parent().expect("a folder"), folder.file_name()),
            name => (folder, name),
        };
        let name = name.expect("a name").to_string_lossy();
        let parent = match folder.join("mod.rs") {
            _ if folder == tests => tests.join("main.rs"),
            subject if subject.is_file() => subject,
            _ => folder.with_extension("rs"),
        };
        if !is_root && !modules(&parent).contains(&*name) {
            mistakes.push(format!("{} is not named by a `mod` in {}", path.display(), parent.display()));
        }
    }
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
}

#[test]
fn every_example_is_a_module() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let named = modules(&root.join("tests/rust/examples.rs"));
    let mut examples = BTreeSet::new();
    for entry in fs::read_dir(root.join("examples")).expect("a readable folder") {
        let path = entry.expect("a readable entry").path();
        // `shader-crate` is a project of its own.
        if path.is_file() {
            examples.insert(path.file_stem().expect("a name").to_string_lossy().into_owned());
        }
    }
    assert_eq!(named, examples);
}

/// The names behind `mod` in a file, which has none where it does not exist.
fn modules(file: &Path) -> BTreeSet<String> {
    let text = fs::read_to_string(file).unwrap_or_default();
    let names = text
        .lines()
        .filter_map(|line| line.strip_prefix("pub ").unwrap_or(line).strip_prefix("mod ")?.strip_suffix(';'));
    names.map(str::to_owned).collect()
}
