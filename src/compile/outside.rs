//! External compilers: finds the programs and runs them.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::UNIX_EPOCH;

use super::Source;
use crate::atomic_file::{self, FolderGuard};
use crate::error::{Error, ErrorKind, Result};

/// An installed compiler.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Tool {
    /// Its program.
    pub(super) path: PathBuf,
}

impl Tool {
    /// What an environment variable names, else the first of these names on the `PATH`.
    pub(super) fn find(variable: &str, names: &[&str]) -> Result<Self> {
        let missing = |what: String| Error::new(ErrorKind::UnsupportedTool, what);
        if let Some(given) = env::var_os(variable).filter(|given| !given.is_empty()) {
            let shown = given.to_string_lossy().into_owned();
            let found = program(Path::new(&given));
            return found.map(|path| Self { path }).ok_or_else(|| {
                missing(format!("the environment variable {variable} names no program: `{shown}`"))
            });
        }
        let found = names.iter().find_map(|name| program(Path::new(name)));
        found.map(|path| Self { path }).ok_or_else(|| {
            let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
            missing(format!("no compiler {} is installed", names.join(", ")))
        })
    }

    /// The name of its program without an extension.
    pub(super) fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The first line that it answers to a question for its version.
    pub(super) fn version(&self, arguments: &[&str]) -> Result<String> {
        let output = run(Command::new(&self.path).args(arguments))?;
        Ok(said(&output).trim().lines().next().unwrap_or("of unknown version").to_owned())
    }

    /// What distinguishes one build of it from another without running it: path, size and time of
    /// the program, and of the libraries beside it and in the `lib` next to its folder.
    ///
    /// Asking the program for its version would be slower than reading a compiled module.
    pub(super) fn identity(&self) -> String {
        let path = fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone());
        let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        let mut files = vec![path];
        for folder in [folder.clone(), folder.join("../lib")] {
            let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
            files.extend(entries.filter(|path| {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                ["slang", "glslang", "shaderc"].iter().any(|part| name.contains(part)) && path.is_file()
            }));
        }
        files.sort();
        files.dedup();
        let words = files.iter().map(|path| {
            let data = fs::metadata(path).ok();
            let size = data.as_ref().map_or(0, fs::Metadata::len);
            let time = data.and_then(|data| data.modified().ok());
            let time = time.and_then(|time| time.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
            format!("{} {size} {}", path.display(), time.as_nanos())
        });
        words.collect::<Vec<_>>().join("\n")
    }
}

/// A program by its path, or by its name on the `PATH`.
fn program(name: &Path) -> Option<PathBuf> {
    let spelt = |path: PathBuf| {
        let with_suffix = path.with_extension(env::consts::EXE_EXTENSION);
        [path, with_suffix].into_iter().find(|path| path.is_file())
    };
    if name.components().count() > 1 {
        // Absolute, because it is run in the folder of the source.
        return spelt(name.to_owned()).and_then(|path| std::path::absolute(path).ok());
    }
    env::split_paths(&env::var_os("PATH")?).find_map(|folder| spelt(folder.join(name)))
}

/// The place of one run: the folder of a source, and one for what comes out, removed afterwards.
pub(super) struct Desk {
    work: tempfile::TempDir,
    _guard: FolderGuard,
    folder: PathBuf,
}

impl Desk {
    /// Makes ready to compile a source. A source in memory is written out, so that one path serves
    /// both kinds.
    pub(super) fn new(source: &Source) -> Result<Self> {
        let work = tempfile::Builder::new().prefix("anyhit-").tempdir();
        let work = work.map_err(|error| Error::io(env::temp_dir(), error))?;
        let guard = FolderGuard::new(work.path());
        let mut folder = work.path().to_owned();
        if source.on_disk() {
            let own = source.folder();
            folder = if own.as_os_str().is_empty() { PathBuf::from(".") } else { own.to_owned() };
        } else {
            let path = folder.join(source.name());
            let parent = path.parent().unwrap_or(&folder);
            fs::create_dir_all(parent).map_err(|error| Error::io(parent, error))?;
            atomic_file::write_unsynced(&path, source.text().as_bytes())?;
        }
        let folder = fs::canonicalize(&folder).map_err(|error| Error::io(&folder, error))?;
        Ok(Self { work, _guard: guard, folder: plain(&folder) })
    }

    /// Where names of files start from.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Where the module is to be written.
    pub(super) fn output(&self) -> PathBuf {
        self.work.path().join("out.spv")
    }

    /// Runs a compiler in the source's folder.
    pub(super) fn run(&self, command: &mut Command) -> Result<Output> {
        run(command.current_dir(&self.folder))
    }

    /// The module that a compiler wrote; without one, the error holds what the compiler printed.
    pub(super) fn module(&self, said: String) -> Result<Vec<u8>> {
        fs::read(self.output()).map_err(|error| Error::io(self.output(), error).note(said))
    }
}

/// All that a compiler printed.
pub(super) fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout)
}

fn run(command: &mut Command) -> Result<Output> {
    command.output().map_err(|error| {
        let name = command.get_program().to_string_lossy().into_owned();
        Error::new(ErrorKind::UnsupportedTool, format!("cannot run the compiler `{name}`: {error}"))
    })
}

/// Windows' canonical paths begin with `\\?\`, which compilers do not take.
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
    fn a_missing_tool_is_told_by_all_its_names() {
        let error = Tool::find("ANYHIT_NO_SUCH_VARIABLE", &["no-such-slangc", "nor-this"]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::UnsupportedTool);
        assert_eq!(error.message(), "no compiler `no-such-slangc`, `nor-this` is installed");
    }

    #[cfg(unix)]
    #[test]
    fn a_tool_is_found_and_another_build_of_it_is_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("glslc");
        fs::write(&path, "one").unwrap();
        let tool = Tool { path: program(&path).unwrap() };
        assert_eq!(tool.name(), "glslc");
        let before = tool.identity();
        assert_eq!(tool.identity(), before);
        fs::write(&path, "another").unwrap();
        assert_ne!(tool.identity(), before);
    }
}
