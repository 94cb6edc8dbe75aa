//! Changes of a loaded scene, which are made again where it is read again.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use crate::loaded_scene::{invalid, unknown};
use anyhit_base::error::{Error, Result};
use anyhit_engine::accel::motion::Motion;
use anyhit_engine::accel::{Tlas, TlasInstance};
use anyhit_engine::machine::Binding;
use anyhit_engine::module::ty::TypeId;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;
use anyhit_engine::reflect::{Layout, Rules};
use anyhit_scene::resolved::{ResolvedGroup, ResolvedRecord, ShaderCode};
use anyhit_scene::resources::Resource;
use anyhit_scene::{Assembled, ResolvedScene};
use anyhit_unit_test::bound::blocks;
use anyhit_unit_test::data::HostBytes;
use anyhit_unit_test::fit::check_block;

/// A change of a scene.
#[derive(Clone)]
pub(super) enum Change {
    Buffer(String, HostBytes),
    PushConstants(HostBytes),
    ShaderRecord(String, HostBytes),
    Transform(usize, [[f32; 4]; 3]),
    Motion(usize, Motion),
    Shader(String, PathBuf, ShaderCode),
    MaxRecursion(u32),
}

impl fmt::Debug for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Buffer(name, bytes) => write!(f, "buffer `{name}` of {} bytes", bytes.bytes.len()),
            Self::PushConstants(bytes) => write!(f, "push constants of {} bytes", bytes.bytes.len()),
            Self::ShaderRecord(name, bytes) => {
                write!(f, "shader record `{name}` of {} bytes", bytes.bytes.len())
            }
            Self::Transform(instance, rows) => write!(f, "transform of instance {instance}: {rows:?}"),
            Self::Motion(instance, motion) => write!(f, "motion of instance {instance}: {motion:?}"),
            Self::Shader(name, _, code) => write!(f, "shader `{name}`: {code:?}"),
            Self::MaxRecursion(depth) => write!(f, "recursion depth {depth}"),
        }
    }
}

impl Change {
    pub(super) fn apply(&self, scene: &mut ResolvedScene) -> Result<()> {
        match self {
            Self::Buffer(name, given) => {
                scene.keep_addresses();
                let ResolvedScene { resources, unbound, .. } = scene;
                let names = resources.iter().filter(|one| one.resource.data().is_some());
                let names = names.map(|one| one.name.as_str());
                let names = names.chain(unbound.iter().map(|one| one.name.as_str()));
                let unknown = unknown("buffer", name, names);
                let bound = resources.iter_mut().find_map(|one| match &mut one.resource {
                    Resource::StorageBuffer(content) | Resource::UniformBuffer(content) => {
                        (one.name == *name).then_some(content)
                    }
                    _ => None,
                });
                let mut unbound = unbound.iter_mut();
                let unbound = || unbound.find(|one| one.name == *name).map(|one| &mut one.data);
                *bound.or_else(unbound).ok_or(unknown)? = given.bytes.clone().into();
            }
            Self::PushConstants(given) => {
                scene.keep_addresses();
                scene.push_constants = given.bytes.clone().into();
            }
            Self::ShaderRecord(name, given) => {
                scene.keep_addresses();
                record(scene, name)?.data = given.bytes.clone().into();
            }
            Self::Transform(instance, rows) => {
                change_instance(scene, *instance, |found| (found.transform, found.motion) = (*rows, None))?;
            }
            Self::Motion(instance, motion) => {
                change_instance(scene, *instance, |found| found.motion = Some(motion.clone()))?;
            }
            Self::Shader(name, path, code) => {
                let unknown = unknown("shader", name, scene.shaders.iter().map(|one| one.name.as_str()));
                let index = scene.shaders.iter().position(|one| one.name == *name).ok_or(unknown)?;
                // Data may have been laid out by the module that was there.
                scene.loaded.remove(&index);
                let shader = &mut scene.shaders[index];
                shader.path.clone_from(path);
                shader.code.clone_from(code);
            }
            Self::MaxRecursion(depth) => {
                scene.all_pipelines_mut().for_each(|one| one.max_recursion_depth = Some(*depth));
            }
        }
        Ok(())
    }

