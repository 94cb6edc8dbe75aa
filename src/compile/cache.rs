//! A cache of compiled modules on disk, keyed by the hash of everything that they depend on.
//!
//! The folder is `$ANYHIT_CACHE`, else `anyhit/modules` in the user's cache folder
//! (`$XDG_CACHE_HOME` or `~/.cache`, `~/Library/Caches`, `%LOCALAPPDATA%`). `ANYHIT_CACHE=off`
//! disables it. It may be deleted at any time. An entry is written to a temporary file and renamed,
//! so that concurrent processes never see an incomplete one; an entry with a wrong checksum is
//! compiled again. If the cache cannot be written, compilation is slower, but no error.
//!
//! Its size is limited: when a process writes its first module, entries that were not used for 30
//! days are removed, and the least recently used ones beyond 256 MiB, or as many MiB as
//! `ANYHIT_CACHE_LIMIT` sets.

use std::env;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::time::{Duration, SystemTime};

use super::source::bytes_hash;
use super::{CompileOptions, Language, Source, compile, content_hash, glslang_tool, slang};
use crate::error::Result;

/// The environment variable that names the folder.
pub const VARIABLE: &str = "ANYHIT_CACHE";

/// The environment variable with the limit of the folder, in MiB.
pub const LIMIT_VARIABLE: &str = "ANYHIT_CACHE_LIMIT";

/// The limit where none is given, in MiB.
const LIMIT: u64 = 256;

/// How long an unused entry is kept.
const MAX_UNUSED: Duration = Duration::from_secs(30 * DAY);

/// The time of an entry's last use is kept to the day, so that most reads do not write.
const DAY: u64 = 24 * 60 * 60;

/// The first words of every entry, with the version of the format and of the processing of modules.
const MAGIC: &str = "anyhit module 1";

/// Compiles a source, or takes the module from the cache if it was compiled before with the same
/// text and name, included files, options and version of the compiler.
///
/// # Errors
/// As [`compile()`].
pub fn compile_once(source: &Source, options: &CompileOptions) -> Result<Vec<u8>> {
    match folder() {
        Some(folder) => compile_once_in(&folder, source, options),
        None => compile(source, options),
    }
}

/// Compiles as [`compile_once`] does, with the cache in a given folder.
///
/// # Errors
/// As [`compile()`].
pub fn compile_once_in(folder: &Path, source: &Source, options: &CompileOptions) -> Result<Vec<u8>> {
    let key = key(source, options)?;
    let path = folder.join(&key);
    if let Some(spirv) = fs::read(&path).ok().and_then(|entry| content(&key, &entry)) {
        touch(&path);
        return Ok(spirv);
    }
    let spirv = compile(source, options)?;
    // A failure to write only makes the next compilation slower.
    let _ = write(&path, &entry(&key, &spirv));
    static SWEEP_ONCE: Once = Once::new();
    SWEEP_ONCE.call_once(|| {
        let limit = env::var(LIMIT_VARIABLE).ok().and_then(|limit| limit.trim().parse().ok());
        sweep(folder, limit.unwrap_or(LIMIT) << 20, SystemTime::now());
    });
    Ok(spirv)
}

/// Updates the time of an entry's last use.
fn touch(path: &Path) {
    let touched = || -> std::io::Result<()> {
        let now = SystemTime::now();
        let age = now.duration_since(fs::metadata(path)?.modified()?);
        if age.is_ok_and(|age| age.as_secs() > DAY) {
            fs::File::options().append(true).open(path)?.set_modified(now)?;
        }
        Ok(())
    };
    // An entry whose time cannot be updated is only removed earlier.
    let _ = touched();
}

