//! The hooks of `.pre-commit-hooks.yaml`: they run whenever a file has changed that a scene reads.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhit_base::error::Result;
use anyhit_base::input::InputLimit;
use anyhit_cases::case::scenes;
use anyhit_compile::{Language, LanguageName, SOURCE_EXTENSIONS};
use anyhit_scene::deferred_file::DeferredFile;
use anyhit_scene::mesh::model::MeshFormat;
use anyhit_scene::{DiskFiles, Files, LoadOptions, load};

use crate::support::files::root;

/// The extensions at which the hook `anyhit-test` runs.
fn extensions() -> BTreeSet<String> {
    let hooks = std::fs::read_to_string(root().join(".pre-commit-hooks.yaml")).expect("the hooks");
    let hook = hooks.split("\n- id: ").find(|hook| hook.contains("entry: anyhit test")).expect("the hook");
    let pattern = hook.lines().find_map(|line| line.trim().strip_prefix("files: ")).expect("its files");
    let inside = pattern.strip_prefix(r"'(?i)\.(").and_then(|rest| rest.strip_suffix(")$'"));
    inside.expect("extensions in any letters").split('|').map(str::to_owned).collect()
}

fn extension(path: &Path) -> String {
    path.extension().map(|one| one.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Files of the disk, with the extensions of those that were asked for.
#[derive(Default)]
struct ReadFiles {
    extensions: Mutex<BTreeSet<String>>,
}

impl ReadFiles {
    fn note(&self, path: &Path) {
        self.extensions.lock().expect("no thread panics").insert(extension(path));
    }
}

impl Files for ReadFiles {
    fn read_limited(&self, path: &Path, limit: InputLimit) -> Result<Vec<u8>> {
        self.note(path);
        DiskFiles.read_limited(path, limit)
    }

    fn deferred(&self, path: &Path) -> Result<DeferredFile> {
        self.note(path);
        DiskFiles.deferred(path)
    }
}

/// Modules, pictures, meshes, binary data and included scenes of all scenes of this repository.
#[test]
fn the_hook_knows_what_scenes_read() {
    let files = ReadFiles::default();
    let mut found = 0;
    for folder in ["shaders", "scenes", "examples", "tests"] {
        for scene in scenes(&root().join(folder)).expect("the folder") {
            // A scene that is wrong on purpose has read files before.
            let _ = load(&scene, &files, &LoadOptions::default());
            found += 1;
        }
    }
    assert!(found > 100, "{found}");
    let read = files.extensions.into_inner().expect("no thread panics");
    for known in ["toml", "spv", "glb", "obj", "wgsl"] {
        assert!(read.contains(known), "{known}: {read:?}");
    }
    let hook = extensions();
    let unknown: Vec<&String> = read.iter().filter(|one| !hook.contains(*one)).collect();
    assert!(unknown.is_empty(), "the hook does not run for {unknown:?}");
}

/// What a reader knows by an extension, whether a scene here has such a file or not.
#[test]
fn the_hook_knows_the_extensions_of_all_readers() {
    let hook = extensions();
    let words = SOURCE_EXTENSIONS.split([' ', ',', ';']).filter_map(|word| word.strip_prefix('.'));
    let sources = words.chain(LanguageName::NAMES.map(|(name, _)| name));
    let sources: Vec<&str> = sources.collect();
    assert!(sources.len() > 10, "{sources:?}");
    for source in sources {
        let path = PathBuf::from(format!("a.{source}"));
        assert!(Language::of(&path).is_some() || source == "glsl", "{source}");
        assert!(hook.contains(source), "{source}");
    }
    for mesh in ["obj", "gltf", "glb"] {
        assert!(MeshFormat::of(Path::new(&format!("a.{mesh}"))).is_some() && hook.contains(mesh), "{mesh}");
    }
    // Read beside a mesh; of a picture, the first bytes tell what it is.
    for other in ["mtl", "bin", "png", "jpg", "jpeg", "hdr", "exr"] {
        assert!(hook.contains(other), "{other}");
    }
}
