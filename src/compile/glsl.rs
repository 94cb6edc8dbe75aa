//! GLSL through glslang.

use glslang::error::GlslangError;
use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderMessage, ShaderSource, ShaderStage, SourceLanguage,
    SpirvVersion, Target, VulkanVersion,
};

use super::{DebugInfo, Options, Source, Stage, bytes, glslang_debug, message};
use crate::error::{Error, ErrorKind, Result};

/// Compiles for Vulkan 1.3, to SPIR-V 1.6.
pub(super) fn compile(source: &Source, stage: Stage, options: &Options) -> Result<Vec<u8>> {
    if source.text().contains('\0') {
        let text = format!("{}: the text holds a zero byte", source.name());
        return Err(Error::new(ErrorKind::InvalidSource, text));
    }
    let compiler = Compiler::acquire().ok_or_else(|| {
        Error::new(ErrorKind::UnsupportedTool, "glslang could not be initialised on this machine")
    })?;
    let stage = shader_stage(stage);
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
    let defines: Option<&[(&str, Option<&str>)]> = None;
    let input = ShaderInput::new(&text, stage, &settings, defines, Some(&mut includes))
        .map_err(|error| failed(source, &error))?;
    let shader = compiler.create_shader(input).map_err(|error| failed(source, &error))?;
    let words = match options.debug {
        DebugInfo::Names => shader.compile().map_err(|error| failed(source, &error))?,
        debug => {
            let preprocessed = shader.get_preprocessed_code();
            glslang_debug::compile(source, &preprocessed, stage, debug)
                .map_err(|log| message::error(source, message::glslang(&log), &log))?
        }
    };
    Ok(bytes(&words))
}

fn shader_stage(stage: Stage) -> ShaderStage {
    match stage {
        Stage::RayGeneration => ShaderStage::RayGeneration,
        Stage::Intersection => ShaderStage::Intersect,
        Stage::AnyHit => ShaderStage::AnyHit,
        Stage::ClosestHit => ShaderStage::ClosestHit,
        Stage::Miss => ShaderStage::Miss,
        Stage::Callable => ShaderStage::Callable,
        Stage::Compute => ShaderStage::Compute,
    }
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
    match error {
        GlslangError::PreprocessError(log) | GlslangError::ParseError(log) | GlslangError::LinkError(log) => {
            message::error(source, message::glslang(&log.log), &log.log)
        }
        other => message::error(source, Vec::new(), &other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::compile;
    use crate::error::Place;

    const MISS: &str = "#version 460\n#extension GL_EXT_ray_tracing : require\n\
        layout(location = 0) rayPayloadInEXT vec4 payload;\nvoid main() { payload = vec4(1.0); }\n";

    /// The instruction's opcodes in order, from the words alone.
    fn opcodes(spirv: &[u8]) -> Vec<u16> {
        let words: Vec<u32> =
            spirv.chunks(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect();
        let (mut at, mut found) = (5, Vec::new());
        while at < words.len() {
            found.push(words[at] as u16);
            at += (words[at] >> 16) as usize;
        }
        found
    }

    #[test]
    fn a_miss_shader_becomes_spirv_1_6() {
        let source = Source::from_text("a.rmiss", MISS).unwrap();
        let spirv = compile(&source, &Options::default()).unwrap();
        // Magic number, then the version as 0 | major | minor | 0 (SPIR-V 2.3).
        assert_eq!(spirv[..8], [3, 2, 0x23, 7, 0, 6, 1, 0]);
    }

    #[test]
    fn debug_info_adds_lines_or_the_nonsemantic_instructions() {
        const LINE: u16 = 8;
        const EXT_INST: u16 = 12;
        let source = Source::from_text("a.rmiss", MISS).unwrap();
        let with = |debug| opcodes(&compile(&source, &Options { debug, ..Options::default() }).unwrap());
        assert!(!with(DebugInfo::Names).contains(&LINE));
        assert!(with(DebugInfo::Lines).contains(&LINE));
        assert!(with(DebugInfo::Full).contains(&EXT_INST));
        assert!(!with(DebugInfo::Lines).contains(&EXT_INST));
    }

    #[test]
    fn a_mistake_is_shown_in_the_text() {
        let text = MISS.replace("vec4(1.0)", "blue");
        let error = compile(&Source::from_text("a.rmiss", text).unwrap(), &Options::default()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidSource);
        let report = error.render();
        assert!(report.contains("'blue': undeclared identifier"), "{report}");
        assert!(report.contains("a.rmiss:4:"), "{report}");
    }

    #[test]
    fn a_mistake_in_an_include_is_shown_there() {
        let folder = std::env::temp_dir().join(format!("anyhit-glsl-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("sky.glsl"), "vec3 sky() {\n    return blue;\n}\n").unwrap();
        let text = "#version 460\n#extension GL_EXT_ray_tracing : require\n\
            #extension GL_GOOGLE_include_directive : require\n#include \"sky.glsl\"\nvoid main() {}\n";
        std::fs::write(folder.join("a.rmiss"), text).unwrap();
        let source = Source::read_in(&folder, "a.rmiss").unwrap();
        let error = compile(&source, &Options::default()).unwrap_err();
        std::fs::remove_dir_all(&folder).unwrap();
        let (place, _) = error.places().next().unwrap();
        let Place::Text { file, text, span } = place else { panic!("{error:?}") };
        assert_eq!(file, "sky.glsl");
        assert!(text[span.clone()].starts_with(['r', 'b']), "{error:?}");
    }
}
