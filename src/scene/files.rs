//! Reads the files of a scene from the disk, or from the binary.

use std::io::Read;
use std::path::{Component, Path, PathBuf};

use crate::error::{Error, ErrorKind, Result};

/// The largest file that a scene may name, in bytes.
pub const MAX_FILE_SIZE: u64 = 1 << 31;

/// Reads files by path.
pub trait Files {
    /// The whole content of a file.
    ///
    /// # Errors
    /// `Io` where there is no such file or it cannot be read, `InvalidScene` where it is larger
    /// than [`MAX_FILE_SIZE`].
    fn read(&self, path: &Path) -> Result<Vec<u8>>;
}

/// Files of the disk; relative paths start at the current folder.
#[derive(Clone, Copy, Debug, Default)]
pub struct DiskFiles;

impl Files for DiskFiles {
    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        let file = std::fs::File::open(path).map_err(|source| Error::io(path, source))?;
        let mut bytes = Vec::new();
        // The file's reported size is not used, because devices and pipes report none.
        file.take(MAX_FILE_SIZE + 1).read_to_end(&mut bytes).map_err(|source| Error::io(path, source))?;
        if bytes.len() as u64 > MAX_FILE_SIZE {
            let message = format!("{}: larger than {MAX_FILE_SIZE} bytes", path.display());
            return Err(Error::new(ErrorKind::InvalidScene, message));
        }
        Ok(bytes)
    }
}

/// Files embedded in the program: paths with `/` and their content.
#[derive(Clone, Copy, Debug)]
pub struct EmbeddedFiles<'a>(pub &'a [(&'a str, &'a [u8])]);

impl Files for EmbeddedFiles<'_> {
    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        let wanted = normalise(path);
        match self.0.iter().find(|(name, _)| normalise(Path::new(name)) == wanted) {
            Some((_, bytes)) => Ok(bytes.to_vec()),
            None => Err(Error::new(ErrorKind::Io, format!("{}: no such embedded file", path.display()))),
        }
    }
}

/// Normalises `a/./b/../c` to `a/c`. That is correct for embedded files, which have no links.
fn normalise(path: &Path) -> PathBuf {
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
