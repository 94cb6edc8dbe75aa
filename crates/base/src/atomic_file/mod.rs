//! Files that are whole or as they were: the one way in which commands and the library write.
//!
//! A regular file is written to a temporary file beside it, flushed to the disk, and renamed over
//! the old one. Whoever reads the path, and whatever ends this process at whatever moment, finds
//! the old file or the new one, never a part. A full disk, a trap of the shader whose picture is
//! streamed, and a signal leave the old file; a temporary file that a killed process left is
//! removed by a later one that writes to the same folder, an hour on.
//!
//! - Symbolic links are followed: the file that they lead to is replaced. A file that may not be
//!   written is not replaced either. Permissions, and owner and group as far as the system allows,
//!   stay as they were, but not access control lists and extended attributes; other names of the
//!   same file (hard links) keep the old content.
//! - Devices, pipes and descriptors (`/dev/stdout`) are written to as they are, from where they
//!   stand.
//! - A file that may be written in a folder that may not, or that is mounted by itself, is written
//!   in place. Should that fail, its old content is put back.

mod lock;
mod target;
mod temporary;

use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::error::{Error, Result};
use crate::escape;
use target::Target;
use temporary::Temporary;

pub use lock::FileLock;
pub use temporary::RemovalGuard;
#[cfg(unix)]
pub use temporary::{abandon_all, before_first};

/// The longest content that is put back where a file is written in place and that fails.
const PUT_BACK: u64 = 1 << 26;

/// Writes a file as a whole: all of it is there afterwards, or what was there before.
///
/// # Errors
/// `Io`, with a note on what the path holds now.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    all(AtomicFile::create(path)?, bytes.as_ref())
}

/// Writes a file as a whole, like [`write()`], but without waiting for the disk: for what can be
/// made again, as after a loss of power it may be empty.
///
/// # Errors
/// `Io`, with a note on what the path holds now.
pub fn write_unsynced(path: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    let file = AtomicFile::create(path)?;
    all(AtomicFile { sync: false, ..file }, bytes.as_ref())
}

fn all(mut file: AtomicFile, bytes: &[u8]) -> Result<()> {
    match file.write_all(bytes) {
        Ok(()) => file.finish(),
        Err(error) => Err(file.failed(error)),
    }
}

/// A file that is being written, and takes its place with [`AtomicFile::finish`]. Without that, its
/// path holds what it held before. It does not buffer.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    sync: bool,
    way: Way,
}

#[derive(Debug)]
enum Way {
    /// To a temporary file, which is to be renamed.
    Beside { file: File, temporary: Temporary, target: PathBuf, replaces: bool },
    /// Over the old content.
    InPlace(InPlace),
    /// To what keeps no content.
    Stream(File),
}

impl AtomicFile {
    /// Begins to write a file.
    ///
    /// # Errors
    /// `Io` where the path cannot be written, with a note on what it holds.
    pub fn create(path: &Path) -> Result<Self> {
        let way = Way::to(path).map_err(|error| {
            Error::io(path, error).note(format!("nothing was written to {}", escape::path(&path)))
        })?;
        Ok(Self { path: path.to_path_buf(), sync: true, way })
    }

    /// Ends the writing: the file takes its place.
    ///
    /// # Errors
    /// `Io`, with a note on what the path holds now.
    pub fn finish(self) -> Result<()> {
        let Self { path, sync, way } = self;
        match way.finish(sync) {
            Ok(()) => Ok(()),
            Err((error, kept)) => Err(Error::io(&path, error).note(kept.note(&path))),
        }
    }

    /// Gives up after a failed write: the error, with a note on what the path holds now.
    pub(crate) fn failed(self, error: io::Error) -> Error {
        let error = Error::io(&self.path, error);
        self.abandon(error)
    }

