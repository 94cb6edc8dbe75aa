//! Front ends: shader source to SPIR-V.
//!
//! Scenes and tests name `.spv` files, or sources: GLSL (through glslang, built in with the feature
//! `glsl`, else through an installed `glslang`, `glslangValidator` or `glslc`), WGSL (through naga,
//! feature `wgsl`, on by default), Slang and HLSL (through `slangc`, where it is installed).
//! What is installed is found with the feature `compilers`, which also compiles each source once
//! and keeps it in a [`cache`]. This folder also keeps `spirv-fixtures/` in step with `shaders/`.
//!
//! ```
//! use anyhit::{CompileOptions, Source};
//!
//! let source = Source::from_text("double.wgsl", "@group(0) @binding(0) var<storage, read_write> x:
//! array<f32>; @compute @workgroup_size(1) fn double() { x[0] *= 2.0; }")?;
//! # #[cfg(feature = "wgsl")] {
//! let spirv = source.compile(&CompileOptions::default())?;
//! assert_eq!(spirv[..4], [0x03, 0x02, 0x23, 0x07]);
//! # }
//! # Ok::<(), anyhit::Error>(())
//! ```

#[cfg(feature = "compilers")]
pub mod cache;
#[cfg(feature = "compilers")]
mod external;
#[cfg(feature = "fixtures")]
pub mod fixtures;
mod flags;
#[cfg(feature = "compilers")]
mod glslang_tool;
mod language;
#[cfg(feature = "compilers")]
mod message;
mod settings;
#[cfg(feature = "compilers")]
mod slang;
mod source;

#[cfg(not(feature = "compilers"))]
mod absent;
#[cfg(feature = "glsl")]
mod glsl;
#[cfg(feature = "glsl")]
mod glslang_debug;
#[cfg(feature = "wgsl")]
mod wgsl;

#[cfg(not(feature = "compilers"))]
use absent::{cache, glslang_tool, slang};

pub use cache::{compile_once, compile_once_with_warnings};
pub use flags::{CompilerFlags, RefusedFlag};
pub use language::{EXTENSIONS as SOURCE_EXTENSIONS, Language, LanguageName, STAGE_NAMES};
pub use settings::{SourceSettings, SourceWords};
pub use source::Source;
#[cfg(feature = "compilers")]
pub use source::hash::bytes_hash;

use anyhit_base::error::Stage;
use anyhit_base::error::{Error, ErrorKind, Result, Warning};

/// How to compile.
///
/// ```
/// use anyhit::{CompileOptions, DebugInfoLevel, Optimize};
///
/// let options = CompileOptions::default().debug(DebugInfoLevel::Full).optimize(Optimize::Off);
/// assert_eq!(options.debug, DebugInfoLevel::Full);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct CompileOptions {
    /// The debug information about its source that a module holds.
    pub debug: DebugInfoLevel,
    /// Whether the compiler optimises. Only `slangc` does; glslang is built without its optimiser,
    /// and naga has none.
    pub optimize: Optimize,
    /// Definitions, and flags that an outside compiler is given as they are.
    pub flags: CompilerFlags,
    /// With Slang and HLSL the one entry point to compile; all of them where there is none.
    #[doc(hidden)]
    pub entry_point: Option<SourceEntryPoint>,
}

/// An entry point of a Slang or HLSL source.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SourceEntryPoint {
    /// The name of its function.
    pub name: String,
    /// The stage, which a function without `[shader("...")]` needs.
    pub stage: Option<Stage>,
}

impl SourceEntryPoint {
    /// The entry point that is said of a source, which is `main` where only the stage is; `None`
    /// where nothing is said, and in other languages than Slang and HLSL.
    pub fn said(language: Language, name: Option<&str>, stage: Option<Stage>) -> Option<Self> {
        let is_said = language.is_slang_or_hlsl() && (name.is_some() || stage.is_some());
        is_said.then(|| Self { name: name.unwrap_or("main").to_owned(), stage })
    }
}

/// The debug information about its source that a module holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DebugInfoLevel {
    /// Names, as the compiler gives them by default, and no lines.
    #[default]
    Names,
    /// `OpSource` and `OpLine`; with Slang the same as `Full`, as it has no such level.
    Lines,
    /// `NonSemantic.Shader.DebugInfo`: lines, columns, variables, scopes and the source's text.
    /// naga writes `OpLine` at most.
    Full,
}

/// Whether the compiler optimises.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Optimize {
    /// The compiler's default.
    #[default]
    Default,
    /// `-O0`.
    Off,
    /// `-O2`: with slangc, values in registers and phis instead of variables.
    High,
}

impl CompileOptions {
    /// Sets the debug information about its source that the module holds.
    #[must_use]
    pub fn debug(self, debug: DebugInfoLevel) -> Self {
        Self { debug, ..self }
    }

