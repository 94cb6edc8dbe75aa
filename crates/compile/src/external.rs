//! External compilers: finds the programs and runs them.

use std::env;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Output};
use std::time::UNIX_EPOCH;

use super::{CompilerFlags, Source};
use anyhit_base::atomic_file::{self, RemovalGuard};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::sorted::sort;

/// An installed compiler.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Tool {
    /// The path of its program.
    pub(super) path: PathBuf,
}

impl Tool {
    /// Finds the program that an environment variable names, else the first of some names on the
    /// `PATH`.
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

    /// The first line that it prints when it is asked for its version.
    pub(super) fn version(&self, arguments: &[&str]) -> Result<String> {
        let output = run(Command::new(&self.path).args(arguments))?;
        Ok(printed(&output).trim().lines().next().unwrap_or("of unknown version").to_owned())
    }

    /// Identifies a build of the tool without running it: path, size and time of the program, and
    /// of the libraries in its folder and in the `lib` next to it.
    ///
    /// Running the program to get its version would take longer than reading a module from the
    /// cache.
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
        sort(&mut files);
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

/// Finds a program by its path, or by its name on the `PATH`.
fn program(name: &Path) -> Option<PathBuf> {
    let with_or_without_suffix = |path: PathBuf| {
        let with_suffix = path.with_extension(env::consts::EXE_EXTENSION);
        [path, with_suffix].into_iter().find(|path| path.is_file())
    };
    if name.components().count() > 1 {
        // Absolute, because it is run in the folder of the source.
        return with_or_without_suffix(name.to_owned()).and_then(|path| std::path::absolute(path).ok());
    }
    env::split_paths(&env::var_os("PATH")?).find_map(|folder| with_or_without_suffix(folder.join(name)))
}

impl CompilerFlags {
    /// The definitions as an outside compiler takes them: `-DNAME=VALUE`.
    pub(super) fn define_arguments(&self) -> impl Iterator<Item = String> {
        self.defines.iter().map(|(name, value)| match value {
            Some(value) => format!("-D{name}={value}"),
            None => format!("-D{name}"),
        })
    }
}

/// The folders of one compiler run: that of the source, and a temporary one for the output.
pub(super) struct Workspace {
    output_folder: tempfile::TempDir,
    _guard: RemovalGuard,
    folder: PathBuf,
    source_path: PathBuf,
    include_folders: Vec<PathBuf>,
}

impl Workspace {
    /// Prepares to compile a source. A source in memory is written to the temporary folder, so that
    /// compilers always read a file.
    pub(super) fn new(source: &Source) -> Result<Self> {
        let output_folder = tempfile::Builder::new().prefix("anyhit-").tempdir();
        let output_folder = output_folder.map_err(|error| Error::io(env::temp_dir(), error))?;
        let guard = RemovalGuard::new(output_folder.path());
        let mut folder = output_folder.path().to_owned();
        let is_temporary = !source.has_unchanged_file();
        let mut source_path = PathBuf::from(source.name());
        if !is_temporary {
            let own = source.folder();
            folder = if own.as_os_str().is_empty() { PathBuf::from(".") } else { own.to_owned() };
        } else {
            source_path = source.temporary_path();
            let path = folder.join(&source_path);
            let parent = path.parent().unwrap_or(&folder);
            fs::create_dir_all(parent).map_err(|error| Error::io(parent, error))?;
            atomic_file::write_unsynced(&path, source.text().as_bytes())?;
        }
        let folder = fs::canonicalize(&folder).map_err(|error| Error::io(&folder, error))?;
        let folder = without_verbatim_prefix(&folder);
        let include_folders = source.external_include_folders(is_temporary)?;
        Ok(Self { output_folder, _guard: guard, folder, source_path, include_folders })
    }

    /// The folder that names of files are relative to.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The path of the source, relative to the folder.
    pub(super) fn source_path(&self) -> &Path {
        &self.source_path
    }

