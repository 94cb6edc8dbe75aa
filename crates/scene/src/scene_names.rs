//! The names that a scene file gives to shaders, records and structures.

use std::sync::Arc;

use crate::ResolvedScene;
use crate::resolved::{ResolvedGroup, ResolvedPipeline, ResolvedRecord};
use anyhit_engine::accel::{RecordIndex, Tlas};
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::pipeline::{Group, Pipeline};
use anyhit_explain::names::{NamedModule, PipelineOrigin, SceneNames};

impl SceneNames for ResolvedScene {
    fn module(
        &self,
        origin: PipelineOrigin,
        pipeline: &Pipeline,
        shader: ShaderIndex,
    ) -> Option<NamedModule<'_>> {
        let module = match origin {
            PipelineOrigin::Dispatch(module) => module,
            PipelineOrigin::Pipeline(index) => module_of(self.pipeline_at(index), pipeline, shader)?,
        };
        let module = self.shaders.get(module)?;
        Some(NamedModule { name: &module.name, path: &module.path })
    }

    fn miss_record(&self, origin: PipelineOrigin, index: RecordIndex) -> Option<&str> {
        name_of(&pipeline_of(self, origin)?.sbt.miss, index)
    }

    fn hit_record(&self, origin: PipelineOrigin, index: RecordIndex) -> Option<&str> {
        name_of(&pipeline_of(self, origin)?.sbt.hit, index)
    }

    fn structures(&self) -> &[(String, Arc<Tlas>)] {
        &self.tlas
    }

    fn geometries(&self, structure: usize, instance: u32) -> &[String] {
        let names = self.geometry_names.get(structure);
        names.and_then(|names| names.get(instance as usize)).map_or(&[], |names| names)
    }
}

/// The scene's description of a pipeline; a dispatch has none.
fn pipeline_of(scene: &ResolvedScene, origin: PipelineOrigin) -> Option<&ResolvedPipeline> {
    match origin {
        PipelineOrigin::Pipeline(index) => Some(scene.pipeline_at(index)),
        PipelineOrigin::Dispatch(_) => None,
    }
}

/// The index of the module of a pipeline's shader. The pipeline's groups are the scene's, in the
/// same order.
fn module_of(resolved: &ResolvedPipeline, pipeline: &Pipeline, shader: ShaderIndex) -> Option<usize> {
    let found = pipeline.groups.iter().zip(&resolved.groups).find_map(|pair| match pair {
        (Group::General(one), ResolvedGroup::RayGeneration(named))
        | (Group::General(one), ResolvedGroup::Miss(named))
        | (Group::General(one), ResolvedGroup::Callable(named)) => (*one == shader).then_some(named),
        (Group::Hit(group), ResolvedGroup::Hit(named)) => [
            (group.closest_hit, &named.closest_hit),
            (group.any_hit, &named.any_hit),
            (group.intersection, &named.intersection),
        ]
        .into_iter()
        .find_map(|(one, named)| named.as_ref().filter(|_| one == Some(shader))),
        _ => None,
    });
    found.map(|found| found.module)
}

fn name_of(records: &[ResolvedRecord], index: RecordIndex) -> Option<&str> {
    index.get(records)?.name.as_deref()
}