/// Removes entries that were unused for long, and the least recently used ones beyond `limit`
/// bytes. Other files in the folder are not removed.
fn sweep(folder: &Path, limit: u64, now: SystemTime) {
    let entry = |entry: fs::DirEntry| {
        let (path, data) = (entry.path(), entry.metadata().ok()?);
        let name = path.file_name()?.to_str()?;
        let is_hash = name.len() == 64 && name.bytes().all(|byte| byte.is_ascii_hexdigit());
        // A temporary file of a process that was killed while it wrote.
        let is_temporary = name.starts_with(".tmp");
        (data.is_file() && (is_hash || is_temporary)).then_some(())?;
        Some((data.modified().ok()?, is_temporary, data.len(), path))
    };
    let mut entries: Vec<_> =
        fs::read_dir(folder).into_iter().flatten().flatten().filter_map(entry).collect();
    // Sorts the most recently used first.
    entries.sort_by(|one, other| other.cmp(one));
    let mut kept = 0u64;
    for (used, is_temporary, size, path) in entries {
        let age = now.duration_since(used).unwrap_or_default();
        let is_old = age > if is_temporary { Duration::from_secs(DAY) } else { MAX_UNUSED };
        kept = kept.saturating_add(size);
        if is_old || kept > limit {
            // Another process may have removed it.
            let _ = fs::remove_file(path);
        }
    }
}

/// The folder of the cache; `None` if it is disabled.
pub fn folder() -> Option<PathBuf> {
    match env::var_os(VARIABLE) {
        Some(off) if off == "off" || off == "0" => None,
        Some(folder) if !folder.is_empty() => Some(folder.into()),
        _ => Some(user_cache()?.join("anyhit").join("modules")),
    }
}

/// The user's cache folder, by the conventions of XDG, macOS or Windows.
fn user_cache() -> Option<PathBuf> {
    let absolute = |variable| env::var_os(variable).map(PathBuf::from).filter(|path| path.is_absolute());
    if cfg!(windows) {
        return absolute("LOCALAPPDATA");
    }
    let home = || env::home_dir().filter(|home| home.is_absolute());
    if cfg!(target_os = "macos") {
        return Some(home()?.join("Library/Caches"));
    }
    absolute("XDG_CACHE_HOME").or_else(|| Some(home()?.join(".cache")))
}

/// The hash of everything that a module depends on.
fn key(source: &Source, options: &CompileOptions) -> Result<String> {
    let compiler = match source.language() {
        #[cfg(feature = "glsl")]
        Language::Glsl(_) if !glslang_tool::is_requested() => super::tool(source.language())?,
        Language::Glsl(_) => glslang_tool::tool()?.identity(),
        Language::Slang | Language::Hlsl => slang::tool()?.identity(),
        Language::Wgsl => super::tool(source.language())?,
    };
    let parts = [
        MAGIC,
        env!("CARGO_PKG_VERSION"),
        &compiler,
        &format!("{options:?} {:?}", source.language()),
        source.name(),
        &content_hash(source),
    ];
    // Lengths precede the parts, so that different lists never give the same text.
    let text: String = parts.iter().map(|part| format!("{} {part}\n", part.len())).collect();
    Ok(bytes_hash(text.as_bytes()))
}

/// The bytes of an entry: `MAGIC HASH`, a line end, the module. The hash is over key and module.
fn entry(key: &str, spirv: &[u8]) -> Vec<u8> {
    let hash = bytes_hash(&[key.as_bytes(), spirv].concat());
    [format!("{MAGIC} {hash}\n").as_bytes(), spirv].concat()
}

/// The module of an entry, if its hash is right.
fn content(key: &str, entry: &[u8]) -> Option<Vec<u8>> {
    let at = entry.iter().position(|&byte| byte == b'\n')?;
    let (head, spirv) = (&entry[..at], &entry[at + 1..]);
    let hash = bytes_hash(&[key.as_bytes(), spirv].concat());
    (head == format!("{MAGIC} {hash}").as_bytes()).then(|| spirv.to_vec())
}

fn write(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path)?;
    Ok(())
}

