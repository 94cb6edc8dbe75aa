//! The source lines of findings.

use std::sync::Arc;

use serde::Serialize;

use crate::debug::names::{Names, source_line_at};
use crate::pipeline::Shader;
use crate::program::Program;
use crate::scene::{Assembled, ResolvedScene};

/// A line of a shader's source, or an instruction where the module knows no lines.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct Spot {
    /// The source file as the compiler wrote it; without debug information the module.
    pub file: String,
    /// From 1; 0 where the module knows no lines.
    pub line: u32,
    /// The line, where the module holds its source; the instruction where there is no line.
    pub text: Option<String>,
}

impl Spot {
    /// `file:line`, or the file and the instruction.
    pub fn label(&self) -> String {
        let file = self.file.rsplit(['/', '\\']).next().unwrap_or(&self.file);
        match (self.line, &self.text) {
            (0, Some(instruction)) => format!("{file} {instruction}"),
            (0, None) => file.to_owned(),
            (line, _) => format!("{file}:{line}"),
        }
    }
}

/// The programs of a scene, those of its dispatches behind those of its pipeline.
#[derive(Clone, Debug)]
pub(super) struct Programs {
    pub all: Vec<Arc<Program>>,
    files: Vec<String>,
}

impl Programs {
    pub fn of(scene: &ResolvedScene, assembled: &Assembled) -> Self {
        let names = Names::new(scene, &assembled.pipeline);
        let pipeline = assembled.pipeline.programs.iter().enumerate().map(|(at, program)| {
            let path = names.module(Shader(at as u32)).map(|module| module.path.display().to_string());
            (program.clone(), path)
        });
        let dispatched = assembled.dispatches.iter().zip(&scene.dispatches).map(|(dispatch, entry)| {
            let path = &scene.shaders[entry.shader.module].path;
            (dispatch.compute.program.clone(), Some(path.display().to_string()))
        });
        let (all, files) = pipeline
            .chain(dispatched)
            .map(|(program, path)| {
                let path = path.unwrap_or_else(|| format!("{} `{}`", program.stage.name(), program.name));
                (program, path)
            })
            .unzip();
        Self { all, files }
    }

    /// The place of the instruction at a word offset of a shader's module.
    pub fn spot(&self, shader: usize, offset: u32) -> Spot {
        let program = &self.all[shader];
        if let Some(line) = source_line_at(program, offset) {
            return Spot { file: line.file, line: line.line, text: line.text };
        }
        let mut functions = program.module.functions.iter();
        let function = functions.rfind(|function| function.offset <= offset);
        let within = function.map_or_else(String::new, |function| {
            let name = program.module.name(function.id).map_or_else(
                || format!("%{}", function.id.0),
                |name| format!("`{}`", name.split('(').next().unwrap_or(name)),
            );
            format!(" in function {name}")
        });
        let text = Some(format!("word {offset}{within}"));
        Spot { file: self.files[shader].clone(), line: 0, text }
    }
}
