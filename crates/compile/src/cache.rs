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
//! `ANYHIT_CACHE_LIMIT` sets. Files that are not entries stay, whatever they are called.

use std::env;
use std::fs;
use std::io::Read;
use std::num::{IntErrorKind, ParseIntError};
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::time::{Duration, SystemTime};

use super::source::hash::bytes_hash;
use super::{CompileOptions, Compiled, Language, Source, compile_with_warnings, glslang_tool, slang};
use anyhit_base::atomic_file;
use anyhit_base::error::{Error, Result};
use anyhit_base::sorted::sort_by;

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
const MAGIC: &str = "anyhit module 3";

/// Begins the entries of every version.
const MAGIC_OF_ALL: &[u8] = b"anyhit module ";

/// Compiles a source, or takes the module from the cache if it was compiled before with the same
/// text and name, included files, options and version of the compiler. A source with an include
/// that only a preprocessor can name is always compiled.
///
/// # Errors
/// As [`Source::compile`].
pub fn compile_once(source: &Source, options: &CompileOptions) -> Result<Vec<u8>> {
    compile_once_with_warnings(source, options).map(|compiled| compiled.spirv)
}

/// Compiles as [`compile_once`] does; what the compiler warned of is kept with the module.
///
/// # Errors
/// As [`Source::compile`].
pub fn compile_once_with_warnings(source: &Source, options: &CompileOptions) -> Result<Compiled> {
    match folder() {
        Some(folder) => compile_once_in(&folder, source, options),
        None => compile_with_warnings(source, options),
    }
}

/// Compiles as [`compile_once_with_warnings`] does, with the cache in a given folder.
///
/// # Errors
/// As [`Source::compile`].
pub fn compile_once_in(folder: &Path, source: &Source, options: &CompileOptions) -> Result<Compiled> {
    let Some(key) = key(source, options)? else {
        return compile_with_warnings(source, options);
    };
    let path = folder.join(&key);
    if let Some(compiled) = fs::read(&path).ok().and_then(|entry| content(&key, &entry)) {
        touch(&path);
        return Ok(compiled);
    }
    let was_file = source.has_unchanged_file();
    let compiled = compile_with_warnings(source, options)?;
    // A file that changed meanwhile may be part of the module, which then belongs to another key.
    if source.has_unchanged_file() != was_file || self::key(source, options)?.as_ref() != Some(&key) {
        return Ok(compiled);
    }
    // A failure to write only makes the next compilation slower.
    let _ = write(&path, &entry(&key, &compiled));
    static SWEEP_ONCE: Once = Once::new();
    SWEEP_ONCE.call_once(|| {
        let limit = env::var(LIMIT_VARIABLE);
        sweep(folder, limit_bytes(limit.as_deref().unwrap_or_default()), SystemTime::now());
    });
    Ok(compiled)
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

/// The limit of the folder in bytes, from a number of MiB. Without a number it is the usual one,
/// and a number too large for any disk is no limit.
fn limit_bytes(mebibytes: &str) -> u64 {
    let number: Result<u64, ParseIntError> = mebibytes.trim().parse();
    let number = match number {
        Ok(number) => number,
        Err(error) if *error.kind() == IntErrorKind::PosOverflow => u64::MAX,
        Err(_) => LIMIT,
    };
    number.saturating_mul(1 << 20)
}

/// Removes entries that were unused for long, and the least recently used ones beyond `limit`
/// bytes. Other files in the folder are not removed.
fn sweep(folder: &Path, limit: u64, now: SystemTime) {
    let entry = |entry: fs::DirEntry| {
        let (path, data) = (entry.path(), entry.metadata().ok()?);
        let name = path.file_name()?.to_str()?;
        let is_hash = name.len() == 64 && name.bytes().all(|byte| byte.is_ascii_hexdigit());
        (data.is_file() && is_hash).then_some(())?;
        Some((data.modified().ok()?, data.len(), path))
    };
    let mut entries: Vec<_> =
        fs::read_dir(folder).into_iter().flatten().flatten().filter_map(entry).collect();
    let is_old = |used: &SystemTime| now.duration_since(*used).unwrap_or_default() > MAX_UNUSED;
    let total = entries.iter().fold(0u64, |total, (_, size, _)| total.saturating_add(*size));
    if total <= limit && !entries.iter().any(|(used, ..)| is_old(used)) {
        return;
    }
    // Others name their files by hashes, too.
    entries.retain(|(_, _, path)| is_entry(path));
    // Sorts the most recently used first.
    sort_by(&mut entries, |one, other| other.cmp(one));
    let mut kept = 0u64;
    for (used, size, path) in entries {
        kept = kept.saturating_add(size);
        if is_old(&used) || kept > limit {
            // Another process may have removed it.
            let _ = fs::remove_file(path);
        }
    }
}

/// Whether a file begins as an entry does, of this or another version.
fn is_entry(path: &Path) -> bool {
    let mut head = [0; MAGIC_OF_ALL.len()];
    let read = fs::File::open(path).and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && head == MAGIC_OF_ALL
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

/// The hash of everything that a module depends on; `None` where that is not known before it is
/// compiled.
fn key(source: &Source, options: &CompileOptions) -> Result<Option<String>> {
    let Some(content) = source.exact_hash() else { return Ok(None) };
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
        &content,
    ];
    // Lengths precede the parts, so that different lists never give the same text.
    let text: String = parts.iter().map(|part| format!("{} {part}\n", part.len())).collect();
    Ok(Some(bytes_hash(text.as_bytes())))
}

/// The bytes of an entry: `MAGIC HASH`, a line with the warnings as JSON, the module. The hash is
/// over the key and what follows the first line.
fn entry(key: &str, compiled: &Compiled) -> Vec<u8> {
    let warnings = serde_json::to_string(&compiled.warnings).unwrap_or_default();
    let body = [warnings.as_bytes(), b"\n", &compiled.spirv].concat();
    let hash = bytes_hash(&[key.as_bytes(), &body].concat());
    [format!("{MAGIC} {hash}\n").as_bytes(), &body].concat()
}

/// The module of an entry with its warnings, if its hash is right.
fn content(key: &str, entry: &[u8]) -> Option<Compiled> {
    let line = |bytes: &[u8]| bytes.iter().position(|&byte| byte == b'\n');
    let at = line(entry)?;
    let (head, body) = (&entry[..at], &entry[at + 1..]);
    let hash = bytes_hash(&[key.as_bytes(), body].concat());
    if head != format!("{MAGIC} {hash}").as_bytes() {
        return None;
    }
    let at = line(body)?;
    let warnings = serde_json::from_slice(&body[..at]).ok()?;
    Some(Compiled { spirv: body[at + 1..].to_vec(), warnings })
}

/// Writes an entry. Should it be lost with the machine's power, its hash says so.
fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(|error| Error::io(folder, error))?;
    atomic_file::write_unsynced(path, bytes)
}

