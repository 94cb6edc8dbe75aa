//! Opens a SPIR-V file, or compiles a source, and loads the module.

use std::path::Path;
use std::sync::Arc;

use crate::module::{Module, load, load_with};
use anyhit_base::error::{ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, RootFolder, read_argument};
use anyhit_compile::{
    CompileOptions, DebugInfoLevel, SOURCE_EXTENSIONS, Source, SourceSettings, SourceWords,
    compile_once_with_warnings,
};

/// How a source is compiled by default: with line numbers, so that traps can name them.
fn options() -> CompileOptions {
    CompileOptions::default().debug(DebugInfoLevel::Lines)
}

impl Module {
    /// Opens a module: a file of SPIR-V, or a source in GLSL, WGSL, Slang or HLSL by its extension,
    /// which is compiled once with line numbers.
    ///
    /// # Errors
    /// `Io` where the file cannot be read, those of [`load()`], with the file named, and for a
    /// source those of [`Source::compile`].
    pub fn open(path: impl AsRef<Path>) -> Result<Arc<Self>> {
        Self::open_within(path, &InputLimits::default(), None)
    }

    /// Opens a module as [`Module::open`] does, with these limits; a source includes files from
    /// this folder alone where one is given.
    ///
    /// # Errors
    /// As [`Module::open`], and where a limit is exceeded.
    #[doc(hidden)]
    pub fn open_within(
        path: impl AsRef<Path>,
        limits: &InputLimits,
        root: Option<&RootFolder>,
    ) -> Result<Arc<Self>> {
        Self::open_as(path.as_ref(), limits, root, &SourceWords::default()).map(|(module, _)| module)
    }

    /// Opens a module as [`Module::open_within`] does, a source as these words say; returns what
    /// they mean for it, where it is one.
    ///
    /// # Errors
    /// As [`Module::open_within`], and where the words make no sense for the source.
    #[doc(hidden)]
    pub fn open_as(
        path: &Path,
        limits: &InputLimits,
        root: Option<&RootFolder>,
        words: &SourceWords,
    ) -> Result<(Arc<Self>, Option<SourceSettings>)> {
        let settings = words.settings(path)?;
        // The content decides before the extension does, and with it which limit holds.
        let most = match settings {
            Some(_) if limits.get(InputLimit::SourceBytes) > limits.get(InputLimit::ModuleBytes) => {
                InputLimit::SourceBytes
            }
            _ => InputLimit::ModuleBytes,
        };
        let bytes = read_argument(path, most, limits)?;
        let text = bytes.first().is_some_and(|first| first.is_ascii_graphic() || first.is_ascii_whitespace());
        if let Some(settings) = settings.filter(|_| text) {
            limits
                .check(InputLimit::SourceBytes, bytes.len() as u64, ErrorKind::InvalidArgument)
                .map_err(|error| error.context(escape::path(&path)))?;
            let language = settings.language(&path.to_string_lossy())?;
            let source =
                Source::from_bytes(language, path, bytes)?.include_folders(&settings.include_folders);
            let source = source.confined(*limits, root.cloned());
            return Ok((Self::compile(&source, &settings.over(&options()))?, Some(settings)));
        }
        let module = load_with(&bytes, *limits).map_err(|error| {
            let error = error.at(Place::File(path.to_path_buf()));
            if !text {
                return error;
            }
            error.note(format!("the extension of a source must name its language: {SOURCE_EXTENSIONS}"))
        });
        Ok((Arc::new(module?), None))
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
        Self::compile(&Source::from_text(name, text)?, &options())
    }

    /// A module from a source and options, within the source's limits; compiled
    /// once.
    ///
    /// # Errors
    /// As [`Module::open`].
    pub fn compile(source: &Source, options: &CompileOptions) -> Result<Arc<Self>> {
        let compiled = compile_once_with_warnings(source, options)?;
        let mut module = load_with(&compiled.spirv, *source.limits())
            .map_err(|error| error.at(Place::File(source.name().into())))?;
        module.warnings = compiled.warnings;
        Ok(Arc::new(module))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SKY: &str = "enable wgpu_ray_tracing_pipeline;
        struct Payload { colour: vec3f }
        var<incoming_ray_payload> payload: Payload;
        @miss @incoming_payload(payload) fn sky() { payload.colour = vec3f(0.25, 0.5, 1.0); }\n";

    fn limits(limit: InputLimit, value: u64) -> InputLimits {
        InputLimits::default().with(limit, value)
    }

    #[test]
    fn a_source_is_read_within_the_limit_of_sources() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.wgsl");
        std::fs::write(&path, SKY).unwrap();
        let open = |limits| Module::open_within(&path, &limits, None);
        let size = SKY.len() as u64;
        assert!(open(limits(InputLimit::SourceBytes, size)).is_ok());
        let error = open(limits(InputLimit::SourceBytes, size - 1)).unwrap_err();
        assert!(error.message().contains(&format!("the limit `source-bytes` of {}", size - 1)), "{error}");
        // The module holds the text, and is larger: its limit is told of it, not of the source.
        let error = open(limits(InputLimit::ModuleBytes, size - 1)).unwrap_err();
        assert!(error.message().contains(&format!("the limit `module-bytes` of {}", size - 1)), "{error}");
        assert_eq!(error.kind(), ErrorKind::UnsupportedModule, "{error}");
    }

    #[test]
    fn what_is_compiled_keeps_to_the_limits_of_its_source() {
        let source = Source::from_text("sky.wgsl", SKY).unwrap();
        assert!(Module::compile(&source, &options()).is_ok());
        let source = source.confined(limits(InputLimit::ModuleIds, 3), None);
        let error = Module::compile(&source, &options()).unwrap_err();
        assert!(error.message().contains("the limit `module-ids` of 3"), "{error}");
    }
}
