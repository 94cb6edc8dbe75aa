//! Compares the sizes of blocks that shaders declare with the bytes that a scene gives.
//!
//! Too few bytes are no error: a shader may leave the rest unread. Where it does read on, the
//! access traps, and what is bound here explains it.

use crate::ResolvedScene;
use crate::descriptors::line_of;
use crate::pass::{Dispatch, OwnBinding, Pass, PassWork};
use anyhit_engine::machine::Binding;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::group::{Group, HitGroup};
use anyhit_engine::pipeline::{Pipeline, SbtRecord};
use anyhit_engine::program::Program;
use anyhit_engine::program::descriptors::declared_blocks;
use anyhit_engine::reflect::{Layout, Rules};

/// Returns a note for each buffer, record and push-constant range that is smaller than a shader's
/// block for it. `of_passes` returns the own bindings of each pass that runs a program.
pub(super) fn notes<'a>(
    scene: &ResolvedScene,
    programs: impl Iterator<Item = &'a Program>,
    of_passes: &dyn Fn(&Program) -> Vec<&'a [OwnBinding]>,
    pipelines: &[&Pipeline],
    dispatches: &[Dispatch],
    passes: &[Pass],
) -> Vec<String> {
    let mut notes = Vec::new();
    for program in programs {
        for (ty, _, binding) in declared_blocks(program) {
            let Some(binding) = binding else { continue };
            let declared = Layout::new(&program.module, ty, Rules::Explicit).size();
            let kept =
                |own: &[OwnBinding]| own.iter().find(|own| own.at == binding).map_or(binding, |own| own.kept);
            let found: Vec<Binding> = of_passes(program).into_iter().map(kept).collect();
            for bound in scene.resources.iter().filter(|one| found.contains(&one.kept_at())) {
                let Ok(Some(given)) = bound.resource.buffer_size() else { continue };
                let what = format!("{}the buffer `{}` ({binding})", line_of(&bound.place), bound.name);
                add(&mut notes, &what, given, declared, program);
            }
        }
    }
    for pipeline in pipelines {
        add_records(&mut notes, pipeline);
    }
    add_push_constants(&mut notes, scene, pipelines, dispatches, passes);
    notes.truncate(
        usize::try_from(scene.files.limits.get(anyhit_base::input::InputLimit::ErrorsShown))
            .unwrap_or(usize::MAX),
    );
    notes
}

/// Adds a note if fewer bytes are given than declared.
fn add(notes: &mut Vec<String>, what: &str, given: u64, declared: usize, program: &Program) {
    if given >= declared as u64 {
        return;
    }
    let note = format!(
        "{what}: {given} bytes given, {declared} declared by {} `{}`; an access past the end traps",
        program.stage.name(),
        program.name
    );
    if !notes.contains(&note) {
        notes.push(note);
    }
}

/// The size of the block that a program declares in a storage class, in bytes.
fn declared_size(program: &Program, class: u32) -> Option<usize> {
    let (ty, ..) = declared_blocks(program).find(|(_, found, _)| *found == class)?;
    Some(Layout::new(&program.module, ty, Rules::Explicit).size())
}

fn add_records(notes: &mut Vec<String>, pipeline: &Pipeline) {
    let sbt = &pipeline.sbt;
    let raygen = sbt.ray_generation.iter().map(|record| ("the ray generation record".to_owned(), record));
    let numbered = |table: &'static str, records: &'_ [Option<SbtRecord>]| {
        let records = records.iter().enumerate();
        records
            .filter_map(move |(at, record)| Some((format!("{table} record {at}"), record.clone()?)))
            .collect::<Vec<_>>()
    };
    let tables =
        [numbered("hit", &sbt.hit), numbered("miss", &sbt.miss), numbered("callable", &sbt.callable)];
    let tables: Vec<(String, SbtRecord)> =
        raygen.map(|(name, record)| (name, record.clone())).chain(tables.into_iter().flatten()).collect();
    for (name, record) in &tables {
        // A shader that reads a record without data traps with a message of its own.
        let Some(data) = &record.data else { continue };
        let shaders = match pipeline.groups.get(record.group as usize) {
            Some(&Group::General(shader)) => [Some(shader), None, None],
            Some(&Group::Hit(HitGroup { closest_hit, any_hit, intersection })) => {
                [closest_hit, any_hit, intersection]
            }
            None => continue,
        };
        for shader in shaders.into_iter().flatten() {
            let program = &pipeline.programs[shader.index()];
            if let Some(declared) = declared_size(program, storage::SHADER_RECORD_BUFFER) {
                add(notes, name, data.size(), declared, program);
            }
        }
    }
}

/// Adds notes on the push constants of each pass: its own, or those of the scene.
fn add_push_constants(
    notes: &mut Vec<String>,
    scene: &ResolvedScene,
    pipelines: &[&Pipeline],
    dispatches: &[Dispatch],
    passes: &[Pass],
) {
    let of_scene = (!scene.push_constants.is_empty()).then(|| scene.push_constants.size().ok()).flatten();
    for pass in passes {
        let (own, programs) = match &pass.work {
            PassWork::Launch(launch) => {
                let Some(pipeline) = pipelines.get(launch.pipeline.map_or(0, |index| index + 1)) else {
                    continue;
                };
                (&launch.push_constants, pipeline.programs.clone())
            }
            PassWork::Dispatch(index) => {
                let Some(dispatch) = dispatches.get(*index) else { continue };
                (&dispatch.push_constants, vec![dispatch.compute.program.clone()])
            }
        };
        let Some(given) = own.as_ref().map(|buffer| buffer.size()).or(of_scene) else { continue };
        for program in programs {
            if let Some(declared) = declared_size(&program, storage::PUSH_CONSTANT) {
                add(notes, "the push constants", given, declared, &program);
            }
        }
    }
}