    /// Sets whether the compiler optimises.
    #[must_use]
    pub fn optimize(self, optimize: Optimize) -> Self {
        Self { optimize, ..self }
    }

    /// Sets the flags that an outside compiler is given: see [`CompilerFlags::of`].
    #[must_use]
    pub fn flags(self, flags: CompilerFlags) -> Self {
        Self { flags, ..self }
    }

    /// The options that command line flags stand for: `-g`, `-gVS` (or `-g2`), `-O0`, `-O2`.
    ///
    /// # Errors
    /// [`ErrorKind::InvalidArgument`] for any other flag.
    pub fn from_flags<'a>(flags: impl IntoIterator<Item = &'a str>) -> Result<Self> {
        let mut options = Self::default();
        for flag in flags {
            match flag {
                "-g" => options.debug = DebugInfoLevel::Lines,
                "-gVS" | "-g2" => options.debug = DebugInfoLevel::Full,
                "-O0" => options.optimize = Optimize::Off,
                "-O2" => options.optimize = Optimize::High,
                _ => {
                    let text = format!("unknown compiler flag `{flag}`");
                    return Err(Error::new(ErrorKind::InvalidArgument, text)
                        .note("the flags are -g (lines), -gVS (full debug info), -O0 and -O2"));
                }
            }
        }
        Ok(options)
    }
}

/// A module that was compiled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compiled {
    /// The bytes of a `.spv` file.
    pub spirv: Vec<u8>,
    /// What the compiler warned of, each once.
    pub warnings: Vec<Warning>,
}

impl Source {
    /// Compiles to a SPIR-V module, as the bytes of a `.spv` file.
    ///
    /// GLSL gives SPIR-V 1.6 for Vulkan 1.3 with the entry point `main`; WGSL, Slang and HLSL give
    /// one module with all the entry points of the source under their own names.
    ///
    /// # Errors
    /// [`ErrorKind::InvalidSource`] with the places that the compiler named;
    /// [`ErrorKind::UnsupportedTool`] where this build or machine lacks the compiler;
    /// [`ErrorKind::Io`] where a file cannot be read or written.
    pub fn compile(&self, options: &CompileOptions) -> Result<Vec<u8>> {
        compile_with_warnings(self, options).map(|compiled| compiled.spirv)
    }
}

/// Compiles as [`Source::compile`] does, and keeps what the compiler warned of.
///
/// # Errors
/// As [`Source::compile`].
pub fn compile_with_warnings(source: &Source, options: &CompileOptions) -> Result<Compiled> {
    source.check_includes()?;
    match source.language() {
        Language::Glsl(stage @ Stage::Other(_)) => Err(language::unknown_stage(stage)),
        #[cfg(feature = "glsl")]
        Language::Glsl(stage) if !glslang_tool::is_requested() => glsl::compile(source, stage, options),
        Language::Glsl(stage) => glslang_tool::compile(source, stage, options),
        #[cfg(feature = "wgsl")]
        Language::Wgsl => wgsl::compile(source, options),
        #[cfg(not(feature = "wgsl"))]
        Language::Wgsl => Err(missing_wgsl()),
        Language::Slang | Language::Hlsl => slang::compile(source, options),
    }
}

/// The name and version of the compiler that [`Source::compile`] would use: `"glslang 16.3.0"`.
///
/// # Errors
/// [`ErrorKind::UnsupportedTool`] where this build or machine lacks it.
pub fn tool(language: Language) -> Result<String> {
    match language {
        #[cfg(feature = "glsl")]
        Language::Glsl(_) if !glslang_tool::is_requested() => Ok(glslang_debug::version()),
        Language::Glsl(_) => glslang_tool::version(),
        #[cfg(feature = "wgsl")]
        Language::Wgsl => Ok(format!("naga {}", wgsl::NAGA_VERSION)),
        #[cfg(not(feature = "wgsl"))]
        Language::Wgsl => Err(missing_wgsl()),
        Language::Slang | Language::Hlsl => slang::version(),
    }
}

#[cfg(not(feature = "wgsl"))]
fn missing_wgsl() -> Error {
    Error::new(ErrorKind::UnsupportedTool, "this build of anyhit cannot compile WGSL")
        .note(anyhit_base::error::feature_note("wgsl"))
}

/// SPIR-V words as the bytes of a `.spv` file: little endian on every machine.
#[cfg(any(feature = "glsl", feature = "wgsl"))]
fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_become_options() {
        let options = CompileOptions::from_flags(["-gVS", "-O0"]).unwrap();
        assert_eq!(
            options,
            CompileOptions {
                debug: DebugInfoLevel::Full,
                optimize: Optimize::Off,
                ..CompileOptions::default()
            }
        );
        let error = CompileOptions::from_flags(["-O3"]).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidArgument);
        assert!(error.message().contains("-O3"), "{error}");
    }
}
