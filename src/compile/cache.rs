//! Compiled modules on disk, found by the hash of all that they are made from.
//!
//! The folder is `$ANYHIT_CACHE`, else `anyhit/modules` in the user's cache folder
//! (`$XDG_CACHE_HOME` or `~/.cache`, `~/Library/Caches`, `%LOCALAPPDATA%`). `ANYHIT_CACHE=off` does
//! without. It may be deleted at any time. An entry is written beside its place and renamed, so that
//! processes side by side never see half of one; an entry whose own hash does not fit is compiled
//! again. A cache that cannot be written is slow, not an error.

use std::env;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::source::bytes_hash;
use super::{Language, Options, Source, compile, content_hash, glslang_tool, slang};
use crate::error::Result;

/// The environment variable that names the folder.
pub const VARIABLE: &str = "ANYHIT_CACHE";

/// Begins every entry; a change of the format or of what is done to modules changes it.
const MAGIC: &str = "anyhit module 1";

/// Compiles a source, or takes the module that was compiled from the very same before: text and
/// name, all files that it includes, options, and the compiler's version.
///
/// # Errors
/// As [`compile()`].
pub fn compile_once(source: &Source, options: &Options) -> Result<Vec<u8>> {
    match folder() {
        Some(folder) => compile_once_in(&folder, source, options),
        None => compile(source, options),
    }
}

/// The same with a folder at hand.
///
/// # Errors
/// As [`compile()`].
pub fn compile_once_in(folder: &Path, source: &Source, options: &Options) -> Result<Vec<u8>> {
    let key = key(source, options)?;
    let path = folder.join(&key);
    if let Some(spirv) = fs::read(&path).ok().and_then(|entry| content(&key, &entry)) {
        return Ok(spirv);
    }
    let spirv = compile(source, options)?;
    // Slow without it, but right.
    let _ = write(&path, &entry(&key, &spirv));
    Ok(spirv)
}

/// Where modules are kept; `None` where they are not.
pub fn folder() -> Option<PathBuf> {
    match env::var_os(VARIABLE) {
        Some(off) if off == "off" || off == "0" => None,
        Some(folder) if !folder.is_empty() => Some(folder.into()),
        _ => Some(user_cache()?.join("anyhit").join("modules")),
    }
}

/// The user's folder for caches: XDG's, Apple's or Windows' own.
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
fn key(source: &Source, options: &Options) -> Result<String> {
    let compiler = match source.language() {
        #[cfg(feature = "glsl")]
        Language::Glsl(_) if !glslang_tool::asked_for() => super::tool(source.language())?,
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
    // Lengths first, so that no two lists of parts read alike.
    let text: String = parts.iter().map(|part| format!("{} {part}\n", part.len())).collect();
    Ok(bytes_hash(text.as_bytes()))
}

/// `MAGIC HASH`, a line end, the module; the hash is over key and module.
fn entry(key: &str, spirv: &[u8]) -> Vec<u8> {
    let hash = bytes_hash(&[key.as_bytes(), spirv].concat());
    [format!("{MAGIC} {hash}\n").as_bytes(), spirv].concat()
}

/// The module of an entry, where the entry is whole.
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
        let take = |name: &str, text: &str, options: &Options| {
            compile_once_in(folder, &Source::from_text(name, text).unwrap(), options).unwrap()
        };
        let first = take("a.wgsl", SHADER, &Options::default());
        assert_eq!(entries(folder).len(), 1);
        assert_eq!(take("a.wgsl", SHADER, &Options::default()), first);
        assert_eq!(entries(folder).len(), 1);
        take("a.wgsl", &format!("{SHADER}// more\n"), &Options::default());
        take("b.wgsl", SHADER, &Options::default());
        take("a.wgsl", SHADER, &Options::from_flags(["-g"]).unwrap());
        assert_eq!(entries(folder).len(), 4);
    }

    #[test]
    fn what_is_taken_comes_from_the_disk_and_a_broken_entry_is_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let source = Source::from_text("a.wgsl", SHADER).unwrap();
        let take = || compile_once_in(folder.path(), &source, &Options::default()).unwrap();
        let module = take();
        let path = entries(folder.path()).remove(0);
        let key = path.file_name().unwrap().to_str().unwrap().to_owned();
        // A whole entry is believed: the compiler does not run.
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
        // An entry under another's name.
        fs::write(&path, entry("another", &module)).unwrap();
        assert_eq!(take(), module);
    }

    #[test]
    fn many_at_once_get_the_same_module() {
        let folder = tempfile::tempdir().unwrap();
        let modules: Vec<_> = std::thread::scope(|scope| {
            let take = || {
                let source = Source::from_text("a.wgsl", SHADER).unwrap();
                compile_once_in(folder.path(), &source, &Options::default()).unwrap()
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
        assert!(compile_once_in(&file, &source, &Options::default()).is_ok());
        let wrong = Source::from_text("a.wgsl", "fn main() -> f32 {}").unwrap();
        for _ in 0..2 {
            let error = compile_once_in(folder.path(), &wrong, &Options::default()).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidSource);
        }
    }
}
