//! Reads the files of a scene from the disk, or from the binary.

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use crate::deferred_file::{DeferredFile, SceneBudget};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, RootFolder, read_regular};

/// The path of a file that the file at `path` names.
pub(crate) fn sibling(path: &Path, name: impl AsRef<Path>) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(name)
}

/// Reads files by path.
pub trait Files: Sync {
    /// The whole content of a file that a scene names, or a file that it names.
    ///
    /// # Errors
    /// `Io` where there is no such file or it cannot be read, `InvalidScene` where it is no regular
    /// file, lies outside the root, or is larger than the limit `file-bytes`.
    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        self.read_limited(path, InputLimit::FileBytes)
    }

    /// The whole content of a file of a kind that has a limit of its own.
    ///
    /// # Errors
    /// As [`Files::read`].
    fn read_limited(&self, path: &Path, limit: InputLimit) -> Result<Vec<u8>>;

    /// The limits of what is read, and of what modules, lowering and smoke tests may ask for.
    fn limits(&self) -> InputLimits {
        InputLimits::default()
    }

    /// The folder that paths may not leave, where there is one.
    fn root(&self) -> Option<&RootFolder> {
        None
    }

    /// Returns true if a module that lacks a declaration is rejected.
    fn strict(&self) -> bool {
        false
    }

    /// Returns true if loading a scene reads every file that it names. Otherwise unread files must
    /// only exist, and pictures are decoded at the first read of a texel.
    fn read_all(&self) -> bool {
        false
    }

    /// A file that is read later, and of which is only known that it is there.
    ///
    /// # Errors
    /// As [`Files::read`], but for what only reading finds.
    fn deferred(&self, path: &Path) -> Result<DeferredFile> {
        self.read(path).map(|bytes| DeferredFile::held(bytes.into()))
    }

    /// Checks that a file is there, without opening it.
    ///
    /// # Errors
    /// As [`Files::read`], but for what only reading finds.
    fn exists(&self, path: &Path) -> Result<()> {
        self.deferred(path).map(|_| ())
    }

    /// What a scene of these files may hold.
    fn budget(&self) -> Arc<SceneBudget> {
        Arc::default()
    }

    /// Counts bytes that a scene is about to hold, as [`SceneBudget::reserve`] does.
    ///
    /// # Errors
    /// As there.
    fn reserve(&self, bytes: u64) -> Result<()> {
        self.budget().reserve(bytes)
    }

    /// Counts primitives that acceleration structures of a scene are about to hold, as
    /// [`SceneBudget::reserve_primitives`] does.
    ///
    /// # Errors
    /// As there.
    fn reserve_primitives(&self, count: u64) -> Result<()> {
        self.budget().reserve_primitives(count)
    }
}

/// Files of the disk, with the default limits; relative paths start at the current folder.
#[derive(Clone, Copy, Debug, Default)]
pub struct DiskFiles;

impl Files for DiskFiles {
    fn read_limited(&self, path: &Path, limit: InputLimit) -> Result<Vec<u8>> {
        read_regular(path, None, limit, &InputLimits::default())
    }

    fn deferred(&self, path: &Path) -> Result<DeferredFile> {
        DeferredFile::on_disk(path, None, InputLimits::default())
    }
}

/// Files of the disk, with limits, and of one folder alone where it has a root; relative paths
/// start at the current folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SceneFiles {
    /// The limits of what is read, and of what modules, lowering and smoke tests may ask for.
    pub limits: InputLimits,
    /// The folder that paths may not leave, links followed.
    pub root: Option<RootFolder>,
    /// Whether a module is rejected that uses a capability or an extension without declaring it
    /// (`--strict`); else that is a warning.
    pub strict: bool,
    /// Whether loading a scene reads every file that it names (`--read-all`), which also reports
    /// errors in files that nothing reads.
    pub read_all: bool,
}

impl SceneFiles {
    /// Files of the disk with the options of others.
    pub(crate) fn like(files: &dyn Files) -> Self {
        Self {
            limits: files.limits(),
            root: files.root().cloned(),
            strict: files.strict(),
            read_all: files.read_all(),
        }
    }

