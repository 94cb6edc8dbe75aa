//! Intersection shaders that read the ray in world space where the primitives of a transformed
//! instance are in object space.

use std::sync::Arc;

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::finding::{Finding, FindingKey, Findings};
use crate::levels::Levels;
use crate::rule::{Level, traversal};
use crate::structures::{StructureNames, instance_name, structure_of};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_engine::accel::{GeometryKind, Tlas, TlasInstance};
use anyhit_engine::machine::{OpIndex, ShaderIndex};
use anyhit_engine::module::Id;
use anyhit_engine::module::decoration::number;
use anyhit_engine::pipeline::Pipeline;
use anyhit_engine::program::Program;

/// `WorldRayOriginKHR`, `WorldRayDirectionKHR`, `ObjectRayOriginKHR`, `ObjectRayDirectionKHR`,
/// `ObjectToWorldKHR`, `WorldToObjectKHR`.
const WORLD_ORIGIN: u32 = 5321;
const WORLD_DIRECTION: u32 = 5322;
const OBJECT_ORIGIN: u32 = 5323;
const OBJECT_DIRECTION: u32 = 5324;
const MATRICES: [u32; 2] = [5330, 5331];

/// A builtin of the ray in world space that an intersection shader reads instead of the one in
/// object space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct WorldRead {
    /// Whether it is the direction, not the origin.
    pub is_direction: bool,
    /// The word of the first instruction that reads it.
    pub word: u32,
}

/// What intersection shaders read in world space alone, and what was reported of that.
#[derive(Debug, Default)]
pub(super) struct WorldReads {
    reads: FxHashMap<ShaderIndex, SmallVec<[WorldRead; 2]>>,
}

/// An instance whose boxes lead to an intersection shader.
#[derive(Clone, Copy, Debug)]
pub(super) struct Intersected<'a> {
    pub shader: ShaderIndex,
    pub tlas: &'a Arc<Tlas>,
    pub instance: u32,
    /// The launch index and the time of the ray; `None` where no ray has entered a box of it.
    pub ray: Option<([u32; 3], f32)>,
}

impl WorldReads {
    /// Reports what an intersection shader reads in world space alone, if that differs in an
    /// instance.
    pub(super) fn check(
        &mut self,
        pipeline: &Pipeline,
        names: &dyn StructureNames,
        levels: &Levels,
        intersected: Intersected<'_>,
        findings: &mut Findings,
    ) {
        let rule = &traversal::WORLD_RAY_IN_INTERSECTION;
        let (level, shader) = (levels.of(rule), intersected.shader);
        let Some(program) = pipeline.programs.get(shader.index()).filter(|_| level != Level::Allow) else {
            return;
        };
        let reads = self.reads.entry(shader).or_insert_with(|| reads_in_world_space(program));
        let instance = intersected.tlas.instances().get(intersected.instance as usize);
        let Some(instance) = instance.filter(|_| !reads.is_empty()) else { return };
        let [moves, turns] = moves_and_turns(instance, intersected.ray.map(|(_, time)| time));
        let launch_id = intersected.ray.map_or([0; 3], |(launch_id, _)| launch_id);
        for &read in reads.iter().filter(|read| turns || moves && !read.is_direction) {
            let key = FindingKey { rule: rule.id, places: [(shader, read.word), (ShaderIndex(u32::MAX), 0)] };
            // What no ray has entered is reported where nothing else is.
            if intersected.ray.is_none() && findings.knows(&key) {
                continue;
            }
            let new = (!findings.knows(&key)).then(|| {
                let error = report(program, names, intersected, read);
                let stack = vec![program.frame(shader, OpIndex(0))];
                Finding { rule, level, count: 0, launch_id, stack, error }
            });
            findings.add(key, 1, new);
            findings.note(&key, intersected.ray.iter().map(|&(launch_id, _)| launch_id));
        }
    }
}

