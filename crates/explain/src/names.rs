//! Names for a transcript: those of the scene for shaders, records and structures, those of the
//! specification for numbers.

use std::fmt::Debug;
use std::path::Path;
use std::sync::Arc;

use crate::transcript::{Flags, ShaderLabel, TranscriptLine};
use anyhit_engine::accel::{HitKind, RecordIndex, Tlas};
use anyhit_engine::geometry::Surface;
use anyhit_engine::machine::{DeviceMemory, OpIndex, ShaderIndex};
use anyhit_engine::pipeline::Pipeline;
use anyhit_engine::program::Program;
use anyhit_engine::reflect::value::TypedValue;

/// SPIR-V, "Ray Flags".
const FLAGS: &[(u32, &str)] = &[
    (1, "OpaqueKHR"),
    (2, "NoOpaqueKHR"),
    (4, "TerminateOnFirstHitKHR"),
    (8, "SkipClosestHitShaderKHR"),
    (16, "CullBackFacingTrianglesKHR"),
    (32, "CullFrontFacingTrianglesKHR"),
    (64, "CullOpaqueKHR"),
    (128, "CullNoOpaqueKHR"),
    (256, "SkipTrianglesKHR"),
    (512, "SkipAABBsKHR"),
    (1024, "ForceOpacityMicromap2StateKHR"),
];

/// Ray flags by name; bits without a name as one number.
pub fn flags(bits: u32) -> Flags {
    let mut names: Vec<String> =
        FLAGS.iter().filter(|(bit, _)| bits & bit != 0).map(|&(_, name)| name.to_owned()).collect();
    let unnamed = FLAGS.iter().fold(bits, |rest, (bit, _)| rest & !bit);
    if unnamed != 0 {
        names.push(format!("{unnamed:#x}"));
    }
    Flags { bits, names }
}

/// The ray flag of a name: SPIR-V's, with or without its suffix, ignoring case, or the scene file's
/// (`terminate_on_first_hit`).
pub fn flag(name: &str) -> Option<u32> {
    let bare = |name: &str| {
        let name = name.replace('_', "").to_lowercase();
        name.strip_suffix("khr").map_or_else(|| name.clone(), str::to_owned)
    };
    let wanted = bare(name);
    FLAGS.iter().find(|(_, name)| bare(name) == wanted).map(|&(bit, _)| bit)
}

/// The names of all ray flags, for an error message.
pub fn all_flags() -> String {
    FLAGS.iter().map(|&(_, name)| name).collect::<Vec<_>>().join(", ")
}

/// A hit kind in words.
pub fn hit_kind(kind: HitKind) -> String {
    match kind {
        HitKind::FRONT_FACING_TRIANGLE => "front-facing triangle".into(),
        HitKind::BACK_FACING_TRIANGLE => "back-facing triangle".into(),
        HitKind::SPHERE => "sphere".into(),
        HitKind::LINEAR_SWEPT_SPHERE => "linear swept sphere".into(),
        HitKind(_) => "as reported".into(),
    }
}

/// A surface in words.
pub fn surface(surface: Surface) -> &'static str {
    match surface {
        Surface::TriangleFront => "front",
        Surface::TriangleBack => "back",
        Surface::Aabb => "box",
        Surface::Sphere => "sphere",
        Surface::Side => "side",
        Surface::Cap0 => "cap 0",
        Surface::Cap1 => "cap 1",
    }
}

/// The source line of an operation.
pub fn source_line(program: &Program, op: OpIndex) -> Option<TranscriptLine> {
    source_line_at(program, program.origins.get(op.index())?.offset)
}

/// The source line of the instruction at a word offset of the module.
pub fn source_line_at(program: &Program, offset: u32) -> Option<TranscriptLine> {
    TranscriptLine::of(&program.place_at(offset)?)
}

/// What a scene calls its modules, records and structures.
pub trait SceneNames: Debug {
    /// The module that a shader of a pipeline comes from.
    fn module(
        &self,
        origin: PipelineOrigin,
        pipeline: &Pipeline,
        shader: ShaderIndex,
    ) -> Option<NamedModule<'_>>;

    /// The name of a record of the miss table.
    fn miss_record(&self, origin: PipelineOrigin, index: RecordIndex) -> Option<&str>;

    /// The name of a record of the hit table.
    fn hit_record(&self, origin: PipelineOrigin, index: RecordIndex) -> Option<&str>;

    /// The acceleration structures with their names.
    fn structures(&self) -> &[(String, Arc<Tlas>)];

    /// The names of the geometries of an instance, by the index of its structure and its own.
    fn geometries(&self, structure: usize, instance: u32) -> &[String];
}

