//! Compiles GLSL with the built-in glslang.

use std::path::Path;

use glslang::error::GlslangError;
use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderMessage, ShaderSource, ShaderStage, SourceLanguage,
    SpirvVersion, Target, VulkanVersion,
};

use super::language::unknown_stage;
use super::message::{self, Severity};
use super::{CompileOptions, Compiled, DebugInfoLevel, Source, bytes, glslang_debug};
use anyhit_base::error::Stage;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::contained;

/// Compiles for Vulkan 1.3, to SPIR-V 1.6.
pub(super) fn compile(source: &Source, stage: Stage, options: &CompileOptions) -> Result<Compiled> {
    contained("glslang", ErrorKind::InvalidSource, || translate(source, stage, options))
}

fn translate(source: &Source, stage: Stage, options: &CompileOptions) -> Result<Compiled> {
    if source.text().contains('\0') {
        let text = format!("{}: the text contains a NUL byte", source.name());
        return Err(Error::new(ErrorKind::InvalidSource, text));
    }
    let compiler = Compiler::acquire().ok_or_else(|| {
        Error::new(ErrorKind::UnsupportedTool, "glslang could not be initialised on this machine")
    })?;
    let stage = shader_stage(stage)?;
    let settings = CompilerOptions {
        source_language: SourceLanguage::GLSL,
        target: Target::Vulkan { version: VulkanVersion::Vulkan1_3, spirv_version: SpirvVersion::SPIRV1_6 },
        version_profile: None,
        messages: ShaderMessage::SPV_RULES
            | ShaderMessage::VULKAN_RULES
            | ShaderMessage::DISPLAY_ERROR_COLUMN,
    };
    let text = ShaderSource::from(source.text().as_ref());
    let mut includes = Includes { source };
    let defines = options.flags.defines.iter().map(|(name, value)| (name.as_str(), value.as_deref()));
    let defines: Vec<(&str, Option<&str>)> = defines.collect();
    let input = ShaderInput::new(&text, stage, &settings, Some(&defines[..]), Some(&mut includes))
        .map_err(|error| failed(source, &error))?;
    let shader = compiler.create_shader(input).map_err(|error| failed(source, &error))?;
    let path = Path::new(source.name());
    let words = match options.debug {
        DebugInfoLevel::Names => shader.compile().map_err(|error| failed(source, &error))?,
        debug => {
            let preprocessed = shader.get_preprocessed_code();
            glslang_debug::compile(source, &preprocessed, stage, debug)
                .map_err(|log| message::error(source, path, message::glslang(&log, Severity::Error), &log))?
        }
    };
    let warnings = message::warnings(source, path, message::glslang(&shader.get_log(), Severity::Warning));
    Ok(Compiled { spirv: bytes(&words), warnings })
}

fn shader_stage(stage: Stage) -> Result<ShaderStage> {
    Ok(match stage {
        Stage::RayGeneration => ShaderStage::RayGeneration,
        Stage::Intersection => ShaderStage::Intersect,
        Stage::AnyHit => ShaderStage::AnyHit,
        Stage::ClosestHit => ShaderStage::ClosestHit,
        Stage::Miss => ShaderStage::Miss,
        Stage::Callable => ShaderStage::Callable,
        Stage::Compute => ShaderStage::Compute,
        Stage::Other(_) => return Err(unknown_stage(stage)),
    })
}

/// Includes are relative to the including file; `<...>` means the same as `"..."`.
struct Includes<'a> {
    source: &'a Source,
}

impl IncludeHandler for Includes<'_> {
    fn include(
        &mut self,
        _: IncludeType,
        header: &str,
        includer: &str,
        _depth: usize,
    ) -> Option<IncludeResult> {
        let includer = if includer.is_empty() { self.source.name() } else { includer };
        let (name, data) = self.source.include(includer, header)?;
        // The binding panics on a zero byte; without one, a missing file is the clearer report.
        (!data.contains('\0')).then_some(IncludeResult { name, data })
    }
}

fn failed(source: &Source, error: &GlslangError) -> Error {
    let path = Path::new(source.name());
    match error {
        GlslangError::PreprocessError(log) | GlslangError::ParseError(log) | GlslangError::LinkError(log) => {
            message::error(source, path, message::glslang(&log.log, Severity::Error), &log.log)
        }
        other => message::error(source, path, Vec::new(), &other.to_string()),
    }
}
