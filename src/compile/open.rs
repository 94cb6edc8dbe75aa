//! Opens a SPIR-V file, or compiles a source, and loads the module.

use std::path::Path;
use std::sync::Arc;

use super::{CompileOptions, DebugInfoLevel, Language, Source, compile_once};
use crate::error::{Place, Result};
use crate::input::{InputLimit, InputLimits, read_argument};
use crate::module::{Module, load};

/// How a source is compiled by default: with line numbers, so that traps can name them.
const OPTIONS: CompileOptions =
    CompileOptions { debug: DebugInfoLevel::Lines, optimize: super::Optimize::Default };

impl Module {
    /// Opens a module: a file of SPIR-V, or a source in GLSL, WGSL, Slang or HLSL by its extension,
    /// which is compiled [once](super::compile_once) with line numbers.
    ///
    /// # Errors
    /// `Io` where the file cannot be read, those of [`load()`], with the file named, and for a
    /// source those of [`compile()`](super::compile()).
    pub fn open(path: impl AsRef<Path>) -> Result<Arc<Self>> {
        let path = path.as_ref();
        let bytes = read_argument(path, InputLimit::ModuleBytes, &InputLimits::default())?;
        // The content decides before the extension does.
        let text = bytes.first().is_some_and(|first| first.is_ascii_graphic() || first.is_ascii_whitespace());
        if text && Language::of(path).is_some() {
            return Self::compile(&Source::from_bytes(path, bytes)?, &OPTIONS);
        }
        let module = load(&bytes).map_err(|error| {
            let error = error.at(Place::File(path.to_path_buf()));
            if text { error.note(format!("if it is a source: {}", super::source::EXTENSIONS)) } else { error }
        });
        Ok(Arc::new(module?))
    }

    /// A module from the bytes of SPIR-V: `include_bytes!("a.spv")`.
    ///
    /// # Errors
    /// As [`load()`].
    pub fn from_spirv(bytes: &[u8]) -> Result<Arc<Self>> {
        load(bytes).map(Arc::new)
    }

    /// A module from source text; the name's extension says the language, and with GLSL the stage.
    ///
    /// ```
    /// # #[cfg(feature = "wgsl")] {
    /// let module = anyhit::Module::from_source("sky.wgsl", "
    ///     enable wgpu_ray_tracing_pipeline;
    ///     struct Payload { colour: vec3f }
    ///     var<incoming_ray_payload> payload: Payload;
    ///     @miss @incoming_payload(payload) fn sky() { payload.colour = vec3f(0.25, 0.5, 1.0); }
    /// ")?;
    /// let outcome = anyhit::ShaderTest::new(&module, "sky")?.run()?;
    /// assert_eq!(outcome.payload["colour"].vec3(), [0.25, 0.5, 1.0]);
    /// # }
    /// # Ok::<(), anyhit::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Module::open`].
    pub fn from_source(name: &str, text: &str) -> Result<Arc<Self>> {
        Self::compile(&Source::from_text(name, text)?, &OPTIONS)
    }

    /// A module from a source and options; compiled [once](super::compile_once).
    ///
    /// # Errors
    /// As [`Module::open`].
    pub fn compile(source: &Source, options: &CompileOptions) -> Result<Arc<Self>> {
        let spirv = compile_once(source, options)?;
        let module = load(&spirv).map_err(|error| error.at(Place::File(source.name().into())))?;
        Ok(Arc::new(module))
    }
}
