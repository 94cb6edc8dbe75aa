//! Slang through the tool `slangc`, where it is installed.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicU32, Ordering};

use super::{DebugInfo, Optimize, Options, Source, message};
use crate::error::{Error, ErrorKind, Result};

/// Compiles all entry points of a source into one module, each under its own name.
pub(super) fn compile(source: &Source, options: &Options) -> Result<Vec<u8>> {
    let work = Workspace::new()?;
    let output = work.0.join("out.spv");
    // A source in memory is written out, so that one path serves both kinds.
    let folder = if source.on_disk() { source.folder().to_owned() } else { work.0.clone() };
    if !source.on_disk() {
        let path = folder.join(source.name());
        let parent = path.parent().unwrap_or(&folder);
        fs::create_dir_all(parent).map_err(|error| Error::io(parent, error))?;
        fs::write(&path, source.text().as_bytes()).map_err(|error| Error::io(&path, error))?;
    }
    let mut command = Command::new(slangc());
    if !folder.as_os_str().is_empty() {
        command.current_dir(&folder);
    }
    command.arg(source.name()).arg("-o").arg(&output);
    command.args(["-target", "spirv", "-fvk-use-entrypoint-name"]);
    match options.debug {
        DebugInfo::Names => {}
        DebugInfo::Lines | DebugInfo::Full => {
            command.arg("-g2");
        }
    }
    match options.optimize {
        Optimize::Default => {}
        Optimize::Off => {
            command.arg("-O0");
        }
        Optimize::High => {
            command.arg("-O2");
        }
    }
    let result = run(&mut command)?;
    let said =
        String::from_utf8_lossy(&result.stderr).into_owned() + &String::from_utf8_lossy(&result.stdout);
    if !result.status.success() {
        return Err(message::error(source, message::slangc(&said), &said));
    }
    let spirv = fs::read(&output).map_err(|error| Error::io(&output, error).note(said))?;
    let folder = if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder };
    let folder = fs::canonicalize(&folder).map_err(|error| Error::io(&folder, error))?;
    Ok(without_machine_paths(&spirv, &plain(&folder)))
}

/// The module with file names relative to a folder. slangc's debug information holds absolute ones,
/// and its own folder among the arguments of each compilation unit: the module would differ from one
/// machine to the next.
fn without_machine_paths(spirv: &[u8], folder: &Path) -> Vec<u8> {
    const HEADER: usize = 5;
    const OP_STRING: u32 = 7;
    let words: Vec<u32> =
        spirv.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
    let mut folder = folder.to_string_lossy().into_owned();
    folder.push(std::path::MAIN_SEPARATOR);
    let mut out = words[..HEADER.min(words.len())].to_vec();
    let mut left = &words[out.len()..];
    while let Some(&first) = left.first() {
        let length = ((first >> 16) as usize).clamp(1, left.len());
        let (instruction, rest) = left.split_at(length);
        left = rest;
        if first & 0xFFFF != OP_STRING || length < 3 {
            out.extend(instruction);
            continue;
        }
        let bytes: Vec<u8> = instruction[2..].iter().flat_map(|word| word.to_le_bytes()).collect();
        let text = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
        let text = without_include_folders(&String::from_utf8_lossy(text).replace(&folder, ""));
        let mut bytes = text.into_bytes();
        // A literal ends with a zero byte and fills its last word with more of them.
        bytes.resize(bytes.len() / 4 * 4 + 4, 0);
        let literal =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        out.push((2 + literal.len() as u32) << 16 | OP_STRING);
        out.push(instruction[1]);
        out.extend(literal);
    }
    out.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Arguments of slangc without ` -I "FOLDER"`. Other text, source text among it, stays.
fn without_include_folders(text: &str) -> String {
    const OPEN: &str = " -I \"";
    if !text.starts_with("-target ") {
        return text.to_owned();
    }
    let mut out = text.to_owned();
    while let Some(start) = out.find(OPEN)
        && let Some(length) = out[start + OPEN.len()..].find('"')
    {
        out.replace_range(start..start + OPEN.len() + length + 1, "");
    }
    out
}

/// `slangc` and its version.
pub(super) fn version() -> Result<String> {
    let output = run(Command::new(slangc()).arg("-v"))?;
    // Some versions answer on standard error.
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    Ok(format!("slangc {}", said.trim().lines().next().unwrap_or("of unknown version")))
}

/// The tool: what the environment variable `SLANGC` names, else `slangc` on the `PATH`.
fn slangc() -> OsString {
    env::var_os("SLANGC").unwrap_or_else(|| "slangc".into())
}

fn run(command: &mut Command) -> Result<Output> {
    command.output().map_err(|error| {
        let name = command.get_program().to_string_lossy().into_owned();
        Error::new(ErrorKind::UnsupportedTool, format!("cannot run the Slang compiler `{name}`: {error}"))
            .note("`pip install slangtorch` ships it, in the folder slangtorch/bin")
            .note("put it on the PATH, or name it in the environment variable SLANGC")
    })
}

/// A folder for one run, removed afterwards.
struct Workspace(PathBuf);

impl Workspace {
    fn new() -> Result<Self> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = env::temp_dir().join(format!("anyhit-slang-{}-{number}", std::process::id()));
        fs::create_dir_all(&path).map_err(|error| Error::io(&path, error))?;
        let path = fs::canonicalize(&path).map_err(|error| Error::io(&path, error))?;
        Ok(Self(plain(&path)))
    }
}

impl Drop for Workspace {
    fn drop(&mut self) {
        // Left behind at worst: the system's own cleaning takes it.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Windows' canonical paths begin with `\\?\`, which slangc does not take.
fn plain(path: &Path) -> PathBuf {
    match path.to_str().and_then(|text| text.strip_prefix(r"\\?\")) {
        Some(text) => text.into(),
        None => path.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn debug_information_loses_the_paths_of_the_machine() {
        // Header, then OpString %1 "/f/a.s" (6 bytes, a zero, one more zero), then OpNop.
        let words = [0x0723_0203, 0x10600, 0, 2, 0, 4 << 16 | 7, 1, 0x612F_662F, 0x0000_732E, 1 << 16];
        let spirv: Vec<u8> = words.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        let fixed = without_machine_paths(&spirv, Path::new("/f"));
        let expected = [0x0723_0203, 0x10600, 0, 2, 0, 3 << 16 | 7, 1, 0x0073_2E61, 1 << 16];
        let expected: Vec<u8> = expected.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        if cfg!(unix) {
            assert_eq!(fixed, expected);
        }
        let arguments = "-target spirv  -I \"/opt/bin\" -g2 -I \"/x\" -entry a";
        assert_eq!(without_include_folders(arguments), "-target spirv  -g2 -entry a");
    }

    #[test]
    fn a_missing_tool_says_how_to_get_it() {
        let error = run(&mut Command::new("/no/such/folder/slangc")).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::UnsupportedTool);
        assert!(error.render().contains("pip install slangtorch"), "{error:?}");
    }
}
