//! A shader's source: its text, its language, and the files that it includes.

#[cfg(feature = "compilers")]
pub(super) mod hash;
#[cfg(feature = "compilers")]
mod tools;

use std::fmt;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use super::language::{Language, unknown_language};
use anyhit_base::error::{Error, ErrorClass, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, RootFolder, is_stream, read_argument, read_regular};
use anyhit_base::sorted::SortedMap;

/// A shader's source text and where it came from.
#[derive(Clone, PartialEq, Eq)]
#[must_use]
pub struct Source {
    folder: PathBuf,
    name: String,
    text: Arc<str>,
    language: Language,
    is_file: bool,
    include_folders: Vec<PathBuf>,
    limits: InputLimits,
    root: Option<RootFolder>,
}

impl Source {
    /// Reads a source file. Its name, in messages and debug information, is the path as given.
    ///
    /// # Errors
    /// As [`Source::read_in`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        Self::read_in(Path::new(""), &path.as_ref().to_string_lossy())
    }

    /// Reads the source file `name` (with `/` between folders) relative to a folder. Only the name
    /// reaches messages and debug information, so that these are the same on every machine.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] where the file cannot be read, [`ErrorKind::InvalidSource`] where it is
    /// not UTF-8, and [`ErrorKind::InvalidArgument`] where its extension is of no language.
    pub fn read_in(folder: &Path, name: &str) -> Result<Self> {
        Self::read_within(folder, name, &InputLimits::default())
    }

    /// Reads a source file as [`Source::read_in`] does, with another limit of its bytes and those
    /// of the files that it includes. It may be a pipe, whose includes start at the current folder.
    ///
    /// # Errors
    /// As [`Source::read_in`].
    #[doc(hidden)]
    pub fn read_within(folder: &Path, name: &str, limits: &InputLimits) -> Result<Self> {
        let language = Language::of(Path::new(name)).ok_or_else(|| unknown_language(name))?;
        Self::read_as(language, folder, name, limits)
    }

    /// Reads a source file as [`Source::read_within`] does, in a language that its name need not
    /// say.
    ///
    /// # Errors
    /// As [`Source::read_in`].
    pub fn read_as(language: Language, folder: &Path, name: &str, limits: &InputLimits) -> Result<Self> {
        let path = folder.join(name);
        // What comes out of a pipe is gone: an outside tool is given the text.
        let is_file = !is_stream(&path);
        let text = read_text(&path, limits)?;
        let folder = if is_file { folder.into() } else { PathBuf::new() };
        Ok(Self { folder, is_file, limits: *limits, ..Self::new(name, text, language) })
    }

    fn new(name: impl Into<String>, text: impl Into<Arc<str>>, language: Language) -> Self {
        Self {
            folder: PathBuf::new(),
            name: name.into(),
            text: text.into(),
            language,
            is_file: false,
            include_folders: Vec::new(),
            limits: InputLimits::default(),
            root: None,
        }
    }

    /// The text that a file of the current folder holds, read already, or that replaces it; its
    /// includes are looked up beside it.
    #[doc(hidden)]
    pub fn of_file(language: Language, name: String, text: &str) -> Self {
        Self { is_file: true, ..Self::new(name, text, language) }
    }

    /// The source that the bytes of a file are, read already.
    ///
    /// # Errors
    /// As [`Source::read`].
    #[doc(hidden)]
    pub fn from_bytes(language: Language, path: &Path, bytes: Vec<u8>) -> Result<Self> {
        let text = text_of(path, bytes)?;
        let file = Self::of_file(language, path.to_string_lossy().into_owned(), &text);
        Ok(Self { is_file: !is_stream(path), ..file })
    }

    /// With these limits, and with includes from this folder alone where one is given.
    #[doc(hidden)]
    #[must_use]
    pub fn confined(mut self, limits: InputLimits, root: Option<RootFolder>) -> Self {
        (self.limits, self.root) = (limits, root);
        self
    }

    /// A source from memory; its includes are looked up in the current folder.
    ///
    /// # Errors
    /// [`ErrorKind::InvalidArgument`] where the name's extension is of no language.
    pub fn from_text(name: impl Into<String>, text: impl Into<Arc<str>>) -> Result<Self> {
        let name = name.into();
        let language = Language::of(Path::new(&name)).ok_or_else(|| unknown_language(&name))?;
        Ok(Self::new(name, text, language))
    }

    /// A source from memory as [`Source::from_text`] makes it, in a language that its name need not
    /// say.
    ///
    /// ```
    /// use anyhit::{Language, Source, Stage};
    ///
    /// let language = Language::Glsl(Stage::Miss);
    /// let source = Source::from_text_as(language, "sky.glsl", "void main() {}");
    /// assert_eq!(source.language(), language);
    /// ```
    #[must_use]
    pub fn from_text_as(language: Language, name: impl Into<String>, text: impl Into<Arc<str>>) -> Self {
        Self::new(name, text, language)
    }

    /// Adds folders where included files are looked for, in their order, after the including file's
    /// own; relative ones start where the source's name does. WGSL includes nothing.
    #[must_use]
    pub fn include_folders<P: Into<PathBuf>>(mut self, folders: impl IntoIterator<Item = P>) -> Self {
        self.include_folders.extend(folders.into_iter().map(Into::into));
        self
    }

    /// The name in messages and debug information.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The text.
    #[must_use]
    pub fn text(&self) -> &Arc<str> {
        &self.text
    }

    /// The language, and with GLSL the stage.
    #[must_use]
    pub fn language(&self) -> Language {
        self.language
    }

    /// The limits of what is read for it and made of it.
    #[doc(hidden)]
    pub fn limits(&self) -> &InputLimits {
        &self.limits
    }

    /// The normalized name and the text of an included file. `includer` is the name of the
    /// including file.
    pub(super) fn include(&self, includer: &str, header: &str) -> Option<(String, String)> {
        let parent = Path::new(includer).parent().unwrap_or(Path::new(""));
        let folders = std::iter::once(parent).chain(self.include_folders.iter().map(PathBuf::as_path));
        folders.map(|folder| normalized_path(&folder.join(header))).find_map(|name| {
            let path = self.folder.join(&name);
            let bytes = read_regular(&path, self.root.as_ref(), InputLimit::SourceBytes, &self.limits);
            Some((name, String::from_utf8(bytes.ok()?).ok()?))
        })
    }

    /// Refuses what may not be included, before a compiler opens it by itself: a file outside the
    /// root, a pipe or device, one that is too large. Of what a macro names nothing is known here.
    ///
    /// # Errors
    /// `InvalidSource` that says why, and which file includes it.
    pub(super) fn check_includes(&self) -> Result<()> {
        for (includer, text) in self.closure() {
            let parent = Path::new(&includer).parent().unwrap_or(Path::new("")).to_path_buf();
            for header in included_files(&text) {
                let folders = std::iter::once(&parent).chain(&self.include_folders);
                let found = folders.map(|folder| self.folder.join(normalized_path(&folder.join(&header))));
                let Some(path) = found.into_iter().find(|path| path.exists() && !path.is_dir()) else {
                    continue;
                };
                let limit = InputLimit::SourceBytes;
                if let Err(error) = read_regular(&path, self.root.as_ref(), limit, &self.limits) {
                    let message =
                        format!("{includer} includes a file that must not be read: {}", error.message());
                    let refused = Error::new(ErrorKind::InvalidSource, message);
                    let refused =
                        if error.class() == ErrorClass::Limit { refused.of_limit() } else { refused };
                    return Err(error.notes().iter().fold(refused, |refused, note| refused.note(note)));
                }
            }
        }
        Ok(())
    }

    /// Everything that the result depends on: this text and, by name, the text of each file that an
    /// `#include`, `import` or `__include` reaches, even in a false conditional. Files that
    /// are not found are skipped: the compiler's own modules, or names that macros make.
    pub(super) fn closure(&self) -> SortedMap<String, Arc<str>> {
        let mut seen = SortedMap::from([(normalized_path(Path::new(&self.name)), self.text.clone())]);
        let mut pending = vec![normalized_path(Path::new(&self.name))];
        while let Some(includer) = pending.pop() {
            let text = seen[&includer].clone();
            for header in included_files(&text) {
                if let Some((name, text)) = self.include(&includer, &header)
                    && !seen.contains_key(&name)
                {
                    seen.insert(name.clone(), text.into());
                    pending.push(name);
                }
            }
        }
        seen
    }
}

