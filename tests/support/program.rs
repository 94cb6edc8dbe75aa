//! The program `anyhit` as a process.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// How a run ended, and what it printed.
#[derive(Debug)]
pub struct Ran {
    pub code: Option<i32>,
    pub out: String,
    pub err: String,
}

/// Runs the program in the repository's root.
pub fn anyhit(arguments: &[&str]) -> Ran {
    anyhit_with(arguments, &[])
}

/// Runs the program with variables of its environment.
pub fn anyhit_with(arguments: &[&str], variables: &[(&str, &str)]) -> Ran {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).envs(variables.iter().copied());
    ran(command)
}

/// Runs a command in the repository's root, without what CI engines set.
pub fn ran(mut command: Command) -> Ran {
    command.current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command.env_remove("GITHUB_WORKSPACE");
    let output = command.output().expect("the command starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    Ran { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// An empty folder of a test's own.
pub fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a writable folder");
    folder
}

/// The path of a file in a folder, as an argument.
pub fn at(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().expect("UTF-8").to_owned()
}
