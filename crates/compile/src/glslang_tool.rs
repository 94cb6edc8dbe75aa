//! Compiles GLSL with an installed `glslang`, `glslangValidator` or `glslc`.

use std::process::Command;

use super::external::{Tool, Workspace, printed};
use super::language::{extension, unknown_stage};
use super::message::{self, Severity};
use super::{CompileOptions, Compiled, DebugInfoLevel, Optimize, Source};
use anyhit_base::error::Stage;
use anyhit_base::error::{Error, ErrorKind, Result, feature_note};
use anyhit_base::escape;

/// The environment variable that names the tool to use, also where glslang is built in.
const VARIABLE: &str = "GLSLANG";

/// The message of glslang about an extension that it does not know.
const UNKNOWN: &str = "extension not supported";

/// Whether the user requests an installed tool by the environment variable.
#[cfg(feature = "glsl")]
pub(super) fn is_requested() -> bool {
    std::env::var_os(VARIABLE).is_some_and(|given| !given.is_empty())
}

/// Compiles for Vulkan 1.3, to SPIR-V 1.6.
pub(super) fn compile(source: &Source, stage: Stage, options: &CompileOptions) -> Result<Compiled> {
    let tool = tool()?;
    let workspace = Workspace::new(source)?;
    let mut command = Command::new(&tool.path);
    let stage = extension(stage).ok_or_else(|| unknown_stage(stage))?;
    if is_glslc(&tool) {
        command.args(["--target-env=vulkan1.3", "-x", "glsl"]).arg(format!("-fshader-stage={stage}"));
        if options.debug != DebugInfoLevel::Names {
            command.arg("-g");
        }
        match options.optimize {
            Optimize::Default => {}
            Optimize::Off => {
                command.arg("-O0");
            }
            Optimize::High => {
                command.arg("-O");
            }
        }
    } else {
        command.args(["-V", "--target-env", "vulkan1.3", "-S", stage]);
        match options.debug {
            DebugInfoLevel::Names => {}
            DebugInfoLevel::Lines => {
                command.arg("-g");
            }
            DebugInfoLevel::Full => {
                command.arg("-gVS");
            }
        }
        if options.optimize == Optimize::Off {
            command.arg("-Od");
        }
    }
    for folder in workspace.include_folders() {
        let mut argument = std::ffi::OsString::from("-I");
        argument.push(folder);
        command.arg(argument);
    }
    command.args(options.flags.define_arguments());
    let result = workspace.run(command.arg("-o").arg(workspace.output()).arg(workspace.source_path()))?;
    if let Some(crash) = tool.crash(source, &result) {
        return Err(crash);
    }
    let (printed, path) = (printed(&result), workspace.source_path());
    let diagnostics = |wanted| match is_glslc(&tool) {
        true => message::glslc(&printed, wanted),
        false => message::glslang(&printed, wanted),
    };
    if result.status.success() {
        let warnings = message::warnings(source, path, diagnostics(Severity::Warning));
        return Ok(Compiled { spirv: workspace.module(&tool, source, &printed)?, warnings });
    }
    let diagnostics = diagnostics(Severity::Error);
    // The source is valid, but the tool is too old for it.
    if let Some(diagnostic) = diagnostics.iter().find(|diagnostic| diagnostic.text.contains(UNKNOWN)) {
        let message =
            format!("{} cannot compile {}: {}", escape::path(&tool.path), source.name(), diagnostic.text);
        let error = Error::new(ErrorKind::UnsupportedTool, message);
        return Err(
            error.note("help: install a newer glslang, or build anyhit with its own (`--features glsl`)")
        );
    }
    Err(message::error(source, path, diagnostics, &printed))
}

/// The tool and its version.
pub(super) fn version() -> Result<String> {
    let tool = tool()?;
    Ok(format!("{} {}", tool.name(), tool.version(&["--version"])?))
}

/// The tool that the environment variable `GLSLANG` names, else one on the `PATH`.
pub(super) fn tool() -> Result<Tool> {
    Tool::find(VARIABLE, &["glslang", "glslangValidator", "glslc"]).map_err(|error: Error| {
        error
            .note(feature_note("glsl") + " (requires a C++ compiler); or install glslang, or set the environment variable GLSLANG to its path")
    })
}

fn is_glslc(tool: &Tool) -> bool {
    tool.name().starts_with("glslc")
}