/// Prints name and language only; the text would hide the message of a failing test.
impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Source({}, {:?})", self.name, self.language)
    }
}

/// The files that a text includes, relative to the file with the text: those of `#include` lines,
/// and what Slang's `import` and `__include` may name.
fn included_files(text: &str) -> Vec<String> {
    let lines = text.lines().filter_map(|line| {
        let rest = include_operand(line)?;
        let close = match rest.chars().next()? {
            '"' => '"',
            '<' => '>',
            _ => return None,
        };
        Some(rest[1..].split_once(close)?.0.to_owned())
    });
    let statements = text.split(';').filter_map(|statement| {
        let words: Vec<&str> = statement.split_whitespace().collect();
        let [.., "import" | "__include", name] = words[..] else { return None };
        let name = name.trim_matches('"');
        Some(if name.ends_with(".slang") { name.into() } else { format!("{}.slang", name.replace('.', "/")) })
    });
    // Slang also looks for a file with hyphens in place of the underscores of a module's name.
    let named = |name: String| [name.replace('_', "-"), name];
    let mut files: Vec<String> = lines.chain(statements.flat_map(named)).collect();
    files.dedup();
    files
}

/// True if a text includes a file that only a preprocessor can name: `#include NAME`.
#[cfg(any(feature = "compilers", test))]
fn has_computed_include(text: &str) -> bool {
    text.lines().filter_map(include_operand).any(|operand| !operand.starts_with(['"', '<']))
}

