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
    }
    let result = run(&mut command)?;
    let said =
        String::from_utf8_lossy(&result.stderr).into_owned() + &String::from_utf8_lossy(&result.stdout);
    if !result.status.success() {
        return Err(message::error(source, message::slangc(&said), &said));
    }
    fs::read(&output).map_err(|error| Error::io(&output, error).note(said))
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
    fn a_missing_tool_says_how_to_get_it() {
        let error = run(&mut Command::new("/no/such/folder/slangc")).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::UnsupportedTool);
        assert!(error.render().contains("pip install slangtorch"), "{error:?}");
    }
}