    /// Compares data with what shaders declare.
    ///
    /// # Errors
    /// `InvalidArgument` with both layouts.
    pub(super) fn check(&self, scene: &ResolvedScene, assembled: &Assembled) -> Result<()> {
        let compare = |program: &Arc<Program>, ty: TypeId, what: &str, given: &HostBytes| {
            let layout = Layout::new(&program.module, ty, Rules::Explicit);
            check_block(layout, what, &given.rust, &|| given.bytes.clone())
        };
        match self {
            Self::Buffer(name, given) => {
                let Some(found) = scene.resources.iter().find(|one| one.name == *name) else { return Ok(()) };
                let kept = Binding { set: found.set, binding: found.binding };
                for (program, at) in assembled.readers_of(kept) {
                    for (ty, ..) in blocks(program).filter(|block| block.2 == Some(at)) {
                        compare(program, ty, &format!("the buffer `{name}`"), given)?;
                    }
                }
            }
            Self::PushConstants(given) => {
                for program in assembled.programs() {
                    for ty in blocks_in(program, storage::PUSH_CONSTANT) {
                        compare(program, ty, "the push constants", given)?;
                    }
                }
            }
            Self::ShaderRecord(name, given) => {
                // That of any shader: a record says which one runs by its handle.
                let blocks = assembled.programs().flat_map(|program| {
                    blocks_in(program, storage::SHADER_RECORD_BUFFER).map(move |ty| (program, ty))
                });
                let what = format!("the shader record `{name}`");
                let judged: Vec<_> = blocks.map(|(program, ty)| compare(program, ty, &what, given)).collect();
                if judged.iter().all(Result::is_err) {
                    judged.into_iter().next().unwrap_or(Ok(()))?;
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// The types of the blocks of a program in a storage class.
fn blocks_in(program: &Program, class: u32) -> impl Iterator<Item = TypeId> + '_ {
    blocks(program).filter(move |block| block.1 == class).map(|(ty, ..)| ty)
}

pub(super) fn change_instance(
    scene: &mut ResolvedScene,
    instance: usize,
    change: impl FnOnce(&mut TlasInstance),
) -> Result<()> {
    let count = scene.tlas.first().map_or(0, |(_, tlas)| tlas.instances().len());
    let Some((_, tlas)) = scene.tlas.first_mut().filter(|_| instance < count) else {
        return Err(no_instance(instance, count));
    };
    let mut instances: Vec<TlasInstance> = tlas.instances().to_vec();
    change(&mut instances[instance]);
    *tlas = Tlas::with_precision(instances, tlas.precision())
        .map_err(|error| error.context(format!("instance {instance}")))?;
    Ok(())
}

pub(super) fn no_instance(instance: usize, count: usize) -> Error {
    invalid(format!("the scene has no instance {instance}, only {count}"))
}

/// The shader record with a name, or with a shader of that name.
fn record<'s>(scene: &'s mut ResolvedScene, wanted: &str) -> Result<&'s mut ResolvedRecord> {
    // Each record: the pipeline, the table and the place in it, its name and those of its shaders.
    let mut known: Vec<([usize; 3], Option<&str>, Vec<&str>)> = Vec::new();
    for (at, pipeline) in scene.all_pipelines().enumerate() {
        for (table, records) in pipeline.sbt.tables().into_iter().enumerate() {
            for (place, record) in records.iter().enumerate() {
                let group = record.group.map(|group| &pipeline.groups[group]);
                let shaders = group.into_iter().flat_map(ResolvedGroup::shaders);
                let shaders = shaders.map(|shader| &*scene.shaders[shader.module].name).collect();
                known.push(([at, table, place], record.name.as_deref(), shaders));
            }
        }
    }
    let named: Vec<_> = known.iter().filter(|(_, name, _)| *name == Some(wanted)).collect();
    let found = match named.is_empty() {
        false => named,
        true => known.iter().filter(|(.., shaders)| shaders.contains(&wanted)).collect(),
    };
    let [(at, ..)] = &found[..] else {
        if found.is_empty() {
            let names = known.iter().flat_map(|(_, name, shaders)| match name {
                Some(name) => vec![*name],
                None => shaders.clone(),
            });
            return Err(unknown("shader record", wanted, names));
        }
        let message = format!("the scene has {} shader records `{wanted}`", found.len());
        return Err(invalid(message).note("distinguish them by the `name` of each record in the pipeline"));
    };
    let [pipeline, table, place] = *at;
    let pipeline = scene.all_pipelines_mut().nth(pipeline);
    let sbt = &mut pipeline.expect("bug in anyhit: a record belongs to no pipeline").sbt;
    Ok(&mut sbt.tables_mut()[table][place])
}
