//! What is said of a source beside its file: language, stage and entry point, folders and flags.

use std::path::{Path, PathBuf};

use super::language::unknown_language;
use super::{CompileOptions, CompilerFlags, Language, LanguageName, SourceEntryPoint};
use anyhit_base::error::Stage;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;

/// How one source is compiled, checked for its language.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct SourceSettings {
    /// The language; `None` where nothing says it, which is an error of the compilation.
    pub language: Option<Language>,
    /// The one entry point to compile; all of them where there is none.
    pub entry_point: Option<SourceEntryPoint>,
    /// Where its includes are searched, after its own folder.
    pub include_folders: Vec<PathBuf>,
    /// Flags for the compiler.
    pub flags: CompilerFlags,
}

impl SourceSettings {
    /// Those of a file of which only the name is known.
    pub fn of(path: &Path) -> Self {
        Self { language: Language::of(path), ..Self::default() }
    }

    /// The language.
    ///
    /// # Errors
    /// `InvalidArgument` where nothing says it.
    pub fn language(&self, name: &str) -> Result<Language> {
        self.language.ok_or_else(|| unknown_language(name))
    }

    /// These options, with what is said instead.
    #[must_use]
    pub fn over(&self, options: &CompileOptions) -> CompileOptions {
        CompileOptions { entry_point: self.entry_point.clone(), ..self.flags.over(options) }
    }
}

/// What a command line says of the sources that it names, as it is written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceWords {
    /// The language, where extensions do not say it.
    pub language: Option<LanguageName>,
    /// The stage of GLSL, or of the entry point of Slang and HLSL.
    pub stage: Option<Stage>,
    /// The entry point of Slang and HLSL.
    pub entry: Option<String>,
    /// Where includes are searched, relative to the current folder.
    pub include_folders: Vec<PathBuf>,
    /// Flags for the compiler, a word each.
    pub flags: Vec<String>,
}

impl SourceWords {
    /// What is said, for one file; `None` where the file is of no language, as a module is.
    ///
    /// # Errors
    /// `InvalidArgument` for what makes no sense for the language, and for flags that its compiler
    /// is not given.
    pub fn settings(&self, path: &Path) -> Result<Option<SourceSettings>> {
        let invalid =
            |text: String| Error::new(ErrorKind::InvalidArgument, format!("{}: {text}", escape::path(&path)));
        if path.extension().is_some_and(|extension| extension == "spv") {
            return Ok(None);
        }
        let Some(language) = Language::said(self.language, self.stage, path).map_err(invalid)? else {
            return Ok(None);
        };
        if self.entry.is_some() && !language.is_slang_or_hlsl() {
            return Err(invalid("an entry point can be selected only in Slang and HLSL".to_owned()));
        }
        let entry_point = SourceEntryPoint::said(language, self.entry.as_deref(), self.stage);
        let flags = CompilerFlags::of(language, &self.flags);
        let flags = flags.map_err(|error| error.context(escape::path(&path)))?;
        let of_flags = flags.include_folders().iter().map(PathBuf::from);
        let include_folders = self.include_folders.iter().cloned().chain(of_flags).collect();
        Ok(Some(SourceSettings { language: Some(language), entry_point, include_folders, flags }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_become_settings_of_each_file() {
        let words = SourceWords {
            stage: Some(Stage::Miss),
            include_folders: vec!["a".into()],
            flags: vec!["-Ib".into(), "-DX".into()],
            ..SourceWords::default()
        };
        let settings = |path: &str| words.settings(Path::new(path)).unwrap();
        let glsl = settings("a.glsl").unwrap();
        assert_eq!((glsl.language, &glsl.entry_point), (Some(Language::Glsl(Stage::Miss)), &None));
        assert_eq!(glsl.include_folders, ["a", "b"].map(PathBuf::from));
        let slang = settings("a.slang").unwrap();
        let entry = SourceEntryPoint { name: "main".into(), stage: Some(Stage::Miss) };
        assert_eq!(slang.over(&CompileOptions::default()).entry_point, Some(entry));
        assert_eq!(settings("a.spv"), None);
        let wrong = SourceWords { entry: Some("sky".into()), ..SourceWords::default() };
        assert!(
            wrong.settings(Path::new("a.rmiss")).unwrap_err().message().contains("only in Slang and HLSL")
        );
        assert_eq!(wrong.settings(Path::new("a.slang")).unwrap().unwrap().entry_point.unwrap().stage, None);
        let wrong = SourceWords { flags: vec!["-o".into()], ..SourceWords::default() };
        let error = wrong.settings(Path::new("a.slang")).unwrap_err();
        assert!(error.message().starts_with("a.slang: the flag `-o` is not passed on to slangc"), "{error}");
    }
}