    /// Gives up after an error of any kind; one of the operating system gets a note on what the
    /// path holds now.
    pub fn abandon(self, error: Error) -> Error {
        let kept = self.way.abandon();
        if error.kind() == crate::error::ErrorKind::Io { error.note(kept.note(&self.path)) } else { error }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.way {
            Way::Beside { file, .. } | Way::Stream(file) => file.write(bytes),
            Way::InPlace(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.way {
            Way::Beside { file, .. } | Way::Stream(file) => file.flush(),
            Way::InPlace(file) => file.file.flush(),
        }
    }
}

/// What a path holds after a failure.
enum Kept {
    Old,
    Nothing,
    Part,
    Stream,
}

impl Kept {
    fn note(&self, path: &Path) -> String {
        let path = escape::path(&path);
        match self {
            Self::Old => format!("{path} is unchanged"),
            Self::Nothing => format!("{path} was not created"),
            Self::Part => format!("{path} is incomplete: it could only be written in place"),
            Self::Stream => format!("{path} received part of the data"),
        }
    }
}

impl Way {
    fn to(path: &Path) -> io::Result<Self> {
        let (target, before) = match target::resolve(path)? {
            Target::Stream(file) => return Ok(Self::Stream(file)),
            Target::File { path, before } => (path, before),
        };
        if before.is_some() {
            // A file that may not be written is not replaced, either.
            retried(|| File::options().write(true).open(&target))?;
        }
        let (file, temporary) = match Temporary::beside(&target) {
            Ok(made) => made,
            Err(error) if before.is_some() && is_closed_folder(&error) => {
                return Ok(Self::InPlace(InPlace::new(&target)?));
            }
            Err(error) => return Err(error),
        };
        if let Some(before) = &before
            && keep_rights(&file, before).is_err()
        {
            // Better in place than with other rights.
            return Ok(Self::InPlace(InPlace::new(&target)?));
        }
        Ok(Self::Beside { file, temporary, target, replaces: before.is_some() })
    }

    fn finish(self, sync: bool) -> Result<(), (io::Error, Kept)> {
        match self {
            Self::Beside { file, temporary, target, replaces } => {
                let kept = || if replaces { Kept::Old } else { Kept::Nothing };
                if sync {
                    flush_to_disk(&file).map_err(|error| (error, kept()))?;
                }
                // Windows renames no file that is open.
                drop(file);
                match temporary.persist(&target) {
                    Ok(()) => {
                        if sync {
                            flush_folder(&target);
                        }
                        Ok(())
                    }
                    // Something is mounted on the file itself.
                    Err((error, temporary)) if replaces && is_mounted(&error) => {
                        let place = InPlace::new(&target).map_err(|error| (error, Kept::Old))?;
                        place.copy(temporary.path(), sync)
                    }
                    Err((error, _)) => Err((error, kept())),
                }
            }
            Self::InPlace(file) => file.finish(sync),
            Self::Stream(mut file) => file.flush().map_err(|error| (error, Kept::Stream)),
        }
    }

    fn abandon(self) -> Kept {
        match self {
            Self::Beside { replaces: true, .. } => Kept::Old,
            Self::Beside { .. } => Kept::Nothing,
            Self::InPlace(mut file) => file.put_back(),
            Self::Stream(_) => Kept::Stream,
        }
    }
}

/// A file that is overwritten, as nothing can take its place.
#[derive(Debug)]
struct InPlace {
    file: File,
    /// Its content, where that can be read and is not too long.
    before: Option<Vec<u8>>,
    written: u64,
    is_settled: bool,
}

impl InPlace {
    /// Opens a file that is there, and keeps what it holds. It is not truncated before all is
    /// written: what is written over the old content finds room on a full disk, and so does the old
    /// content when it is put back.
    fn new(path: &Path) -> io::Result<Self> {
        let file = File::options().write(true).open(path)?;
        let short = fs::metadata(path).is_ok_and(|metadata| metadata.len() <= PUT_BACK);
        let before = if short { fs::read(path).ok() } else { None };
        Ok(Self { file, before, written: 0, is_settled: false })
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.written += count as u64;
        Ok(count)
    }

    fn copy(mut self, from: &Path, sync: bool) -> Result<(), (io::Error, Kept)> {
        let copied = File::open(from).and_then(|mut from| io::copy(&mut from, &mut self.file));
        match copied {
            Ok(count) => {
                self.written = count;
                self.finish(sync)
            }
            Err(error) => {
                // At least one byte may have been written.
                self.written = 1;
                Err((error, self.put_back()))
            }
        }
    }

    fn finish(mut self, sync: bool) -> Result<(), (io::Error, Kept)> {
        let ended = match self.file.metadata() {
            Ok(metadata) if metadata.len() > self.written => self.file.set_len(self.written),
            Ok(_) => Ok(()),
            Err(error) => Err(error),
        };
        match ended.and_then(|()| if sync { flush_to_disk(&self.file) } else { Ok(()) }) {
            Ok(()) => {
                self.is_settled = true;
                Ok(())
            }
            Err(error) => Err((error, self.put_back())),
        }
    }

    fn put_back(&mut self) -> Kept {
        let is_first = !std::mem::replace(&mut self.is_settled, true);
        if !is_first || self.written == 0 {
            return Kept::Old;
        }
        let Some(before) = &self.before else { return Kept::Part };
        let restored = self
            .file
            .rewind()
            .and_then(|()| self.file.write_all(before))
            .and_then(|()| self.file.set_len(before.len() as u64));
        if restored.is_ok() { Kept::Old } else { Kept::Part }
    }
}

impl Drop for InPlace {
    fn drop(&mut self) {
        self.put_back();
    }
}

/// Gives a new file owner, group and permissions of the one that it is to replace.
fn keep_rights(file: &File, before: &Metadata) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt, fchown};
        let now = file.metadata()?;
        // Only a superuser may give files away. The permissions come after: this takes some back.
        if now.gid() != before.gid() {
            let _ = fchown(file, None, Some(before.gid()));
        }
        if now.uid() != before.uid() {
            let _ = fchown(file, Some(before.uid()), None);
        }
    }
    if file.metadata()?.permissions() != before.permissions() {
        file.set_permissions(before.permissions())?;
    }
    Ok(())
}

