//! Temporary files beside those that they are to replace, and what becomes of them.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};

use tempfile::{PathPersistError, TempPath};

use super::{folder_of, retried};

/// Ends the name of every temporary file; before it stand `.`, the file's name, `.` and letters
/// drawn by chance.
const SUFFIX: &str = ".anyhit-tmp";

/// How many letters are drawn.
const DRAWN: usize = 8;

/// The longest part of the file's name that is repeated, in characters: a name has 255 bytes.
const REPEATED: usize = 40;

/// How long after its last change a temporary file that no process holds is left.
const LEFT: Duration = Duration::from_secs(60 * 60);

/// How long it is left where the file system cannot say whether a process holds it.
const LEFT_UNKNOWN: Duration = Duration::from_secs(24 * 60 * 60);

/// Every file and folder that is to be removed should the process end now.
static LIVE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// The folders that were swept by this process.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

static BEFORE_FIRST: OnceLock<fn()> = OnceLock::new();

/// Names what is called once, before the first temporary file is made: a program's handling of
/// signals, which need not be there before. Only the first call has an effect.
#[cfg(unix)]
pub fn before_first(call: fn()) {
    let _ = BEFORE_FIRST.set(call);
}

/// Removes every temporary file and folder, and has threads that would make one wait for ever: for
/// a process that is about to end.
#[cfg(unix)]
pub fn abandon_all() {
    let mut live = live();
    for path in std::mem::take(&mut *live) {
        let _ = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
    }
    std::mem::forget(live);
}

fn live() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    static FIRST: std::sync::Once = std::sync::Once::new();
    FIRST.call_once(|| {
        if let Some(call) = BEFORE_FIRST.get() {
            call();
        }
    });
    LIVE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A temporary file, removed when it is dropped.
#[derive(Debug)]
pub(super) struct Temporary {
    path: TempPath,
    guard: RemovalGuard,
}

impl Temporary {
    /// Makes an empty one in the folder of a file, with the permissions of any new file.
    pub(super) fn beside(target: &Path) -> io::Result<(File, Self)> {
        let folder = folder_of(target);
        sweep_once(folder);
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let name: String = name.chars().take(REPEATED).collect();
        // As the system says it: the library would add the temporary name.
        let mut refused = None;
        let mut guard = None;
        let made = tempfile::Builder::new()
            .prefix(&format!(".{name}."))
            .rand_bytes(DRAWN)
            .suffix(SUFFIX)
            .make_in(folder, |path| {
                // Known before it is there, so that no signal comes between.
                guard = Some(RemovalGuard::new(path));
                File::create_new(path).map_err(|error| {
                    guard = None;
                    let kind = error.kind();
                    refused = Some(error);
                    kind.into()
                })
            });
        let (file, path) = made.map_err(|error| refused.unwrap_or(error))?.into_parts();
        let guard = guard.expect("bug in anyhit: a temporary file was made without its guard");
        // Shows other processes that it is in use; a file system without locks goes by age.
        let _ = file.try_lock();
        Ok((file, Self { path, guard }))
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Renames it over a file.
    ///
    /// # Errors
    /// The error of the system, and the temporary file.
    pub(super) fn persist(self, target: &Path) -> Result<(), (io::Error, Self)> {
        const LOST: &str = "bug in anyhit: a failed rename keeps the temporary file";
        let Self { path, guard } = self;
        let mut left = Some(path);
        let renamed = retried(|| {
            left.take().expect(LOST).persist(target).map_err(|PathPersistError { error, path }| {
                left = Some(path);
                error
            })
        });
        renamed.map_err(|error| (error, Self { path: left.expect(LOST), guard }))
    }
}

/// Registers a temporary file or folder for removal by [`abandon_all`]; its owner still removes it
/// otherwise.
#[derive(Debug)]
pub struct RemovalGuard(PathBuf);

impl RemovalGuard {
    /// Registers the path.
    pub fn new(path: &Path) -> Self {
        live().insert(path.to_path_buf());
        Self(path.to_path_buf())
    }
}

impl Drop for RemovalGuard {
    fn drop(&mut self) {
        live().remove(&self.0);
    }
}

/// Removes what killed processes left in a folder, once in this process.
fn sweep_once(folder: &Path) {
    let is_new = SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.to_path_buf());
    if is_new {
        sweep(folder, SystemTime::now());
    }
}

/// Removes temporary files of ours, by their names, that were not changed for long and that no
/// process holds. Other files stay, and what cannot be removed does.
pub(super) fn sweep(folder: &Path, now: SystemTime) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if !entry.file_name().to_str().is_some_and(is_ours) {
            continue;
        }
        let Ok(metadata) = entry.metadata() else { continue };
        let age = metadata.modified().ok().and_then(|changed| now.duration_since(changed).ok());
        let age = age.unwrap_or_default();
        if !metadata.is_file() || age <= LEFT {
            continue;
        }
        if is_free(&entry.path()).unwrap_or(age > LEFT_UNKNOWN) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Whether no process holds a temporary file; `None` where that cannot be told.
fn is_free(path: &Path) -> Option<bool> {
    match File::open(path).ok()?.try_lock() {
        Ok(()) => Some(true),
        Err(TryLockError::WouldBlock) => Some(false),
        Err(TryLockError::Error(_)) => None,
    }
}

/// Whether a name is one that [`Temporary::beside`] gives.
fn is_ours(name: &str) -> bool {
    let drawn = name
        .strip_prefix('.')
        .and_then(|name| name.strip_suffix(SUFFIX))
        .and_then(|name| name.rsplit_once('.'))
        .map_or("", |(_, drawn)| drawn);
    drawn.len() == DRAWN && drawn.bytes().all(|byte| byte.is_ascii_alphanumeric())
}