/// What of a scene a pipeline was made from.
#[derive(Clone, Copy, Debug)]
pub enum PipelineOrigin {
    /// The named pipeline with an index, or `[pipeline]`.
    Pipeline(Option<usize>),
    /// The shader of a dispatch alone: the index of its module.
    Dispatch(usize),
}

/// A module by its name in the scene.
#[derive(Clone, Copy, Debug)]
pub struct NamedModule<'a> {
    /// The name.
    pub name: &'a str,
    /// The file.
    pub path: &'a Path,
}

/// The names of what a pipeline consists of.
#[derive(Clone, Copy, Debug)]
pub struct Names<'a> {
    /// Where there is a scene, with what of it the pipeline is.
    scene: Option<(&'a dyn SceneNames, PipelineOrigin)>,
    pipeline: &'a Pipeline,
    memory: Option<&'a DeviceMemory>,
}

impl<'a> Names<'a> {
    /// These names with those of the buffers that device addresses lead to.
    #[must_use]
    pub fn with_memory(self, memory: &'a DeviceMemory) -> Self {
        Self { memory: Some(memory), ..self }
    }

    /// A value whose addresses are told by the names of buffers.
    pub fn value(&self, value: TypedValue) -> TypedValue {
        match self.memory {
            Some(memory) => value.with_places(memory),
            None => value,
        }
    }

    /// The names of a scene and of a pipeline that was assembled from it: the named one with an
    /// index, or `[pipeline]`.
    pub fn new(scene: &'a dyn SceneNames, index: Option<usize>, pipeline: &'a Pipeline) -> Self {
        Self { scene: Some((scene, PipelineOrigin::Pipeline(index))), pipeline, memory: None }
    }

    /// The names of a scene and of a pipeline of the shader of one of its dispatches alone, which
    /// is of the module with an index.
    pub fn of_dispatch(scene: &'a dyn SceneNames, module: usize, pipeline: &'a Pipeline) -> Self {
        Self { scene: Some((scene, PipelineOrigin::Dispatch(module))), pipeline, memory: None }
    }

    /// The names of a pipeline without a scene file: only entry points have names.
    pub fn unnamed(pipeline: &'a Pipeline) -> Self {
        Self { scene: None, pipeline, memory: None }
    }

    /// The module that a shader comes from.
    pub fn module(&self, shader: ShaderIndex) -> Option<NamedModule<'a>> {
        let (scene, origin) = self.scene?;
        scene.module(origin, self.pipeline, shader)
    }

    /// The label of a shader.
    pub fn shader(&self, shader: ShaderIndex) -> ShaderLabel {
        let program = &self.pipeline.programs[shader.index()];
        let module = self.module(shader);
        let file = module.and_then(|module| module.path.file_name());
        ShaderLabel {
            stage: program.stage.name(),
            name: module.map(|module| module.name.to_owned()),
            file: file.map(|file| file.to_string_lossy().into_owned()),
            entry: program.name.clone(),
        }
    }

    /// The name of a record of the miss table.
    pub fn miss_record(&self, index: RecordIndex) -> Option<String> {
        let (scene, origin) = self.scene?;
        scene.miss_record(origin, index).map(str::to_owned)
    }

    /// The name of a record of the hit table.
    pub fn hit_record(&self, index: RecordIndex) -> Option<String> {
        let (scene, origin) = self.scene?;
        scene.hit_record(origin, index).map(str::to_owned)
    }

    /// The index of an acceleration structure among the scene's, and its name.
    pub fn structure(&self, tlas: &Arc<Tlas>) -> Option<(usize, &'a str)> {
        let structures = self.scene?.0.structures();
        let at = structures.iter().position(|(_, known)| Arc::ptr_eq(known, tlas))?;
        Some((at, &structures[at].0))
    }

    /// The names of an instance's geometries.
    pub fn geometry(&self, tlas: &Arc<Tlas>, instance: u32) -> &'a [String] {
        let names = self.scene.zip(self.structure(tlas));
        names.map_or(&[], |((scene, _), (at, _))| scene.geometries(at, instance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_named_and_found() {
        // SPIR-V: TerminateOnFirstHitKHR 4, SkipClosestHitShaderKHR 8.
        assert_eq!(flags(12).names, ["TerminateOnFirstHitKHR", "SkipClosestHitShaderKHR"]);
        assert_eq!(flags(0x1_0001).names, ["OpaqueKHR", "0x10000"]);
        assert!(flags(0).names.is_empty());
        for name in ["CullOpaqueKHR", "CullOpaque", "cull_opaque", "cullopaquekhr"] {
            assert_eq!(flag(name), Some(64), "{name}");
        }
        assert_eq!(flag("CullNothing"), None);
    }
}
