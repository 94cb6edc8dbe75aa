//! Compiles GLSL with an installed `glslang`, `glslangValidator` or `glslc`.

use std::process::Command;

use super::outside::{Desk, Tool, said};
use super::{CompileOptions, DebugInfoLevel, Optimize, Source, SourceStage, message};
use crate::error::{Error, ErrorKind, Result};

/// The environment variable that names the tool to use, also where glslang is built in.
const VARIABLE: &str = "GLSLANG";

/// What glslang says of an extension that it does not know.
const UNKNOWN: &str = "extension not supported";

/// Whether the user names a tool.
#[cfg(feature = "glsl")]
pub(super) fn asked_for() -> bool {
    std::env::var_os(VARIABLE).is_some_and(|given| !given.is_empty())
}

/// Compiles for Vulkan 1.3, to SPIR-V 1.6.
pub(super) fn compile(source: &Source, stage: SourceStage, options: &CompileOptions) -> Result<Vec<u8>> {
    let tool = tool()?;
    let desk = Desk::new(source)?;
    let mut command = Command::new(&tool.path);
    let stage = stage.extension();
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
    for folder in source.outside_folders()? {
        let mut argument = std::ffi::OsString::from("-I");
        argument.push(folder);
        command.arg(argument);
    }
    let result = desk.run(command.arg("-o").arg(desk.output()).arg(source.name()))?;
    let said = said(&result);
    if result.status.success() {
        return desk.module(said);
    }
    let complaints = match is_glslc(&tool) {
        true => message::glslc(&said),
        false => message::glslang(&said),
    };
    // Not a mistake of the source: the tool is too old for it.
    if let Some(complaint) = complaints.iter().find(|complaint| complaint.text.contains(UNKNOWN)) {
        let message = format!("{} cannot compile {}: {}", tool.path.display(), source.name(), complaint.text);
        let error = Error::new(ErrorKind::UnsupportedTool, message);
        return Err(error.note("a newer glslang may, and so does anyhit's own (`--features glsl`)"));
    }
    Err(message::error(source, complaints, &said))
}

/// The tool and its version.
pub(super) fn version() -> Result<String> {
    let tool = tool()?;
    Ok(format!("{} {}", tool.name(), tool.version(&["--version"])?))
}

/// What the environment variable `GLSLANG` names, else what is on the `PATH`.
pub(super) fn tool() -> Result<Tool> {
    Tool::find(VARIABLE, &["glslang", "glslangValidator", "glslc"]).map_err(|error: Error| {
        error
            .note("build anyhit with `--features glsl` (needs a C++ compiler), install glslang, or name it in the environment variable GLSLANG")
    })
}

fn is_glslc(tool: &Tool) -> bool {
    tool.name().starts_with("glslc")
}