    /// The folders in which the compiler looks for included files.
    pub(super) fn include_folders(&self) -> &[PathBuf] {
        &self.include_folders
    }

    /// The path to which the compiler writes the module.
    pub(super) fn output(&self) -> PathBuf {
        self.output_folder.path().join("out.spv")
    }

    /// Runs a compiler in the source's folder.
    pub(super) fn run(&self, command: &mut Command) -> Result<Output> {
        run(command.current_dir(&self.folder))
    }

    /// The module that a compiler wrote, which ended without an error, with the source's name in
    /// place of its path; if there is none, the error has what the compiler printed.
    ///
    /// # Errors
    /// `UnsupportedTool` where the file is missing or empty, `Io` where it cannot be read.
    pub(super) fn module(&self, tool: &Tool, source: &Source, printed: &str) -> Result<Vec<u8>> {
        match fs::read(self.output()) {
            Ok(module) if !module.is_empty() => {
                let path = self.folder.join(&self.source_path);
                let is_source = |text: &str| [&path, &self.source_path].contains(&&PathBuf::from(text));
                let name = |text: &str| if is_source(text) { source.name() } else { text }.to_owned();
                Ok(if Path::new(source.name()) == self.source_path {
                    module
                } else {
                    with_strings(&module, name)
                })
            }
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(Error::io(self.output(), error)),
            _ => Err(tool.failed(source, "reported no error but wrote no module", printed)),
        }
    }
}

/// A module with other texts of its `OpString` instructions, which are names of files and sources.
pub(super) fn with_strings(spirv: &[u8], change: impl Fn(&str) -> String) -> Vec<u8> {
    const HEADER: usize = 5;
    const OP_STRING: u32 = 7;
    let words: Vec<u32> =
        spirv.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect();
    let mut out = words[..HEADER.min(words.len())].to_vec();
    let mut remaining = &words[out.len()..];
    while let Some(&first) = remaining.first() {
        let length = ((first >> 16) as usize).clamp(1, remaining.len());
        let (instruction, rest) = remaining.split_at(length);
        remaining = rest;
        if first & 0xFFFF != OP_STRING || length < 3 {
            out.extend(instruction);
            continue;
        }
        let bytes: Vec<u8> = instruction[2..].iter().flat_map(|word| word.to_le_bytes()).collect();
        let text = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
        let mut bytes = change(&String::from_utf8_lossy(text)).into_bytes();
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

impl Tool {
    /// Returns the error of a run that ended in a way that is no verdict on the source: by a
    /// signal, or without a word; `None` where the compiler has said what is wrong.
    pub(super) fn crash(&self, source: &Source, output: &Output) -> Option<Error> {
        let printed = printed(output);
        let ended = if let Some(signal) = signal(output.status) {
            format!("was terminated by signal {signal}")
        } else if !output.status.success() && printed.trim().is_empty() {
            match output.status.code() {
                Some(code) => format!("exited with code {code} and printed nothing"),
                None => "failed and printed nothing".to_owned(),
            }
        } else {
            return None;
        };
        Some(self.failed(source, &ended, &printed))
    }

    fn failed(&self, source: &Source, how: &str, printed: &str) -> Error {
        let message = format!("{}: the compiler `{}` {how}", source.name(), self.name());
        let error = Error::new(ErrorKind::UnsupportedTool, message);
        match printed.trim() {
            "" => error,
            printed => error.note(format!("its output: {printed}")),
        }
    }
}

/// The signal that ended a program, with its name where that is common.
#[cfg(unix)]
fn signal(status: ExitStatus) -> Option<String> {
    use std::os::unix::process::ExitStatusExt;
    const NAMES: [(i32, &str); 9] = [
        (4, "SIGILL"),
        (5, "SIGTRAP"),
        (6, "SIGABRT"),
        (8, "SIGFPE"),
        (9, "SIGKILL"),
        (11, "SIGSEGV"),
        (13, "SIGPIPE"),
        (15, "SIGTERM"),
        (24, "SIGXCPU"),
    ];
    let number = status.signal()?;
    let name = NAMES.iter().find(|(known, _)| *known == number);
    Some(name.map_or_else(|| number.to_string(), |(_, name)| format!("{number} ({name})")))
}

/// Other systems end a program with a code alone.
#[cfg(not(unix))]
fn signal(_: ExitStatus) -> Option<String> {
    None
}

/// Everything that a compiler printed.
pub(super) fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout)
}

fn run(command: &mut Command) -> Result<Output> {
    command.output().map_err(|error| {
        let name = command.get_program().to_string_lossy().into_owned();
        Error::new(ErrorKind::UnsupportedTool, format!("cannot run the compiler `{name}`: {error}"))
    })
}

/// Windows' canonical paths begin with `\\?\`, which compilers do not take.
fn without_verbatim_prefix(path: &Path) -> PathBuf {
    match path.to_str().and_then(|text| text.strip_prefix(r"\\?\")) {
        Some(text) => text.into(),
        None => path.into(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Component;

    use super::*;

    #[test]
    fn a_missing_tool_is_reported_with_all_its_names() {
        let error = Tool::find("ANYHIT_NO_SUCH_VARIABLE", &["no-such-slangc", "nor-this"]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::UnsupportedTool);
        assert_eq!(error.message(), "no compiler `no-such-slangc`, `nor-this` is installed");
    }

    #[test]
    fn a_text_in_memory_stays_inside_the_workspace() {
        let folder = tempfile::tempdir().unwrap();
        let outside = folder.path().join("a.rmiss");
        fs::write(&outside, "a file of the user").unwrap();
        let absolute = outside.to_string_lossy().into_owned();
        for name in [&*absolute, "../../a.rmiss", "./b/../a.rmiss", "a.rmiss"] {
            let source = Source::from_text(name, "void main() {}").unwrap();
            let workspace = Workspace::new(&source).unwrap();
            let path = workspace.folder().join(workspace.source_path());
            assert_eq!(fs::read_to_string(path).unwrap(), "void main() {}", "{name}");
            assert!(workspace.source_path().components().all(|part| matches!(part, Component::Normal(_))));
        }
        assert_eq!(fs::read_to_string(&outside).unwrap(), "a file of the user");
    }

    #[test]
    fn a_file_whose_text_was_replaced_is_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.rmiss"), "on disk").unwrap();
        let source = Source::read_in(folder.path(), "a.rmiss").unwrap();
        let folder_of = |source: &Source| Workspace::new(source).unwrap().folder().to_owned();
        assert_eq!(folder_of(&source), fs::canonicalize(folder.path()).unwrap());
        for text in ["changed", "longer than before"] {
            fs::write(folder.path().join("a.rmiss"), text).unwrap();
            let workspace = Workspace::new(&source).unwrap();
            let path = workspace.folder().join(workspace.source_path());
            assert_eq!(fs::read_to_string(path).unwrap(), "on disk");
        }
    }

    #[test]
    fn strings_of_a_module_are_replaced() {
        // Header, then OpString %1 "abc", then OpNop.
        let words = [0x0723_0203, 0x10600, 0, 2, 0, 3 << 16 | 7, 1, 0x0063_6261, 1 << 16];
        let spirv: Vec<u8> = words.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        let expected = [0x0723_0203, 0x10600, 0, 2, 0, 4 << 16 | 7, 1, 0x6463_6261, 0, 1 << 16];
        let expected: Vec<u8> = expected.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        assert_eq!(with_strings(&spirv, |text| format!("{text}d")), expected);
        assert_eq!(with_strings(&spirv, str::to_owned), spirv);
    }

    #[cfg(unix)]
    #[test]
    fn a_tool_is_found_and_its_builds_are_distinguished() {
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