/// What follows `#include` on a line.
fn include_operand(line: &str) -> Option<&str> {
    let rest = line.trim_start().strip_prefix('#')?.trim_start();
    Some(rest.strip_prefix("include")?.trim_start())
}

/// A path without `.` and, where possible, `..`, with `/` between folders on every machine.
fn normalized_path(path: &Path) -> String {
    let mut parts: Vec<String> = Vec::new();
    let mut root = "";
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::RootDir => root = "/",
            Component::ParentDir if parts.last().is_some_and(|last| last != "..") => {
                parts.pop();
            }
            other => parts.push(other.as_os_str().to_string_lossy().into_owned()),
        }
    }
    format!("{root}{}", parts.join("/"))
}

fn read_text(path: &Path, limits: &InputLimits) -> Result<String> {
    text_of(path, read_argument(path, InputLimit::SourceBytes, limits)?)
}

fn text_of(path: &Path, bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        let text = format!("{}: not UTF-8 from byte {offset} on", escape::path(&path));
        Error::new(ErrorKind::InvalidSource, text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_that_include() {
        assert_eq!(included_files("#include \"a/b.glsl\" // c"), ["a/b.glsl"]);
        assert_eq!(included_files("x;\n  #  include <b.glsl>\ny;"), ["b.glsl"]);
        assert_eq!(included_files("import lighting.sky;"), ["lighting/sky.slang"]);
        assert_eq!(included_files("__include \"part.slang\";"), ["part.slang"]);
        // Any white space, other words before it, and several in one line.
        let imports = included_files("__exported import\n a;\timport\tb ;");
        assert_eq!(imports, ["a.slang", "b.slang"]);
        assert_eq!(included_files("import two_words;"), ["two-words.slang", "two_words.slang"]);
        for none in ["// #include \"a\"", "#include NAME", "important = 1;", "int import = a;"] {
            assert!(included_files(none).is_empty(), "{none}");
        }
        assert!(has_computed_include("a;\n # include NAME\n"));
        assert!(!has_computed_include("#include \"a\"\n#include <b>\n// #include NAME\n"));
    }

    #[test]
    fn paths_lose_their_dots() {
        assert_eq!(normalized_path(Path::new("a/./b/../c.glsl")), "a/c.glsl");
        assert_eq!(normalized_path(Path::new("../a.glsl")), "../a.glsl");
        assert_eq!(normalized_path(Path::new("/a/b")), "/a/b");
    }

    #[test]
    fn include_folders_are_searched_after_the_file_s_own() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["own", "first", "second"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
        }
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("own/a.rmiss", "#include \"b.glsl\"\n#include <c.glsl>\n");
        write("second/b.glsl", "second");
        write("second/c.glsl", "second");
        let source = Source::read_in(folder.path(), "own/a.rmiss").unwrap();
        let found = |source: &Source, header| source.include("own/a.rmiss", header);
        assert_eq!(found(&source, "b.glsl"), None);
        let source = source.include_folders(["first", "second"]);
        let hash = source.content_hash();
        assert_eq!(found(&source, "c.glsl"), Some(("second/c.glsl".into(), "second".into())));
        write("first/b.glsl", "first");
        assert_eq!(found(&source, "b.glsl"), Some(("first/b.glsl".into(), "first".into())));
        let other = source.content_hash();
        assert_ne!(other, hash, "a file that comes before another");
        write("own/b.glsl", "own");
        assert_eq!(found(&source, "b.glsl"), Some(("own/b.glsl".into(), "own".into())));
        assert_ne!(source.content_hash(), other);
    }

    #[cfg(unix)]
    #[test]
    fn includes_are_regular_files_inside_the_root() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        for name in ["own", "folder"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
        }
        write("secret.glsl", "secret");
        write("own/a.rmiss", "#include \"b.glsl\"\n");
        std::os::unix::fs::symlink("../secret.glsl", folder.path().join("own/link.glsl")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", folder.path().join("own/zero.glsl")).unwrap();
        let limits = InputLimits::default();
        let root = || Some(RootFolder::new(&folder.path().join("own")).unwrap());
        let refused = |included: &str, root: Option<RootFolder>| {
            write("own/b.glsl", &format!("#include \"{included}\"\n"));
            let source = Source::read_in(folder.path(), "own/a.rmiss").unwrap().confined(limits, root);
            let found = source.include("own/b.glsl", included).is_some();
            (found, source.check_includes().err().map(|error| error.to_string()))
        };
        for included in ["../secret.glsl", "link.glsl"] {
            assert_eq!(refused(included, None), (true, None), "{included}");
            let (found, error) = refused(included, root());
            let error = error.expect("an error");
            assert!(!found && error.contains("own/b.glsl includes a file that must not be read"), "{error}");
            assert!(error.contains("outside the folder") && error.contains("--root"), "{error}");
        }
        let (found, error) = refused("zero.glsl", None);
        assert!(!found && error.expect("an error").contains("a device, not a regular file"));
        // What is not there is for the compiler to report, and a folder is no source.
        assert_eq!(refused("gone.glsl", root()), (false, None));
        assert_eq!(refused("../folder", None), (false, None));
    }
}
