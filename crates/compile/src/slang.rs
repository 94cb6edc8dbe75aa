//! Compiles Slang and HLSL with the tool `slangc`, where it is installed.

use std::path::Path;
use std::process::Command;

use super::external::{Tool, Workspace, printed, with_strings};
use super::message::{self, Severity};
use super::{CompileOptions, Compiled, DebugInfoLevel, Language, Optimize, Source};
use anyhit_base::error::Stage;
use anyhit_base::error::{Error, ErrorKind, Result};

/// The message of `slangc` if its library that optimises SPIR-V is missing.
const NO_OPTIMIZER: &str = "failed to load downstream compiler 'spirv-opt'";

/// Compiles all entry points of a source into one module, each under its own name.
pub(super) fn compile(source: &Source, options: &CompileOptions) -> Result<Compiled> {
    if let Some(entry) = &options.entry_point
        && (entry.name.is_empty() || entry.name.starts_with('-') || entry.name.contains(char::is_control))
    {
        let text = format!("`{}` is not the name of an entry point", entry.name);
        return Err(Error::new(ErrorKind::InvalidArgument, text));
    }
    let workspace = Workspace::new(source)?;
    let tool = tool()?;
    let run = |optimize| {
        let mut command = Command::new(&tool.path);
        // Of other extensions slangc would take the file for GLSL, or for none of its own.
        if Language::of(Path::new(source.name())) != Some(source.language()) {
            let name = if source.language() == Language::Hlsl { "hlsl" } else { "slang" };
            command.args(["-lang", name]);
        }
        command.arg(workspace.source_path());
        if let Some(entry) = &options.entry_point {
            command.args(["-entry", &entry.name]);
            command.args(entry.stage.and_then(slang_name).iter().flat_map(|stage| ["-stage", stage]));
        }
        command.arg("-o").arg(workspace.output());
        command.args(["-target", "spirv", "-fvk-use-entrypoint-name"]);
        for folder in workspace.include_folders() {
            command.arg("-I").arg(folder);
        }
        command.args(options.flags.define_arguments()).args(&options.flags.passed);
        if options.debug != DebugInfoLevel::Names {
            command.arg("-g2");
        }
        match optimize {
            Optimize::Default => {}
            Optimize::Off => {
                command.arg("-O0");
            }
            Optimize::High => {
                command.arg("-O2");
            }
        }
        workspace.run(&mut command)
    };
    let mut result = run(options.optimize)?;
    // Builds of slangc without an optimiser, such as that of slangtorch, can compile with -O0.
    if options.optimize == Optimize::Default && printed(&result).contains(NO_OPTIMIZER) {
        result = run(Optimize::Off)?;
    }
    if let Some(crash) = tool.crash(source, &result) {
        return Err(crash);
    }
    let (printed, path) = (printed(&result), workspace.source_path());
    if !result.status.success() {
        let error = message::error(source, path, message::slangc(&printed, Severity::Error), &printed);
        return Err(match printed.contains(NO_OPTIMIZER) {
            true => error.note("help: compile with -O0; this slangc has no optimiser beside it"),
            false => error,
        });
    }
    let warnings = message::warnings(source, path, message::slangc(&printed, Severity::Warning));
    let spirv = without_machine_paths(&workspace.module(&tool, source, &printed)?, workspace.folder());
    Ok(Compiled { spirv, warnings })
}

/// The module with file names relative to a folder. slangc's debug information holds absolute ones,
/// and its own folder among the arguments of each compilation unit: the module would differ from
/// one machine to the next.
fn without_machine_paths(spirv: &[u8], folder: &Path) -> Vec<u8> {
    let mut folder = folder.to_string_lossy().into_owned();
    folder.push(std::path::MAIN_SEPARATOR);
    with_strings(spirv, |text| without_include_folders(&text.replace(&folder, "")))
}

/// Arguments of slangc without ` -I "FOLDER"`. Other text, source text among it, stays.
fn without_include_folders(text: &str) -> String {
    const OPEN: &str = " -I \"";
    if !text.starts_with("-target ") {
        return text.to_owned();
    }
    let mut out = text.to_owned();
    while let Some(start) = out.find(OPEN)
        && let Some(length) = out[start + OPEN.len()..].find('"')
    {
        out.replace_range(start..start + OPEN.len() + length + 1, "");
    }
    out
}

/// What slangc calls a stage.
fn slang_name(stage: Stage) -> Option<&'static str> {
    Some(match stage {
        Stage::RayGeneration => "raygeneration",
        Stage::Intersection => "intersection",
        Stage::AnyHit => "anyhit",
        Stage::ClosestHit => "closesthit",
        Stage::Miss => "miss",
        Stage::Callable => "callable",
        Stage::Compute => "compute",
        Stage::Other(_) => return None,
    })
}

/// `slangc` and its version.
pub(super) fn version() -> Result<String> {
    Ok(format!("slangc {}", tool()?.version(&["-v"])?))
}

/// The tool: what the environment variable `SLANGC` names, else `slangc` on the `PATH`.
pub(super) fn tool() -> Result<Tool> {
    Tool::find("SLANGC", &["slangc"]).map_err(|error| {
        error
            .note("`pip install slangtorch` installs it in the folder slangtorch/bin")
            .note("help: add it to PATH, or set the environment variable SLANGC to its path")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn debug_information_loses_the_paths_of_the_machine() {
        // Header, then OpString %1 "/f/a.s" (6 bytes, a zero, one more zero), then OpNop.
        let words = [0x0723_0203, 0x10600, 0, 2, 0, 4 << 16 | 7, 1, 0x612F_662F, 0x0000_732E, 1 << 16];
        let spirv: Vec<u8> = words.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        let fixed = without_machine_paths(&spirv, Path::new("/f"));
        let expected = [0x0723_0203, 0x10600, 0, 2, 0, 3 << 16 | 7, 1, 0x0073_2E61, 1 << 16];
        let expected: Vec<u8> = expected.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        if cfg!(unix) {
            assert_eq!(fixed, expected);
        }
        let arguments = "-target spirv  -I \"/opt/bin\" -g2 -I \"/x\" -entry a";
        assert_eq!(without_include_folders(arguments), "-target spirv  -g2 -entry a");
    }
}