/// The report of what an intersection shader reads in world space.
fn report(
    program: &Program,
    names: &dyn StructureNames,
    intersected: Intersected<'_>,
    read: WorldRead,
) -> Error {
    let ([world, object], structure) = (read.names(), structure_of(names, intersected.tlas));
    let instance = instance_name(names, structure, intersected.instance);
    let message = format!(
        "an intersection shader reads {world}, and not {object}, in {instance}, which is transformed"
    );
    let error = Error::new(ErrorKind::Finding, message);
    let line = program.place_at(read.word).or_else(|| program.place_near(read.word));
    let error = line.into_iter().fold(error, Error::at).at(Place::Word(read.word as usize));
    let place = structure.and_then(|at| names.instance_place(at, intersected.instance));
    let error = place.into_iter().fold(error, |error, place| error.at_with(place, "it is transformed here"));
    match intersected.ray {
        Some(([x, y, z], _)) => {
            error.note(format!("in {} `{}`, launch id ({x}, {y}, {z})", program.stage.name(), program.name))
        }
        None => error.note("no ray of the run enters a box of the instance"),
    }
}

/// Whether the transform of an instance moves the origin, and whether it changes directions: at a
/// time, or at any.
fn moves_and_turns(instance: &TlasInstance, time: Option<f32>) -> [bool; 2] {
    if instance.motion.is_some() && time.is_none() {
        return [true; 2];
    }
    let object_to_world = instance.object_to_world(time.unwrap_or_default());
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let moves = object_to_world.iter().any(|row| row[3] != 0.0);
    let turns = object_to_world.iter().zip(&identity).any(|(row, unit)| row[..3] != unit[..]);
    [moves, turns]
}

/// What an intersection shader reads of the ray in world space where it reads neither the same of
/// the ray in object space nor a transform.
fn reads_in_world_space(program: &Program) -> SmallVec<[WorldRead; 2]> {
    let reads = |number: u32| program.inputs.iter().any(|input| input.builtin.number == number);
    if MATRICES.into_iter().any(reads) {
        return SmallVec::new();
    }
    let pairs = [(WORLD_ORIGIN, OBJECT_ORIGIN, false), (WORLD_DIRECTION, OBJECT_DIRECTION, true)];
    let pairs = pairs.into_iter().filter(|&(world, object, _)| reads(world) && !reads(object));
    pairs
        .map(|(world, _, is_direction)| WorldRead {
            is_direction,
            word: first_read(program, world).unwrap_or_default(),
        })
        .collect()
}

/// The word of the first instruction that uses a builtin variable.
fn first_read(program: &Program, builtin: u32) -> Option<u32> {
    let module = &*program.module;
    let is_variable = |id: Id| module.decorations.literal(id, number::BUILT_IN) == Some(builtin);
    let variables: SmallVec<[Id; 2]> =
        module.variables.iter().map(|variable| variable.id).filter(|&id| is_variable(id)).collect();
    let mut instructions = module.instructions();
    let reader =
        instructions.find(|one| module.operand_ids(one).iter().any(|operand| variables.contains(operand)))?;
    Some(reader.offset)
}

impl WorldRead {
    /// The name of the builtin, and of the one that is meant.
    pub(super) fn names(self) -> [&'static str; 2] {
        if self.is_direction {
            ["WorldRayDirectionKHR", "ObjectRayDirectionKHR"]
        } else {
            ["WorldRayOriginKHR", "ObjectRayOriginKHR"]
        }
    }
}

/// The first instance, of each kind that rays have, whose boxes lead to an intersection shader and
/// that is not in world space.
pub(super) fn transformed_boxes<'a>(
    tlas: &'a Arc<Tlas>,
    lead: impl Fn(&TlasInstance, u32) -> Option<ShaderIndex>,
) -> Vec<Intersected<'a>> {
    let mut found: Vec<Intersected<'a>> = Vec::new();
    for (number, instance) in (0..).zip(tlas.instances()) {
        if instance.is_identity() || instance.blas.kind() != Some(GeometryKind::Aabbs) {
            continue;
        }
        for index in 0..instance.blas.geometries().len() as u32 {
            let Some(shader) = lead(instance, index) else { continue };
            if !found.iter().any(|known| known.shader == shader) {
                found.push(Intersected { shader, tlas, instance: number, ray: None });
            }
        }
    }
    found
}
