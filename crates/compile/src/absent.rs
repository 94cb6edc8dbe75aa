//! Stand-ins for the compilers that are installed and for the cache, which this build leaves out:
//! GLSL, Slang and HLSL are an error, and what is built in compiles each time.

use super::{CompileOptions, Compiled, Source};
use anyhit_base::error::{Error, ErrorKind, Result, feature_note};

/// The error that sources of a language cannot be compiled.
fn missing<T>(language: &str) -> Result<T> {
    let text = format!("this build of anyhit cannot compile {language}");
    let error = Error::new(ErrorKind::UnsupportedTool, text);
    Err(error.note(feature_note("compilers") + ", which runs installed compilers"))
}

pub(super) mod cache {
    use super::*;
    use crate::compile_with_warnings;

    /// Compiles as [`Source::compile`] does.
    ///
    /// # Errors
    /// As [`Source::compile`].
    pub fn compile_once(source: &Source, options: &CompileOptions) -> Result<Vec<u8>> {
        source.compile(options)
    }

    /// Compiles as [`compile_once`] does, and keeps what the compiler warned of.
    ///
    /// # Errors
    /// As [`Source::compile`].
    pub fn compile_once_with_warnings(source: &Source, options: &CompileOptions) -> Result<Compiled> {
        compile_with_warnings(source, options)
    }
}

pub(super) mod glslang_tool {
    use super::*;
    use anyhit_base::error::Stage;

    pub(crate) fn compile(_: &Source, _: Stage, _: &CompileOptions) -> Result<Compiled> {
        missing("GLSL")
    }

    pub(crate) fn version() -> Result<String> {
        missing("GLSL")
    }
}

pub(super) mod slang {
    use super::*;

    pub(crate) fn compile(_: &Source, _: &CompileOptions) -> Result<Compiled> {
        missing("Slang and HLSL")
    }

    pub(crate) fn version() -> Result<String> {
        missing("Slang and HLSL")
    }
}
