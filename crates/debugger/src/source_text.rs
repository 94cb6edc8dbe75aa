//! Finds the text of a source that a module names and does not hold.

use std::path::{Component, Path};

/// The text of a source by the name that a compiler gave it: from the current folder, the scene's
/// or one above it.
pub fn source_text(
    scene: &Path,
    name: &str,
    read: &mut dyn FnMut(&Path) -> Option<Vec<u8>>,
) -> Option<String> {
    // A module may name any file: only those below these folders are read.
    let is_below = |component: Component<'_>| matches!(component, Component::Normal(_) | Component::CurDir);
    if !Path::new(name).components().all(is_below) {
        return None;
    }
    let mut folders = std::iter::once(Path::new("")).chain(scene.ancestors().skip(1));
    folders.find_map(|folder| String::from_utf8(read(&folder.join(name))?).ok())
}
