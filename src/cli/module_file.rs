//! Reads a module from a file that the command line names.

use std::path::Path;

use crate::cli::output;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::{InputLimit, InputLimits, read_argument};
use anyhit_compile::{
    CompileOptions, DebugInfoLevel, SOURCE_EXTENSIONS, Source, SourceSettings, SourceWords,
    compile_once_with_warnings,
};
use anyhit_debugger::shell;
use anyhit_engine::module::{self, Module};

/// Loads a SPIR-V file.
///
/// # Errors
/// `Io` where it cannot be read; `InvalidArgument` where it is too large or a shader's source, with
/// the command that compiles it; what [`module::load`] reports.
pub(super) fn read(path: &Path, limits: &InputLimits) -> Result<Module> {
    read_with_bytes(path, limits).map(|(_, module)| module)
}

/// Loads a SPIR-V file, and keeps its bytes: a pipe can be read once.
///
/// # Errors
/// As [`read`].
pub(super) fn read_with_bytes(path: &Path, limits: &InputLimits) -> Result<(Vec<u8>, Module)> {
    let bytes = read_argument(path, InputLimit::ModuleBytes, limits)?;
    let module = load(path, &bytes, limits)?;
    Ok((bytes, module))
}

/// Loads the bytes of a SPIR-V file.
///
/// # Errors
/// As [`read`].
pub(super) fn load(path: &Path, bytes: &[u8], limits: &InputLimits) -> Result<Module> {
    if let Some(error) = source_text(path, bytes) {
        return Err(error);
    }
    module::load_with(bytes, *limits).map_err(|error| error.at(Place::File(path.to_owned())))
}

/// Loads a SPIR-V file, or compiles a shader's source with full debug information and loads that.
///
/// # Errors
/// As [`read`], but that source is welcome; what [`compile_once_with_warnings`] reports.
pub(super) fn read_or_compile(path: &Path, limits: &InputLimits, words: &SourceWords) -> Result<Module> {
    let options = CompileOptions { debug: DebugInfoLevel::Full, ..CompileOptions::default() };
    let Some(settings) = words.settings(path)? else { return read(path, limits) };
    match compile(path, limits, &settings, &options) {
        Ok((_, module)) => Ok(module),
        // The content decides, not the extension: SPIR-V is no text.
        Err(error) if error.kind() == ErrorKind::InvalidSource => read(path, limits).map_err(|_| error),
        Err(error) => Err(error),
    }
}

/// Compiles a shader's source, and loads it; what its compiler warns of is printed.
///
/// # Errors
/// What [`compile_once_with_warnings`] and [`module::load_with`] report.
pub(super) fn compile(
    path: &Path,
    limits: &InputLimits,
    settings: &SourceSettings,
    options: &CompileOptions,
) -> Result<(Vec<u8>, Module)> {
    let name = path.to_string_lossy();
    let source = Source::read_as(settings.language(&name)?, Path::new(""), &name, limits)?;
    let source = source.include_folders(&settings.include_folders);
    let compiled = compile_once_with_warnings(&source, &settings.over(options))?;
    output::warnings(&compiled.warnings);
    let module = module::load_with(&compiled.spirv, *limits)
        .map_err(|error| error.at(Place::File(path.to_owned())))?;
    Ok((compiled.spirv, module))
}

/// Prints a warning for each declaration that a module lacks; rejects the module where the user is
/// strict.
///
/// # Errors
/// `InvalidModule` with all that the module uses without declaring it.
pub(super) fn check_declarations(path: &Path, module: Module, strict: bool) -> Result<Module> {
    if strict {
        module.check_declarations().map_err(|error| error.at(Place::File(path.to_owned())))?;
    }
    output::notes(&module.declaration_warnings(&escape::path(&path).to_string()));
    Ok(module)
}

/// The error for text where SPIR-V's binary form is wanted.
fn source_text(path: &Path, bytes: &[u8]) -> Option<Error> {
    let text = std::str::from_utf8(bytes).ok().filter(|text| !text.is_empty() && !text.contains('\0'))?;
    let shown = escape::path(&path);
    let typed = shell::word(&shown.to_string());
    let (what, note) = if text.contains("OpCapability") {
        ("SPIR-V assembly", format!("help: assemble it: spirv-as {typed}"))
    } else {
        let note = format!(
            "expected a compiled module (usually .spv), or a source whose language its extension or `--language` \
             names: {SOURCE_EXTENSIONS}"
        );
        ("text", note)
    };
    let message = format!("{shown} is {what}, not a SPIR-V module");
    Some(Error::new(ErrorKind::InvalidArgument, message).note(note))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(path: &str, bytes: &[u8]) -> Option<String> {
        source_text(Path::new(path), bytes).map(|error| error.to_string())
    }

    #[test]
    fn an_unknown_extension_lists_the_known_ones() {
        let text = source_text(Path::new("a.shader"), b"void main() {}").unwrap().render();
        assert!(
            text.contains("a source whose language its extension or `--language` names: GLSL: .rgen .rint"),
            "{text}"
        );
        assert!(text.contains("WGSL: .wgsl; Slang: .slang; HLSL: .hlsl"), "{text}");
        let typed = message("a b/hit.spvasm", b"OpCapability Shader").unwrap();
        assert!(typed.ends_with("spirv-as \"a b/hit.spvasm\""), "{typed}");
    }

    #[test]
    fn text_is_told_from_modules() {
        assert!(message("a.spvasm", b"OpCapability Shader\n").unwrap().contains("spirv-as a.spvasm"));
        assert!(message("a.txt", b"hello").unwrap().contains("is text"));
        let magic = 0x0723_0203u32.to_le_bytes();
        assert_eq!(message("a.rchit", &[magic, [0; 4]].concat()), None, "a name alone decides nothing");
        assert_eq!(message("a.rchit", b""), None);
    }
}
