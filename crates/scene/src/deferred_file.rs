//! Files of a scene that are opened when something needs them, and how much a scene may hold.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::input::{InputLimit, InputLimits, RootFolder, check_regular, read_head, read_regular};

/// Counts what a scene holds, also of files that are read after the scene.
#[derive(Debug, Default)]
pub struct SceneBudget {
    limits: InputLimits,
    bytes: AtomicU64,
    primitives: AtomicU64,
}

impl SceneBudget {
    pub(super) fn new(limits: InputLimits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// Counts bytes that a scene is about to hold, before they are allocated.
    ///
    /// # Errors
    /// `InvalidScene` where all together are more than the limit `scene-memory`.
    pub fn reserve(&self, bytes: u64) -> Result<()> {
        self.count(&self.bytes, bytes, InputLimit::SceneMemory)
    }

    /// Counts primitives that acceleration structures are about to hold.
    ///
    /// # Errors
    /// `InvalidScene` where all together are more than the limit `scene-primitives`.
    pub fn reserve_primitives(&self, count: u64) -> Result<()> {
        self.count(&self.primitives, count, InputLimit::ScenePrimitives)
    }

    fn count(&self, sum: &AtomicU64, more: u64, limit: InputLimit) -> Result<()> {
        let add = |known: u64| {
            let all = known.saturating_add(more);
            self.limits.check(limit, all, ErrorKind::InvalidScene).is_ok().then_some(all)
        };
        let Err(known) = sum.fetch_update(Relaxed, Relaxed, add) else { return Ok(()) };
        self.limits.check(limit, known.saturating_add(more), ErrorKind::InvalidScene)
    }
}

/// A file that a scene names, and that is not read yet.
#[derive(Clone, Debug)]
pub struct DeferredFile {
    place: FilePlace,
    budget: Arc<SceneBudget>,
}

#[derive(Clone, Debug)]
enum FilePlace {
    Disk { path: PathBuf, root: Option<RootFolder>, limits: Box<InputLimits> },
    Held(Arc<[u8]>),
}

/// How many bytes are read of a file for its header.
const HEAD: u64 = 16 << 10;

impl DeferredFile {
    /// A file of the disk, in a root where there is one. It is not opened.
    ///
    /// # Errors
    /// As [`Files::read`](crate::Files::read), but for what only reading finds.
    pub fn on_disk(path: &Path, root: Option<&RootFolder>, limits: InputLimits) -> Result<Self> {
        check_regular(path, root)?;
        let place =
            FilePlace::Disk { path: path.to_path_buf(), root: root.cloned(), limits: Box::new(limits) };
        Ok(Self { place, budget: Arc::default() })
    }

    /// A file whose bytes are in memory, such as a picture in a mesh file.
    pub fn held(bytes: Arc<[u8]>) -> Self {
        Self { place: FilePlace::Held(bytes), budget: Arc::default() }
    }

    /// The file, what is read of it counted as part of a scene.
    pub(super) fn within(self, budget: &Arc<SceneBudget>) -> Self {
        Self { budget: budget.clone(), ..self }
    }

    /// Counts bytes that are made of the file, as [`SceneBudget::reserve`] does.
    ///
    /// # Errors
    /// As there.
    pub fn reserve(&self, bytes: u64) -> Result<()> {
        self.budget.reserve(bytes)
    }

    /// The first bytes of the file, and how many it has.
    ///
    /// # Errors
    /// As [`Files::read`](crate::Files::read).
    pub fn head(&self) -> Result<(Cow<'_, [u8]>, u64)> {
        match &self.place {
            FilePlace::Disk { path, root, limits } => {
                let (head, size) = read_head(path, root.as_ref(), InputLimit::FileBytes, limits, HEAD)?;
                Ok((head.into(), size))
            }
            FilePlace::Held(bytes) => Ok(((&**bytes).into(), bytes.len() as u64)),
        }
    }

    /// All bytes of the file.
    ///
    /// # Errors
    /// As [`Files::read`](crate::Files::read), and [`SceneBudget::reserve`].
    pub fn bytes(&self) -> Result<Cow<'_, [u8]>> {
        match &self.place {
            FilePlace::Disk { path, root, limits } => {
                let bytes = read_regular(path, root.as_ref(), InputLimit::FileBytes, limits)?;
                self.budget.reserve(bytes.len() as u64)?;
                Ok(bytes.into())
            }
            FilePlace::Held(bytes) => Ok((&**bytes).into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_scene_holds_is_counted_until_the_limit() {
        let limits =
            InputLimits::default().with(InputLimit::SceneMemory, 10).with(InputLimit::ScenePrimitives, 3);
        let budget = SceneBudget::new(limits);
        assert!(budget.reserve(6).is_ok() && budget.reserve(4).is_ok());
        let error = budget.reserve(1).unwrap_err();
        assert_eq!(error.message(), "11 bytes of one scene exceed the limit `scene-memory` of 10");
        assert!(budget.reserve(u64::MAX).is_err());
        assert!(budget.reserve_primitives(3).is_ok());
        let error = budget.reserve_primitives(1).unwrap_err();
        assert!(error.message().contains("`scene-primitives` of 3"), "{error}");
    }

    #[test]
    fn a_file_is_read_when_it_is_needed_and_counted_then() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        let file = || DeferredFile::on_disk(&path, None, InputLimits::default());
        assert!(file().is_err());
        std::fs::write(&path, vec![7; 20_000]).unwrap();
        let limits = InputLimits::default().with(InputLimit::SceneMemory, 20_000);
        let file = file().unwrap().within(&Arc::new(SceneBudget::new(limits)));
        let (head, size) = file.head().unwrap();
        assert_eq!((head.len() as u64, size), (HEAD, 20_000));
        assert_eq!(file.bytes().unwrap().len(), 20_000);
        assert!(file.bytes().unwrap_err().message().contains("the limit `scene-memory`"));
        assert!(DeferredFile::on_disk(folder.path(), None, InputLimits::default()).is_err());
    }
}
