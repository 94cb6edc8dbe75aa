//! Reads whole files, up to a limit.

use std::fs::{File, FileType, Metadata};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use crate::error::{Error, ErrorKind, Result};
use crate::escape;
use crate::input::limits::{InputLimit, InputLimits};
use crate::input::threads;

/// The path that stands for standard input.
pub const STANDARD_INPUT: &str = "-";

/// Reads what a path on the command line or of an API's caller names: a file, a pipe, a device, or
/// for `-` standard input. It waits for a pipe's writer as any program does, and reads no more than
/// the limit.
///
/// # Errors
/// `Io` where it cannot be read or is a folder; `InvalidArgument` where there is more than the
/// limit allows.
pub fn read_argument(path: &Path, limit: InputLimit, limits: &InputLimits) -> Result<Vec<u8>> {
    if path == Path::new(STANDARD_INPUT) {
        return read(&mut std::io::stdin().lock(), Path::new("standard input"), 0, limit, limits);
    }
    let mut file = File::open(path).map_err(|error| Error::io(path, error))?;
    let metadata = file.metadata().map_err(|error| Error::io(path, error))?;
    if metadata.is_dir() {
        return Err(Error::io(path, std::io::ErrorKind::IsADirectory.into()));
    }
    read_file(&mut file, path, known_size(&metadata), limit, limits)
}

/// Whether a path on the command line is no regular file: what is read from it is gone, and no path
/// can be relative to it.
pub fn is_stream(path: &Path) -> bool {
    path == Path::new(STANDARD_INPUT) || std::fs::metadata(path).is_ok_and(|metadata| is_special(&metadata))
}

fn is_special(metadata: &Metadata) -> bool {
    !metadata.is_file() && !metadata.is_dir()
}

/// Reads a regular file that another file names. Nothing else is opened: a pipe or a device might
/// never end. A link is followed, inside the root where there is one.
///
/// # Errors
/// `Io` where it is not there or cannot be read; `InvalidScene` where it is no regular file, lies
/// outside the root or is larger than the limit.
pub fn read_regular(
    path: &Path,
    root: Option<&RootFolder>,
    limit: InputLimit,
    limits: &InputLimits,
) -> Result<Vec<u8>> {
    let (mut file, size) = open_regular(path, root, limit, limits)?;
    read_file(&mut file, path, size, limit, limits)
}

/// The first bytes of a regular file, at most so many, and how many the file has.
///
/// # Errors
/// As [`read_regular`].
pub fn read_head(
    path: &Path,
    root: Option<&RootFolder>,
    limit: InputLimit,
    limits: &InputLimits,
    most: u64,
) -> Result<(Vec<u8>, u64)> {
    let (file, size) = open_regular(path, root, limit, limits)?;
    let mut head = Vec::new();
    file.take(most).read_to_end(&mut head).map_err(|error| Error::io(path, error))?;
    Ok((head, size))
}

/// Checks that another file names a regular file, and returns where it is. It is not opened.
///
/// # Errors
/// As [`read_regular`], but for what only reading finds.
pub fn check_regular(path: &Path, root: Option<&RootFolder>) -> Result<PathBuf> {
    let found = match root {
        None => path.to_path_buf(),
        Some(root) => root.resolve(path)?,
    };
    regular(path, &std::fs::metadata(&found).map_err(|error| Error::io(path, error))?)?;
    Ok(found)
}

fn open_regular(
    path: &Path,
    root: Option<&RootFolder>,
    limit: InputLimit,
    limits: &InputLimits,
) -> Result<(File, u64)> {
    let io = |error| Error::io(path, error);
    let file = File::open(check_regular(path, root)?).map_err(io)?;
    // Once more: another file may stand there by now.
    let metadata = file.metadata().map_err(io)?;
    regular(path, &metadata)?;
    let size = known_size(&metadata);
    limits.check(limit, size, ErrorKind::InvalidScene).map_err(|error| error.context(escape::path(&path)))?;
    Ok((file, size))
}

/// Refuses everything but a regular file.
fn regular(path: &Path, metadata: &Metadata) -> Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    let message = format!("{}: {}, not a regular file", escape::path(&path), what(metadata.file_type()));
    Err(Error::new(ErrorKind::InvalidScene, message)
        .note("a path inside a file must name a regular file; only the command line may name a pipe"))
}

/// What a file is that is no regular one.
fn what(kind: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "a FIFO";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    if kind.is_dir() { "a folder" } else { "something else" }
}

/// The size that a regular file reports; devices and pipes report none.
fn known_size(metadata: &Metadata) -> u64 {
    if metadata.is_file() { metadata.len() } else { 0 }
}

