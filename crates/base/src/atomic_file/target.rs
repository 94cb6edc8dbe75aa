//! What a path that is to be written leads to.

use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// As many links after each other as Linux follows.
const LINKS: usize = 40;

/// What is to be written.
pub(super) enum Target {
    /// A regular file, or none yet, under a path whose last part is no link.
    File { path: PathBuf, before: Option<Metadata> },
    /// A device, a pipe or a descriptor of this process, open to be written.
    Stream(File),
}

/// Follows links to what is to be written.
///
/// # Errors
/// Those of the system, for a folder, links in a circle, or what may not be opened.
pub(super) fn resolve(path: &Path) -> io::Result<Target> {
    // The kernel's own rules on whose links are followed hold here, too.
    match fs::metadata(path) {
        Err(error) if error.kind() == ErrorKind::PermissionDenied => return Err(error),
        _ => {}
    }
    let mut place = path.to_path_buf();
    for _ in 0..LINKS {
        if let Some(name) = descriptor(&place) {
            return stream(&place, name);
        }
        match place.symlink_metadata() {
            Ok(metadata) if metadata.is_symlink() => {
                let to = fs::read_link(&place)?;
                place = place.parent().unwrap_or(Path::new("")).join(to);
            }
            Ok(metadata) if metadata.is_file() => {
                return Ok(Target::File { path: place, before: Some(metadata) });
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {
                return Ok(Target::File { path: place, before: None });
            }
            // Whatever else it is, opening it says: a folder, or a device as `NUL` of Windows.
            _ => break,
        }
    }
    Ok(Target::Stream(File::create(path)?))
}

/// The last part of a path that names a descriptor of a process: `stdout`, `1`.
fn descriptor(path: &Path) -> Option<&str> {
    if !cfg!(unix) {
        return None;
    }
    let name = path.file_name()?.to_str()?;
    let folder = path.parent()?;
    let number = name.bytes().all(|byte| byte.is_ascii_digit());
    let is_one = (folder == Path::new("/dev") && matches!(name, "stdout" | "stderr"))
        || (folder == Path::new("/dev/fd") && number)
        || (folder.starts_with("/proc") && folder.ends_with("fd") && number);
    is_one.then_some(name)
}

/// Opens a descriptor so that what it was written before stays, a regular file's content included.
#[cfg(unix)]
fn stream(path: &Path, name: &str) -> io::Result<Target> {
    use std::os::fd::AsFd;
    let own = path.starts_with("/dev") || path.starts_with("/proc/self");
    Ok(Target::Stream(match name {
        // A copy of the descriptor shares its position in the file.
        "stdout" | "1" if own => io::stdout().as_fd().try_clone_to_owned()?.into(),
        "stderr" | "2" if own => io::stderr().as_fd().try_clone_to_owned()?.into(),
        _ => File::options().append(true).open(path)?,
    }))
}

#[cfg(not(unix))]
fn stream(path: &Path, _: &str) -> io::Result<Target> {
    Ok(Target::Stream(File::create(path)?))
}
