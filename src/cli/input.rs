//! What the command line says about reading: limits of what is read and of what it may ask for, and
//! the folder that a scene may not leave.

use std::path::{Path, PathBuf};

use clap::Args;

use anyhit_base::error::Result;
use anyhit_base::input::limits::LimitSetting;
use anyhit_base::input::{InputLimit, InputLimits, RootFolder, STANDARD_INPUT, is_stream, read_argument};
use anyhit_scene::{LoadOptions, ResolvedScene, SceneFiles, load_bytes};

/// Limits of what is read and of what it may ask for.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct InputLimitArgs {
    /// Set a limit on input, such as `file-bytes=4GiB`; may be repeated (docs/reading.md lists all
    /// limits)
    #[arg(long, value_name = "NAME=N")]
    limit: Vec<LimitSetting>,
}

impl InputLimitArgs {
    /// The default limits with those that were given.
    pub(super) fn limits(&self) -> InputLimits {
        let set = |limits: InputLimits, one: &LimitSetting| limits.with(one.limit, one.value);
        self.limit.iter().fold(InputLimits::default(), set)
    }
}

/// How strictly modules are judged.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(super) struct StrictArgs {
    /// Reject a module that uses an undeclared capability or extension, instead of warning
    #[arg(long)]
    strict: bool,
}

impl StrictArgs {
    pub(super) fn is_set(self) -> bool {
        self.strict
    }
}

/// Which variant of a scene is meant.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct VariantArgs {
    /// Use the shaders of the scene's `[[variant]]` of this name
    #[arg(long, value_name = "NAME")]
    pub variant: Option<String>,
}

/// Limits of what is read and of what it may ask for, and where a scene may read.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct SceneFileArgs {
    /// Reject every path in a scene that leaves this folder, after following links
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    #[command(flatten)]
    limits: InputLimitArgs,
    #[command(flatten)]
    strict: StrictArgs,
    /// Read every file that the scene names, including those that nothing reads
    #[arg(long)]
    read_all: bool,
}

impl SceneFileArgs {
    /// Whether a module that lacks a declaration is rejected.
    pub(super) fn strict(&self) -> bool {
        self.strict.is_set()
    }

    /// Whether `--read-all` is given.
    pub(super) fn read_all(&self) -> bool {
        self.read_all
    }

    /// The limits.
    pub(super) fn limits(&self) -> InputLimits {
        self.limits.limits()
    }

    /// The root, where one is given.
    pub(super) fn root(&self) -> Result<Option<RootFolder>> {
        self.root.as_deref().map(RootFolder::new).transpose()
    }

    /// How files are read that a scene names.
    pub(super) fn files(&self) -> Result<SceneFiles> {
        Ok(SceneFiles {
            limits: self.limits(),
            root: self.root()?,
            strict: self.strict.is_set(),
            read_all: self.read_all,
        })
    }

    /// These arguments, with every file that a scene names read where `all` is true.
    pub(super) fn reading_all(&self, all: bool) -> Self {
        Self { read_all: self.read_all || all, ..self.clone() }
    }

    /// Reads a scene from a file, a pipe, or for `-` from standard input. What a pipe's scene names
    /// starts at the current folder.
    pub(super) fn scene(&self, path: &Path, options: &LoadOptions) -> Result<ResolvedScene> {
        let files = self.files()?;
        let bytes = read_argument(path, InputLimit::SceneBytes, &files.limits)?;
        load_bytes(&name_of(path), bytes, &files, options)
    }
}

/// What an argument's file is called in messages: a path that others can be relative to.
pub(super) fn name_of(path: &Path) -> PathBuf {
    if path == Path::new(STANDARD_INPUT) {
        return "standard input".into();
    }
    // `/dev/fd/63`: files beside it are not meant.
    if is_stream(path) {
        path.display().to_string().replace(['/', '\\'], " ").trim().into()
    } else {
        path.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn later_settings_of_a_limit_win() {
        let limit = |text: &str| text.parse::<LimitSetting>().unwrap();
        let args = InputLimitArgs { limit: vec![limit("file-bytes=1"), limit("file-bytes=2KiB")] };
        assert_eq!(args.limits().get(InputLimit::FileBytes), 2048);
        assert_eq!(args.limits().get(InputLimit::SceneFiles), 64);
    }

    #[test]
    fn what_is_read_from_a_stream_has_no_folder() {
        assert_eq!(name_of(Path::new("-")), Path::new("standard input"));
        assert_eq!(name_of(Path::new("a/b.toml")), Path::new("a/b.toml"));
        #[cfg(unix)]
        assert_eq!(name_of(Path::new("/dev/null")).parent(), Some(Path::new("")));
    }
}
