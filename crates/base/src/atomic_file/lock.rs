//! A lock on a file that is read, changed and written again.

use std::fs::File;
use std::io;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use crate::error::{Error, ErrorKind, Result};
use crate::escape;

/// How long a lock is waited for. It is held while one file is read and written.
const PATIENCE: Duration = Duration::from_secs(60);

/// Keeps other processes, and other threads, from changing a file as long as they ask for the lock,
/// too. It goes with the process that holds it, however that ends.
#[derive(Debug)]
pub struct FileLock {
    _held: Option<File>,
}

impl FileLock {
    /// Waits for the lock of a file that is there. On a file system without locks there is none.
    ///
    /// # Errors
    /// `Io` where the file cannot be opened, or where somebody has held the lock for a minute.
    pub fn of(path: &Path) -> Result<Self> {
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            match attempt(path).map_err(|error| Error::io(path, error))? {
                Attempt::Held(file) => return Ok(Self { _held: file }),
                Attempt::Taken => thread::sleep(Duration::from_millis(2)),
            }
        }
        let message = format!(
            "{}: another process has held its lock for {} seconds",
            escape::path(&path),
            PATIENCE.as_secs()
        );
        Err(Error::new(ErrorKind::Io, message).note(format!("{} is unchanged", escape::path(&path))))
    }
}

enum Attempt {
    Held(Option<File>),
    Taken,
}

/// The lock is one on the file itself, so that nothing is left behind. As a file is replaced when
/// it is written, the one that was locked may not be the one that is there now: then it is not
/// held.
#[cfg(unix)]
fn attempt(path: &Path) -> io::Result<Attempt> {
    use std::fs::{TryLockError, metadata};
    use std::os::unix::fs::MetadataExt;

    let file = File::open(path)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Ok(Attempt::Taken),
        Err(TryLockError::Error(_)) => return Ok(Attempt::Held(None)),
    }
    let (locked, now) = (file.metadata()?, metadata(path)?);
    let is_same = (locked.dev(), locked.ino()) == (now.dev(), now.ino());
    Ok(if is_same { Attempt::Held(Some(file)) } else { Attempt::Taken })
}

/// Locks keep readers out on Windows: there it is a file beside, which nobody else can open, and
/// which the system removes with its last handle.
#[cfg(windows)]
fn attempt(path: &Path) -> io::Result<Attempt> {
    use std::os::windows::fs::OpenOptionsExt;

    // GENERIC_WRITE and DELETE, FILE_FLAG_DELETE_ON_CLOSE; ERROR_ACCESS_DENIED (it is being
    // removed), ERROR_SHARING_VIOLATION.
    let (access, flags, taken) = (0x4001_0000, 0x0400_0000, [5, 32]);
    let path = path.canonicalize()?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mut options = File::options();
    options.write(true).create(true).access_mode(access).share_mode(0).custom_flags(flags);
    match options.open(path.with_file_name(format!(".{name}.anyhit-lock"))) {
        Ok(file) => Ok(Attempt::Held(Some(file))),
        Err(error) if error.raw_os_error().is_some_and(|code| taken.contains(&code)) => Ok(Attempt::Taken),
        // A folder that takes no new files.
        Err(_) => Ok(Attempt::Held(None)),
    }
}

#[cfg(not(any(unix, windows)))]
fn attempt(_: &Path) -> io::Result<Attempt> {
    Ok(Attempt::Held(None))
}