fn read(
    from: &mut dyn Read,
    path: &Path,
    size: u64,
    limit: InputLimit,
    limits: &InputLimits,
) -> Result<Vec<u8>> {
    let bytes = Vec::with_capacity(usize::try_from(size.min(limits.get(limit))).unwrap_or(0));
    read_rest(from, path, bytes, limit, limits)
}

/// As [`read`], of a file that reports its size: a large one is read by all threads.
fn read_file(
    file: &mut File,
    path: &Path,
    size: u64,
    limit: InputLimit,
    limits: &InputLimits,
) -> Result<Vec<u8>> {
    /// Bytes that a thread reads at once.
    const PART: usize = 1 << 22;
    match usize::try_from(size) {
        Ok(known) if cfg!(unix) && known > PART && size <= limits.get(limit) => {
            let mut bytes = vec![0; known];
            let is_read = AtomicBool::new(true);
            threads::fill(&mut bytes, PART, &|begin, part| {
                if read_at(file, part, begin as u64).is_err() {
                    is_read.store(false, Relaxed);
                }
            });
            if is_read.into_inner() && file.seek(SeekFrom::Start(size)).is_ok() {
                return read_rest(file, path, bytes, limit, limits);
            }
            // It may have become shorter.
            file.rewind().map_err(|error| Error::io(path, error))?;
            read(file, path, size, limit, limits)
        }
        _ => read(file, path, size, limit, limits),
    }
}

/// Reads a part of a file without moving its cursor.
#[cfg(unix)]
fn read_at(file: &File, part: &mut [u8], begin: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, part, begin)
}

/// Elsewhere files are read from their beginning to their end.
#[cfg(not(unix))]
fn read_at(_file: &File, _part: &mut [u8], _begin: u64) -> std::io::Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

/// Reads what follows the bytes that are read already.
fn read_rest(
    from: &mut dyn Read,
    path: &Path,
    mut bytes: Vec<u8>,
    limit: InputLimit,
    limits: &InputLimits,
) -> Result<Vec<u8>> {
    let most = limits.get(limit);
    // Not the reported size alone: a file may grow, and a pipe reports none.
    let mut from = from.take(most.saturating_add(1).saturating_sub(bytes.len() as u64));
    from.read_to_end(&mut bytes).map_err(|error| Error::io(path, error))?;
    if bytes.len() as u64 > most {
        let error = limits.exceeded(limit, None, ErrorKind::InvalidArgument);
        return Err(error.context(escape::path(&path)));
    }
    Ok(bytes)
}

/// A folder that the paths of a scene may not leave, links followed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RootFolder {
    folder: PathBuf,
}

impl RootFolder {
    /// The root with this folder.
    ///
    /// # Errors
    /// `Io` where there is no such folder.
    pub fn new(folder: &Path) -> Result<Self> {
        let named = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let found = named.canonicalize().map_err(|error| Error::io(folder, error))?;
        if !found.is_dir() {
            return Err(Error::io(folder, std::io::ErrorKind::NotADirectory.into()));
        }
        Ok(Self { folder: found })
    }

    /// The root of a test by default: its repository, which is the nearest folder above it that
    /// holds a `.git`. Where there is none, the current folder if the test lies in it, and
    /// otherwise the folder `tree` that was searched for tests.
    ///
    /// # Errors
    /// `Io` where the folder of the file is not there.
    pub fn of_test(file: &Path, tree: &Path) -> Result<Self> {
        // The file's own folder: where a link in its place leads is not for it to say.
        let folder = Self::new(file.parent().unwrap_or(Path::new("")))?.folder;
        if let Some(repository) = folder.ancestors().find(|folder| folder.join(".git").exists()) {
            return Ok(Self { folder: repository.to_path_buf() });
        }
        let current = Self::new(Path::new("."))?;
        if folder.starts_with(&current.folder) { Ok(current) } else { Self::new(tree) }
    }