#[cfg(all(test, feature = "wgsl"))]
mod tests {
    use super::*;
    use anyhit_base::error::{ErrorKind, Warning};

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
        let warning = Warning { file: "a.wgsl".into(), line: 3, column: 0, message: "two\nlines".into() };
        let planted = Compiled { spirv: b"pla\nnted".to_vec(), warnings: vec![warning] };
        fs::write(&path, entry(&key, &planted)).unwrap();
        assert_eq!(take(), planted);
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
            let content = [MAGIC_OF_ALL, &vec![b'1'; size - MAGIC_OF_ALL.len()]].concat();
            fs::write(
                &path,
                if name.len() == 64 && !name.starts_with('e') { content } else { vec![0; size] },
            )
            .unwrap();
            let file = fs::File::options().append(true).open(&path).unwrap();
            file.set_modified(now - Duration::from_secs(days * DAY)).unwrap();
        };
        let hash = |digit: &str| digit.repeat(64);
        add(&hash("a"), 0, 40);
        add(&hash("b"), 3, 40);
        add(&hash("c"), 9, 40);
        add(&hash("d"), 31, 20);
        // Files of others: what another program names by hashes, and its temporary files.
        add(&hash("e"), 90, 1000);
        add(".tmpXy", 200, 100);
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
        assert_eq!(left(1000), [".tmp", "READ", "aaaa", "bbbb", "cccc", "eeee"]);
        // 40 and 40 bytes are not more than 80.
        assert_eq!(left(80), [".tmp", "READ", "aaaa", "bbbb", "eeee"]);
        assert_eq!(left(41), [".tmp", "READ", "aaaa", "eeee"]);
        assert_eq!(left(0), [".tmp", "READ", "eeee"]);
    }

    #[test]
    fn a_limit_beyond_all_numbers_is_none() {
        assert_eq!(limit_bytes(" 2 "), 2 << 20);
        assert_eq!(limit_bytes("0"), 0);
        for usual in ["", "many", "-1", "1.5"] {
            assert_eq!(limit_bytes(usual), 256 << 20, "{usual}");
        }
        // 2^44 MiB are 2^64 bytes.
        for none in ["17592186044416", "18446744073709551615", "99999999999999999999999"] {
            assert_eq!(limit_bytes(none), u64::MAX, "{none}");
        }
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
