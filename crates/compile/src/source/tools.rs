//! What compilers that read files by themselves are told of a source.

use std::path::{Path, PathBuf};

use super::Source;
use anyhit_base::error::{Error, Result};

impl Source {
    /// The folder that [`Source::name`] is relative to; empty for the current one.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folders of [`Source::include_folders`] for an external tool, which runs in the source's
    /// folder. For a text in memory, which is written to a temporary folder, they are absolute and
    /// include the current one.
    pub(crate) fn external_include_folders(&self) -> Result<Vec<PathBuf>> {
        if self.is_file {
            return Ok(self.include_folders.clone());
        }
        let current = std::env::current_dir().map_err(|error| Error::io(".", error))?;
        let own = current.join(Path::new(&self.name).parent().unwrap_or(Path::new("")));
        Ok(std::iter::once(own)
            .chain(self.include_folders.iter().map(|folder| current.join(folder)))
            .collect())
    }

    /// Whether the text is that of a file, which an external tool can open.
    pub(crate) fn is_file(&self) -> bool {
        self.is_file
    }
}
