//! What compilers that read files by themselves are told of a source.

use std::fs;
use std::path::{Component, Path, PathBuf};

use super::Source;
use anyhit_base::error::{Error, Result};

impl Source {
    /// The folder that [`Source::name`] is relative to; empty for the current one.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folders of [`Source::include_folders`] for an external tool, which runs in the source's
    /// folder. For a text that it reads from a temporary folder, they are absolute and include the
    /// source's own.
    pub(crate) fn external_include_folders(&self, is_temporary: bool) -> Result<Vec<PathBuf>> {
        if !is_temporary {
            return Ok(self.include_folders.clone());
        }
        let current = std::env::current_dir().map_err(|error| Error::io(".", error))?;
        let own = current.join(Path::new(&self.name).parent().unwrap_or(Path::new("")));
        Ok(std::iter::once(own)
            .chain(self.include_folders.iter().map(|folder| current.join(folder)))
            .collect())
    }

    /// Reads the source's file and returns true if the text is its content, so that an external
    /// tool can open it. The file may have changed since it was read, and a host may have replaced
    /// its text.
    pub(crate) fn has_unchanged_file(&self) -> bool {
        let path = self.folder.join(&self.name);
        let has_length = |data: fs::Metadata| data.is_file() && data.len() == self.text.len() as u64;
        self.is_file
            && fs::metadata(&path).is_ok_and(has_length)
            && fs::read(&path).is_ok_and(|bytes| bytes == self.text.as_bytes())
    }

    /// The path of the text below a temporary folder, whatever its name.
    pub(crate) fn temporary_path(&self) -> PathBuf {
        let parts = Path::new(&self.name).components();
        let path: PathBuf = parts.filter(|part| matches!(part, Component::Normal(_))).collect();
        if path.as_os_str().is_empty() { PathBuf::from("source") } else { path }
    }
}