    /// The folder, an absolute path without links.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file that a path leads to, an absolute path without links.
    ///
    /// # Errors
    /// `Io` where it is not there, `InvalidScene` where it lies outside.
    pub fn resolve(&self, path: &Path) -> Result<PathBuf> {
        let found = path.canonicalize().map_err(|error| Error::io(path, error))?;
        if found.starts_with(&self.folder) {
            return Ok(found);
        }
        let message = format!("{}: outside the folder {}", escape::path(&path), escape::path(&self.folder));
        Err(Error::new(ErrorKind::InvalidScene, message)
            .note("paths in a scene may not leave this folder, even by links; `--root DIR` selects another"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_up_to_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, [7; 10]).unwrap();
        let limits = |most| InputLimits::default().with(InputLimit::FileBytes, most);
        for read in [
            |path: &Path, limits: &InputLimits| read_argument(path, InputLimit::FileBytes, limits),
            |path: &Path, limits: &InputLimits| read_regular(path, None, InputLimit::FileBytes, limits),
        ] {
            assert_eq!(read(&path, &limits(10)).unwrap(), [7; 10]);
            let error = read(&path, &limits(9)).unwrap_err();
            assert!(error.message().contains("the limit `file-bytes` of 9"), "{error}");
            assert!(error.message().starts_with(&path.display().to_string()), "{error}");
            assert!(read(folder.path(), &limits(9)).is_err());
            assert!(read(&folder.path().join("b"), &limits(9)).unwrap_err().message().contains("/b: "));
        }
    }

    #[test]
    fn a_large_file_is_read_in_parts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let bytes: Vec<u8> = (0..(9 << 20) + 5_u32).map(|at| (at >> 7) as u8).collect();
        std::fs::write(&path, &bytes).unwrap();
        let size = bytes.len() as u64;
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let read = |most| {
                let limits = InputLimits::default().with(InputLimit::FileBytes, most);
                pool.install(|| read_argument(&path, InputLimit::FileBytes, &limits))
            };
            assert!(read(size).unwrap() == bytes);
            assert!(read(size - 1).is_err());
        }
        // A file that is longer or shorter than it was.
        let limits = InputLimits::default().with(InputLimit::FileBytes, size);
        for known in [size - 1, size] {
            let mut file = File::open(&path).unwrap();
            assert!(read_file(&mut file, &path, known, InputLimit::FileBytes, &limits).unwrap() == bytes);
        }
        std::fs::write(&path, &bytes[..5 << 20]).unwrap();
        let mut file = File::open(&path).unwrap();
        let read = read_file(&mut file, &path, size, InputLimit::FileBytes, &limits).unwrap();
        assert!(read == bytes[..5 << 20]);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_read_up_to_the_limit_or_refused() {
        let zero = Path::new("/dev/zero");
        let limits = InputLimits::default().with(InputLimit::ModuleBytes, 1 << 20);
        let error = read_argument(zero, InputLimit::ModuleBytes, &limits).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidArgument);
        assert!(error.message().contains("more bytes of a module than the limit"), "{error}");
        let error = read_regular(zero, None, InputLimit::ModuleBytes, &limits).unwrap_err();
        assert!(error.message().contains("/dev/zero: a device, not a regular file"), "{error}");
        assert!(is_stream(zero) && is_stream(Path::new("-")) && !is_stream(Path::new("/")));
    }

    #[cfg(unix)]
    #[test]
    fn a_root_is_not_left_by_dots_or_links() {
        let folder = tempfile::tempdir().unwrap();
        let [inside, outside] = ["inside", "outside"].map(|name| folder.path().join(name));
        for folder in [&inside, &outside] {
            std::fs::create_dir(folder).unwrap();
            std::fs::write(folder.join("a"), "text").unwrap();
        }
        std::os::unix::fs::symlink(outside.join("a"), inside.join("leaves")).unwrap();
        std::os::unix::fs::symlink("a", inside.join("stays")).unwrap();
        std::os::unix::fs::symlink(&outside, inside.join("folder")).unwrap();
        let root = RootFolder::new(&inside).unwrap();
        let read = |name: &str| {
            let limits = InputLimits::default();
            read_regular(&inside.join(name), Some(&root), InputLimit::FileBytes, &limits)
        };
        for name in ["a", "stays", "../inside/a", "folder/../inside/a"] {
            assert_eq!(read(name).unwrap(), b"text", "{name}");
        }
        for name in ["../outside/a", "leaves", "folder/a"] {
            let error = read(name).unwrap_err();
            assert!(error.message().contains("outside the folder"), "{name}: {error}");
            assert!(error.notes()[0].contains("--root DIR"), "{error}");
        }
    }

    #[test]
    fn the_root_of_a_test_is_its_repository_or_its_tree() {
        let folder = tempfile::tempdir().unwrap();
        let test = folder.path().join("repository/tests/case");
        std::fs::create_dir_all(&test).unwrap();
        let file = test.join("scene.toml");
        let tree = folder.path().join("repository/tests");
        let whole = |path: &Path| path.canonicalize().unwrap();
        assert_eq!(RootFolder::of_test(&file, &tree).unwrap().folder(), whole(&tree));
        // A work tree of git has a file of that name.
        std::fs::write(folder.path().join("repository/.git"), "gitdir: elsewhere").unwrap();
        let repository = whole(&folder.path().join("repository"));
        assert_eq!(RootFolder::of_test(&file, &tree).unwrap().folder(), repository);
        let own = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("shaders/scene.toml");
        assert!(
            whole(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")))
                .starts_with(RootFolder::of_test(&own, Path::new("shaders")).unwrap().folder())
        );
    }
}
