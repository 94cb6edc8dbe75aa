//! Source files by the paths that other tools look for: from the root of the repository or from the
//! current folder, without `..`.

use std::path::{Component, Path, PathBuf};

use anyhit_sanitize::FindingRecord;

/// A folder from which source files are named.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceTree {
    root: PathBuf,
}

impl SourceTree {
    /// The repository: the folder that the runner of GitHub or GitLab says, else the nearest one
    /// from the current folder up that has a `.git`, else the current folder.
    pub fn of_repository() -> Self {
        let said = ["GITHUB_WORKSPACE", "CI_PROJECT_DIR"].into_iter().filter_map(std::env::var_os);
        let said = said.map(PathBuf::from).find(|folder| folder.is_dir());
        let here = Self::of_current_folder();
        let repository = || here.root.ancestors().find(|folder| folder.join(".git").exists());
        match said.or_else(|| repository().map(Path::to_path_buf)) {
            Some(folder) => Self::at(&folder),
            None => here,
        }
    }

    /// The current folder.
    pub fn of_current_folder() -> Self {
        Self::at(Path::new("."))
    }

    /// A folder.
    pub fn at(folder: &Path) -> Self {
        let absolute = || std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
        Self { root: folder.canonicalize().unwrap_or_else(|_| without_dots(&absolute())) }
    }

    /// The path of a source file, with `/`: from the root where the file is beneath it, else from
    /// the root of the file system. A compiler's name of a file may be relative to its own folder:
    /// where there is no such file from here, it is looked for beside the file that leads to it.
    pub fn path_of(&self, name: &str, beside: Option<&Path>) -> String {
        let written = Path::new(name);
        let folder = beside.and_then(Path::parent);
        let near = folder
            .into_iter()
            .flat_map(|folder| [folder.join(written), folder.join(written.file_name().unwrap_or_default())]);
        let found = std::iter::once(written.to_path_buf()).chain(near).find(|path| path.is_file());
        if found.is_none() && !written.components().any(|part| part == Component::ParentDir) {
            return name.to_owned();
        }
        let path = found.as_deref().unwrap_or(written);
        let absolute = path.canonicalize().or_else(|_| std::path::absolute(path));
        let Ok(absolute) = absolute.map(|path| without_dots(&path)) else { return name.to_owned() };
        let inside = absolute.strip_prefix(&self.root).unwrap_or(&absolute);
        let inside = inside.to_string_lossy();
        if cfg!(windows) { inside.replace('\\', "/") } else { inside.into_owned() }
    }
}

impl SourceTree {
    /// Findings, each with a path: of its file, else of its module, else of `scene`, the file that
    /// was run.
    pub fn place(&self, mut findings: Vec<FindingRecord>, scene: &Path) -> Vec<FindingRecord> {
        findings.iter_mut().for_each(|finding| self.place_one(finding, scene));
        findings
    }

    /// Adds the path of a finding, as [`SourceTree::place`] does.
    pub fn place_one(&self, finding: &mut FindingRecord, scene: &Path) {
        let named = finding.file.as_ref().or(finding.module.as_ref());
        finding.path = Some(match named {
            Some(file) => self.path_of(file, Some(scene)),
            None => self.path_of(&scene.to_string_lossy(), None),
        });
    }
}

/// A path in which no part is `.` or `..`, as far as its text tells.
fn without_dots(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            part => plain.push(part),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_has_no_dots_and_begins_at_the_root() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().canonicalize().expect("a folder");
        std::fs::create_dir_all(root.join("repository/cases/a")).expect("a folder");
        for file in ["repository/cases/a/scene.toml", "repository/cases/a/main.comp", "outside.comp"] {
            std::fs::write(root.join(file), "").expect("a file");
        }
        let tree = SourceTree::at(&root.join("repository"));
        let scene = root.join("repository/cases/a/scene.toml");
        let dotted = format!("{}/repository/cases/../cases/a/main.comp", root.display());
        assert_eq!(tree.path_of(&dotted, None), "cases/a/main.comp");
        assert_eq!(tree.path_of("main.comp", Some(&scene)), "cases/a/main.comp");
        assert_eq!(tree.path_of("/build/of/somebody/main.comp", Some(&scene)), "cases/a/main.comp");
        let outside = format!("{}/repository/../outside.comp", root.display());
        assert_eq!(tree.path_of(&outside, None), root.join("outside.comp").to_string_lossy());
        // A file that is not there keeps its name, without dots.
        let missing = format!("{}/repository/x/../y.comp", root.display());
        assert_eq!(tree.path_of(&missing, Some(&scene)), "y.comp");
        assert_eq!(tree.path_of("no/z.comp", Some(&scene)), "no/z.comp");
    }
}