/// Waits until a file's content is on the disk; only then can a full disk be ruled out everywhere.
fn flush_to_disk(file: &File) -> io::Result<()> {
    match file.sync_all() {
        // What is not a disk has nothing to wait for.
        Err(error) if matches!(error.kind(), ErrorKind::Unsupported | ErrorKind::InvalidInput) => Ok(()),
        synced => synced,
    }
}

/// Waits until a file's new name is on the disk. The file is whole without.
fn flush_folder(path: &Path) {
    if cfg!(unix) {
        let _ = File::open(folder_of(path)).and_then(|folder| folder.sync_all());
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether an error says that a folder takes no new files, and not that a disk is full.
fn is_closed_folder(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::PermissionDenied
            | ErrorKind::ReadOnlyFilesystem
            | ErrorKind::NotFound
            | ErrorKind::Unsupported
            | ErrorKind::InvalidFilename
    )
}

/// Whether a rename failed because the target is a mount of its own.
fn is_mounted(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::ResourceBusy | ErrorKind::CrossesDevices)
}

/// Tries again, for a second in all, what Windows refuses while a virus scanner, an indexer or a
/// reader has a file open.
fn retried<T>(attempt: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    // ERROR_ACCESS_DENIED, ERROR_SHARING_VIOLATION, ERROR_LOCK_VIOLATION
    retried_if(|error| cfg!(windows) && matches!(error.raw_os_error(), Some(5 | 32 | 33)), attempt)
}

fn retried_if<T>(
    passes: impl Fn(&io::Error) -> bool,
    mut attempt: impl FnMut() -> io::Result<T>,
) -> io::Result<T> {
    for power in 0..10 {
        match attempt() {
            Err(error) if passes(&error) => std::thread::sleep(Duration::from_millis(1 << power)),
            settled => return settled,
        }
    }
    attempt()
}

#[cfg(test)]
mod tests;