    /// Whether a file may be written where a path leads: a regular one or a new one, inside the
    /// root where there is one.
    pub fn may_replace(&self, path: &Path) -> bool {
        let inside = |path: &Path| self.root.as_ref().is_none_or(|root| root.resolve(path).is_ok());
        match path.symlink_metadata() {
            Ok(_) => std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file()) && inside(path),
            Err(_) => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
                inside(folder.unwrap_or(Path::new(".")))
            }
        }
    }
}

impl Files for SceneFiles {
    fn read_limited(&self, path: &Path, limit: InputLimit) -> Result<Vec<u8>> {
        read_regular(path, self.root.as_ref(), limit, &self.limits)
    }

    fn deferred(&self, path: &Path) -> Result<DeferredFile> {
        DeferredFile::on_disk(path, self.root.as_ref(), self.limits)
    }

    fn limits(&self) -> InputLimits {
        self.limits
    }

    fn root(&self) -> Option<&RootFolder> {
        self.root.as_ref()
    }

    fn strict(&self) -> bool {
        self.strict
    }

    fn read_all(&self) -> bool {
        self.read_all
    }
}

/// Files of one scene, whose bytes and primitives are counted.
pub(crate) struct Counted<'a> {
    files: &'a dyn Files,
    budget: Arc<SceneBudget>,
}

impl<'a> Counted<'a> {
    pub(crate) fn new(files: &'a dyn Files) -> Self {
        Self { files, budget: Arc::new(SceneBudget::new(files.limits())) }
    }
}

impl Files for Counted<'_> {
    fn read_limited(&self, path: &Path, limit: InputLimit) -> Result<Vec<u8>> {
        let bytes = self.files.read_limited(path, limit)?;
        self.reserve(bytes.len() as u64)?;
        Ok(bytes)
    }

    fn deferred(&self, path: &Path) -> Result<DeferredFile> {
        Ok(self.files.deferred(path)?.within(&self.budget))
    }

    fn limits(&self) -> InputLimits {
        self.files.limits()
    }

    fn strict(&self) -> bool {
        self.files.strict()
    }

    fn read_all(&self) -> bool {
        self.files.read_all()
    }

    fn root(&self) -> Option<&RootFolder> {
        self.files.root()
    }

    fn budget(&self) -> Arc<SceneBudget> {
        self.budget.clone()
    }
}

/// Files embedded in the program: paths with `/` and their content.
#[derive(Clone, Copy, Debug)]
pub struct EmbeddedFiles<'a>(pub &'a [(&'a str, &'a [u8])]);

impl Files for EmbeddedFiles<'_> {
    fn read_limited(&self, path: &Path, _: InputLimit) -> Result<Vec<u8>> {
        let wanted = normalise(path);
        match self.0.iter().find(|(name, _)| normalise(Path::new(name)) == wanted) {
            Some((_, bytes)) => Ok(bytes.to_vec()),
            None => Err(Error::new(ErrorKind::Io, format!("{}: no such embedded file", escape::path(&path)))),
        }
    }
}

/// Normalises `a/./b/../c` to `a/c`, without regard to symbolic links.
pub fn normalise(path: &Path) -> PathBuf {
    let mut parts: Vec<Component<'_>> = Vec::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(parts.last(), Some(Component::Normal(_))) => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.into_iter().collect()
}

/// Embedded files that are read within other limits than the defaults.
#[cfg(test)]
pub(crate) struct LimitedFiles<'a>(pub EmbeddedFiles<'a>, pub InputLimits);

#[cfg(test)]
impl Files for LimitedFiles<'_> {
    fn read_limited(&self, path: &Path, limit: InputLimit) -> Result<Vec<u8>> {
        self.0.read_limited(path, limit)
    }

    fn limits(&self) -> InputLimits {
        self.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn embedded_paths_are_normalised() {
        let files = EmbeddedFiles(&[("scenes/a.toml", b"A"), ("shaders/b.spv", b"B")]);
        assert_eq!(files.read(Path::new("scenes/../shaders/./b.spv")).unwrap(), b"B");
        let error = files.read(Path::new("scenes/b.spv")).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.message().contains("scenes/b.spv"));
    }

    #[test]
    fn a_missing_file_on_disk_names_itself() {
        let error = DiskFiles.read(Path::new("no/such/file.toml")).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Io);
        assert!(error.message().starts_with("no/such/file.toml"), "{error:?}");
    }
}