#[cfg(all(test, feature = "wgsl"))]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    const SHADER: &str = "@compute @workgroup_size(1) fn main() {}\n";

    fn entries(folder: &Path) -> Vec<PathBuf> {
        fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect()
    }

    #[test]
    fn a_source_is_compiled_once_and_again_when_anything_changes() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let take = |name: &str, text: &str, options: &CompileOptions| {
            compile_once_in(folder, &Source::from_text(name, text).unwrap(), options).unwrap()
        };
        let first = take("a.wgsl", SHADER, &CompileOptions::default());
        assert_eq!(entries(folder).len(), 1);
        assert_eq!(take("a.wgsl", SHADER, &CompileOptions::default()), first);
        assert_eq!(entries(folder).len(), 1);
        take("a.wgsl", &format!("{SHADER}// more\n"), &CompileOptions::default());
        take("b.wgsl", SHADER, &CompileOptions::default());
        take("a.wgsl", SHADER, &CompileOptions::from_flags(["-g"]).unwrap());
        assert_eq!(entries(folder).len(), 4);
    }

    #[test]
    fn modules_come_from_the_disk_and_broken_entries_are_compiled_again() {
        let folder = tempfile::tempdir().unwrap();
        let source = Source::from_text("a.wgsl", SHADER).unwrap();
        let take = || compile_once_in(folder.path(), &source, &CompileOptions::default()).unwrap();
        let module = take();
        let path = entries(folder.path()).remove(0);
        let key = path.file_name().unwrap().to_str().unwrap().to_owned();
        // The compiler does not run if there is a valid entry.
        fs::write(&path, entry(&key, b"planted")).unwrap();
        assert_eq!(take(), b"planted");
        let whole = entry(&key, &module);
        let mut flipped = whole.clone();
        *flipped.last_mut().unwrap() ^= 1;
        for broken in [&whole[..whole.len() - 3], &flipped, b"", b"no line end"] {
            fs::write(&path, broken).unwrap();
            assert_eq!(take(), module);
            assert_eq!(fs::read(&path).unwrap(), whole);
        }
        // The entry has the name of another one.
        fs::write(&path, entry("another", &module)).unwrap();
        assert_eq!(take(), module);
    }

    #[test]
    fn sweeping_removes_old_entries_and_those_beyond_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let now = SystemTime::now();
        let add = |name: &str, days: u64, size: usize| {
            let path = folder.path().join(name);
            fs::write(&path, vec![0; size]).unwrap();
            let file = fs::File::options().append(true).open(&path).unwrap();
            file.set_modified(now - Duration::from_secs(days * DAY)).unwrap();
        };
        let hash = |digit: &str| digit.repeat(64);
        add(&hash("a"), 0, 40);
        add(&hash("b"), 3, 40);
        add(&hash("c"), 9, 40);
        add(&hash("d"), 31, 1);
        add(".tmpXy", 2, 1);
        add(".tmpYz", 0, 1);
        add("README", 90, 1000);
        let left = |limit| {
            sweep(folder.path(), limit, now);
            let mut names: Vec<_> = entries(folder.path())
                .iter()
                .map(|path| path.file_name().unwrap().to_str().unwrap()[..4].to_owned())
                .collect();
            names.sort();
            names
        };
        assert_eq!(left(1000), [".tmp", "READ", "aaaa", "bbbb", "cccc"]);
        // 40 and 1 and 40 bytes are not more than 81.
        assert_eq!(left(81), [".tmp", "READ", "aaaa", "bbbb"]);
        assert_eq!(left(41), [".tmp", "READ", "aaaa"]);
    }

    #[test]
    fn concurrent_compilations_get_the_same_module() {
        let folder = tempfile::tempdir().unwrap();
        let modules: Vec<_> = std::thread::scope(|scope| {
            let take = || {
                let source = Source::from_text("a.wgsl", SHADER).unwrap();
                compile_once_in(folder.path(), &source, &CompileOptions::default()).unwrap()
            };
            let threads: Vec<_> = (0..8).map(|_| scope.spawn(take)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(modules.windows(2).all(|pair| pair[0] == pair[1]));
        assert_eq!(entries(folder.path()).len(), 1, "temporary files are left behind");
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_no_error_and_a_mistake_is_not_kept() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let source = Source::from_text("a.wgsl", SHADER).unwrap();
        assert!(compile_once_in(&file, &source, &CompileOptions::default()).is_ok());
        let wrong = Source::from_text("a.wgsl", "fn main() -> f32 {}").unwrap();
        for _ in 0..2 {
            let error = compile_once_in(folder.path(), &wrong, &CompileOptions::default()).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidSource);
        }
    }
}
