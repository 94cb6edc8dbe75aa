//! Structs of the host, read from its source.

use std::fmt;
use std::path::Path;

use crate::host_struct::HostType;
use crate::host_struct::c_declarations::CDeclarations;
use crate::host_struct::rust_source::RustItems;
use crate::host_struct::source_file::SourceFile;
use anyhit_base::error::names::{list_of, nearest};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, file};

/// The structs of a source file: Rust (`.rs`), or C and C++ (any other name).
pub struct HostSource {
    name: String,
    parsed: Parsed,
}

impl fmt::Debug for HostSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HostSource").field("name", &self.name).field("structs", &self.structs()).finish()
    }
}

enum Parsed {
    Rust(RustItems),
    C(CDeclarations),
}

impl HostSource {
    /// Reads and parses a file.
    ///
    /// # Errors
    /// `Io` where it cannot be read; `InvalidSource` where it is not text of its language.
    pub fn read(path: &Path, limits: &InputLimits) -> Result<Self> {
        let bytes = file::read_argument(path, InputLimit::FileBytes, limits)?;
        let name = escape::path(path).to_string();
        let text = String::from_utf8(bytes)
            .map_err(|_| Error::new(ErrorKind::InvalidSource, format!("{name}: the text is not UTF-8")))?;
        let is_rust = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("rs"));
        Self::parse(name, &text, is_rust)
    }

    fn parse(name: String, text: &str, is_rust: bool) -> Result<Self> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let file = SourceFile { name: name.clone(), text: text.into() };
        let parsed = if is_rust {
            Parsed::Rust(RustItems::parse(file)?)
        } else {
            Parsed::C(CDeclarations::parse(file)?)
        };
        Ok(Self { name, parsed })
    }

    /// The file's name as the user gave it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of the structs, in the file's order.
    pub fn structs(&self) -> &[String] {
        match &self.parsed {
            Parsed::Rust(items) => items.structs(),
            Parsed::C(declarations) => declarations.structs(),
        }
    }

    /// Returns the layout of a struct.
    ///
    /// # Errors
    /// `InvalidArgument` where the file declares no such struct; `InvalidSource` where its language
    /// defines no layout for it.
    pub fn layout(&self, name: &str) -> Result<HostType> {
        let structs = || self.structs().iter().map(String::as_str);
        if structs().any(|one| one == name) {
            return match &self.parsed {
                Parsed::Rust(items) => items.layout(name),
                Parsed::C(declarations) => declarations.layout(name),
            };
        }
        let message = format!("{} declares no struct `{name}`", self.name);
        let mut error = Error::new(ErrorKind::InvalidArgument, message);
        if self.structs().is_empty() {
            return Err(error.note("it declares no struct"));
        }
        if let Some(near) = nearest(name, structs()) {
            error = error.note(format!("did you mean `{near}`?"));
        }
        Err(error.note(format!("its structs: {}", list_of(structs()))))
    }

    /// Returns the layout of the struct that belongs to one of a shader: that of the same name, or
    /// the only one of the file.
    ///
    /// # Errors
    /// As [`HostSource::layout`].
    pub fn counterpart(&self, shader_name: &str) -> Result<HostType> {
        match self.structs() {
            [only] if only != shader_name => self.layout(only),
            _ => self.layout(shader_name).map_err(|error| match error.kind() {
                ErrorKind::InvalidArgument => error.note("pass the host's name with `--host-struct NAME`"),
                _ => error,
            }),
        }
    }
}
