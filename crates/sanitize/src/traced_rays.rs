//! Rules about the rays that a run traces: which hit groups their hits lead to, and what of the
//! acceleration structures and groups no ray of the run ever comes to.

use anyhit_engine::module::Opcode;
use std::sync::Arc;

use crate::finding::{Finding, FindingKey, Findings, OccurrenceLog};
use crate::levels::Levels;
use crate::rule::{Level, Rule, structure, trace, traversal};
use crate::structures::{StructureNames, geometry_name, instance_name, structure_key, structure_of};
use crate::traversal_lints::{RayLint, TraversalLints};
use crate::world_reads::{Intersected, WorldReads, transformed_boxes};
use anyhit_base::error::{Error, ErrorKind, Place};
use anyhit_engine::accel::rules::{is_culled_by_opacity, is_opaque, is_skipped};
use anyhit_engine::accel::{
    Candidate, GeometryKind, HitKind, InstanceFlags, RayFlags, RecordIndex, Tlas, TlasInstance, TraceRay,
};
use anyhit_engine::machine::{RayQueryStep, ShaderIndex};
use anyhit_engine::ops::ray_tracing::MotionInstruction;
use anyhit_engine::pipeline::{
    Caller, Event, Group, HitGroup, Pipeline, PipelineObserver, source_line, with_location,
};

/// The flags of a ray that cull triangles by their facing.
const FACE_CULLS: u32 = RayFlags::CULL_BACK_FACING_TRIANGLES.0 | RayFlags::CULL_FRONT_FACING_TRIANGLES.0;
/// The flags of a ray that decide what geometry an any-hit shader sees.
const OPACITY: u32 = RayFlags::OPAQUE.0
    | RayFlags::NO_OPAQUE.0
    | RayFlags::CULL_OPAQUE.0
    | RayFlags::CULL_NO_OPAQUE.0
    | RayFlags::SKIP_TRIANGLES.0
    | RayFlags::SKIP_AABBS.0;

/// What rays of one structure have in common.
#[derive(Clone, Debug)]
struct SeenStructure {
    tlas: Arc<Tlas>,
    /// All cull masks, combined by |.
    masks: u32,
    /// The pairs of SBT stride and SBT offset, with the flags that decide on opacity.
    kinds: Vec<RayKind>,
    /// Whether it has triangles, none of which any ray culls by its facing.
    is_never_culled: bool,
}

/// What of a ray chooses hit groups and opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
struct RayKind {
    flags: RayFlags,
    stride: u32,
    offset: u32,
}

/// What rays of one pipeline or compute shader have been, all launches together.
#[derive(Clone, Debug, Default)]
pub struct SeenRays {
    structures: Vec<SeenStructure>,
}

impl SeenRays {
    /// Notes a ray, and returns its structure.
    fn add(&mut self, tlas: &Arc<Tlas>, ray: &TraceRay, kind: Option<RayKind>) -> &SeenStructure {
        let at = self.structures.iter().position(|known| Arc::ptr_eq(&known.tlas, tlas));
        let at = at.unwrap_or_else(|| {
            self.structures.push(SeenStructure::new(tlas));
            self.structures.len() - 1
        });
        let seen = &mut self.structures[at];
        seen.masks |= ray.cull_mask & 0xFF;
        // Most rays are of the kind before.
        if let Some(kind) = kind.filter(|kind| seen.kinds.last() != Some(kind))
            && !seen.kinds.contains(&kind)
        {
            seen.kinds.push(kind);
        }
        seen
    }

    /// Adds the rays that were traced behind these.
    pub fn merge(&mut self, later: &Self) {
        for other in &later.structures {
            let known = self.structures.iter_mut().find(|known| Arc::ptr_eq(&known.tlas, &other.tlas));
            let Some(known) = known else {
                self.structures.push(other.clone());
                continue;
            };
            known.masks |= other.masks;
            for kind in &other.kinds {
                if !known.kinds.contains(kind) {
                    known.kinds.push(*kind);
                }
            }
        }
    }

    /// Notes the ray of a query, if the event is that one begins.
    pub fn add_event(&mut self, event: &Event) {
        if let Event::RayQuery(event) = event
            && let RayQueryStep::Initialize(tlas, ray) = &event.step
        {
            self.add(tlas, ray, None);
        }
    }

    /// The structures in which rays were traced.
    pub fn structures(&self) -> impl Iterator<Item = &Arc<Tlas>> {
        self.structures.iter().map(|seen| &seen.tlas)
    }

    /// Tells of instances whose mask no ray of any of these has met.
    pub fn check_masks(all: &[&Self], names: &dyn StructureNames, levels: &Levels) -> Findings {
        let rule = &structure::AS_MASK_ZERO;
        let mut findings = Findings::default();
        let level = levels.of(rule);
        if level == Level::Allow {
            return findings;
        }
        for (at, (_, tlas)) in names.structures().iter().enumerate() {
            let seen = all.iter().flat_map(|rays| &rays.structures);
            let masks = seen.filter(|seen| Arc::ptr_eq(&seen.tlas, tlas)).map(|seen| seen.masks);
            let Some(masks) = masks.reduce(|all, masks| all | masks) else { continue };
            for (number, instance) in (0..).zip(tlas.instances()) {
                let mask = u32::from(instance.mask);
                if mask == 0 || mask & masks != 0 || instance.blas.geometries().is_empty() {
                    continue;
                }
                let name = instance_name(names, Some(at), number);
                let message = format!("no ray of the run meets {name}, whose mask is {mask:#x}");
                let error = Error::new(ErrorKind::Finding, message);
                let error = names.instance_place(at, number).into_iter().fold(error, Error::at);
                let error = error.note(format!("the combined cull mask of all rays is {masks:#x}"));
                let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
                findings.add(structure_key(rule, at, number), 1, Some(finding));
            }
        }
        findings
    }

    /// Tells of any-hit shaders that no geometry can call, as all that leads to them is opaque to
    /// each of these rays.
    pub fn check_any_hit(
        &self,
        pipeline: &Pipeline,
        names: &dyn StructureNames,
        levels: &Levels,
    ) -> Findings {
        let rule = &structure::ANYHIT_OPAQUE;
        let mut findings = Findings::default();
        let level = levels.of(rule);
        if level == Level::Allow {
            return findings;
        }
        for (shader, reach) in self.any_hit_shaders(pipeline) {
            let Reach::OpaqueOnly(reason) = reach else { continue };
            let program = &pipeline.programs[shader.index()];
            let message = format!(
                "the any-hit shader `{}` never runs: all geometry that leads to it is opaque",
                program.name
            );
            let error = Error::new(ErrorKind::Finding, message);
            let error = match program.module.debug_info.files.first().filter(|file| !file.name.is_empty()) {
                Some(file) => error.at(Place::Line { file: file.name.clone(), line: 1, column: 0 }),
                None => error,
            };
            let structure = structure_of(names, &reason.tlas);
            let name = geometry_name(names, structure, reason.instance, reason.geometry as usize);
            let error = error.note(format!("{name} is opaque due to a flag of {}", reason.by));
            let key = FindingKey { rule: rule.id, places: [(shader, 0), (shader, 0)] };
            let finding = Finding { rule, level, count: 0, launch_id: [0; 3], stack: Vec::new(), error };
            findings.add(key, 1, Some(finding));
        }
        findings
    }

    /// The any-hit shaders of a pipeline to which geometry leads.
    fn any_hit_shaders(&self, pipeline: &Pipeline) -> Vec<(ShaderIndex, Reach)> {
        let mut reached: Vec<(ShaderIndex, Reach)> = Vec::new();
        let has_any_hit = |group: &Group| matches!(group, Group::Hit(HitGroup { any_hit: Some(_), .. }));
        if !pipeline.groups.iter().any(has_any_hit) {
            return reached;
        }
        for seen in &self.structures {
            for &kind in &seen.kinds {
                for (number, instance) in (0..).zip(seen.tlas.instances()) {
                    for index in 0..instance.blas.geometries().len() as u32 {
                        let Some((shader, opaque)) = kind.any_hit(pipeline, instance, index) else {
                            continue;
                        };
                        let known = reached.iter_mut().find(|(known, _)| *known == shader);
                        match (known, opaque) {
                            (Some(_), true) => {}
                            (Some((_, known)), false) => *known = Reach::Runs,
                            (None, false) => reached.push((shader, Reach::Runs)),
                            (None, true) => {
                                let by = match () {
                                    () if kind.flags.contains(RayFlags::OPAQUE) => "the ray",
                                    () if instance.flags.contains(InstanceFlags::FORCE_OPAQUE) => {
                                        "the instance"
                                    }
                                    () => "the geometry",
                                };
                                let tlas = seen.tlas.clone();
                                let opaque = OpaqueGeometry { tlas, instance: number, geometry: index, by };
                                reached.push((shader, Reach::OpaqueOnly(opaque)));
                            }
                        }
                    }
                }
            }
        }
        reached
    }
}

impl RayKind {
    /// The hit group to which a geometry leads rays of this kind.
    fn hit_group(self, pipeline: &Pipeline, instance: &TlasInstance, index: u32) -> Option<HitGroup> {
        let record = RecordIndex::of_hit(instance.sbt_record_offset, index, self.stride, self.offset);
        pipeline.hit_group(record)
    }

    /// The any-hit shader to which a geometry leads rays of this kind, and whether the geometry is
    /// opaque to them; `None` also where they cull it.
    fn any_hit(
        self,
        pipeline: &Pipeline,
        instance: &TlasInstance,
        index: u32,
    ) -> Option<(ShaderIndex, bool)> {
        let shader = self.hit_group(pipeline, instance, index)?.any_hit?;
        let geometry = &instance.blas.geometries()[index as usize];
        let flags = self.flags | RayFlags(pipeline.flags.ray_flags());
        if is_skipped(flags, geometry.data.kind()) {
            return None;
        }
        // A micromap stands in place of the flags, and may be of any opacity.
        if geometry.opacity_micromap.is_some()
            && !instance.flags.contains(InstanceFlags::DISABLE_OPACITY_MICROMAPS)
        {
            return Some((shader, false));
        }
        let opaque = is_opaque(flags, instance.flags, geometry.flags);
        (!is_culled_by_opacity(flags, opaque)).then_some((shader, opaque))
    }
}

/// What geometry leads to an any-hit shader.
#[derive(Clone, Debug)]
enum Reach {
    /// Some that is not opaque.
    Runs,
    /// Opaque geometry alone.
    OpaqueOnly(OpaqueGeometry),
}

/// A geometry that is opaque, and why.
#[derive(Clone, Debug)]
struct OpaqueGeometry {
    tlas: Arc<Tlas>,
    instance: u32,
    geometry: u32,
    by: &'static str,
}

impl SeenStructure {
    fn new(tlas: &Arc<Tlas>) -> Self {
        let mut triangles =
            tlas.instances().iter().filter(|one| one.blas.kind() == Some(GeometryKind::Triangles)).peekable();
        let is_never_culled = triangles.peek().is_some()
            && triangles.all(|one| one.flags.contains(InstanceFlags::TRIANGLE_FACING_CULL_DISABLE));
        Self { tlas: tlas.clone(), masks: 0, kinds: Vec::new(), is_never_culled }
    }
}

/// A ray in progress.
#[derive(Clone, Debug)]
struct ActiveRay {
    launch_id: [u32; 3],
    caller: Option<Caller>,
    tlas: Arc<Tlas>,
    trace: TraceRay,
    /// SBT offset, SBT stride and miss index.
    sbt: [u32; 3],
}

/// Watches the rays of a pipeline by the events of its launches.
#[derive(Debug)]
pub struct RayWatch<'a> {
    pipeline: &'a Pipeline,
    names: &'a dyn StructureNames,
    levels: &'a Levels,
    seen: &'a mut SeenRays,
    findings: Findings,
    /// The innermost trace last.
    active: Vec<ActiveRay>,
    lints: TraversalLints,
    world_reads: WorldReads,
}

/// What a [`RayWatch`] knows of a launch that is paused.
#[derive(Debug, Default)]
pub struct PausedRayWatch {
    findings: Findings,
    active: Vec<ActiveRay>,
    lints: TraversalLints,
    world_reads: WorldReads,
}

impl<'a> RayWatch<'a> {
    /// Watches one launch, and notes its rays beside those of others.
    pub fn new(
        pipeline: &'a Pipeline,
        names: &'a dyn StructureNames,
        levels: &'a Levels,
        seen: &'a mut SeenRays,
    ) -> Self {
        Self::of_paused(pipeline, names, levels, seen, PausedRayWatch::default())
    }

    /// A watch that goes on with a launch that was paused.
    pub fn of_paused(
        pipeline: &'a Pipeline,
        names: &'a dyn StructureNames,
        levels: &'a Levels,
        seen: &'a mut SeenRays,
        paused: PausedRayWatch,
    ) -> Self {
        let PausedRayWatch { findings, active, lints, world_reads } = paused;
        Self { pipeline, names, levels, seen, findings, active, lints, world_reads }
    }

    /// What is kept of it while the launch is paused.
    pub fn pause(self) -> PausedRayWatch {
        let Self { findings, active, lints, world_reads, .. } = self;
        PausedRayWatch { findings, active, lints, world_reads }
    }

    /// What was found.
    pub fn into_findings(self) -> Findings {
        self.findings
    }

    /// What was found in a whole launch: also about boxes that no ray has entered.
    pub fn into_findings_of_launch(mut self) -> Findings {
        let Self { pipeline, names, levels, seen, findings, world_reads, .. } = &mut self;
        for seen in &seen.structures {
            let lead = |instance: &TlasInstance, index: u32| {
                seen.kinds.iter().find_map(|kind| kind.hit_group(pipeline, instance, index)?.intersection)
            };
            for intersected in transformed_boxes(&seen.tlas, lead) {
                world_reads.check(pipeline, *names, levels, intersected, findings);
            }
        }
        self.findings
    }

    /// Checks that the hit group of a candidate is for its kind of primitive.
    fn check_group(&mut self, launch_id: [u32; 3], candidate: &Candidate, record: RecordIndex) {
        let Some(group) = self.pipeline.hit_group(record) else { return };
        // A group without shaders does what a null record does.
        if group == HitGroup::default() || group.intersection.is_some() == candidate.is_box() {
            return;
        }
        let (rule, what, wrong) = match candidate.is_box() {
            true => (&structure::SBT_PROCEDURAL_GROUP, "a box", "has no intersection shader"),
            false => (
                &structure::SBT_TRIANGLES_GROUP,
                match candidate.hit_kind() {
                    Some(HitKind::SPHERE) => "a sphere",
                    Some(HitKind::LINEAR_SWEPT_SPHERE) => "a linear swept sphere",
                    _ => "a triangle",
                },
                "has an intersection shader",
            ),
        };
        let part = u32::try_from(record.0).unwrap_or(u32::MAX);
        let names = self.names;
        let ray = self.ray(launch_id).cloned();
        self.tell(rule, launch_id, part, || {
            let message = format!("{what} leads to hit record {record}, whose group {wrong}");
            let Some(ray) = ray else { return (message, Vec::new()) };
            let structure = structure_of(names, &ray.tlas);
            let &Candidate { instance, geometry, primitive, .. } = candidate;
            let offset = candidate.instance_in(&ray.tlas).sbt_record_offset;
            let notes = vec![
                format!(
                    "it is primitive {primitive} of {} in {}",
                    geometry_name(names, structure, instance, geometry as usize),
                    instance_name(names, structure, instance)
                ),
                format!(
                    "{record} = instance offset {offset} + geometry {geometry} * stride {} + offset {}",
                    ray.sbt[1] & 0xF,
                    ray.sbt[0] & 0xF
                ),
            ];
            (message, notes)
        });
    }

    /// Reports a lint of the innermost ray of an invocation.
    fn tell_lint(&mut self, launch_id: [u32; 3], lint: &RayLint) {
        let rule = match lint {
            RayLint::FromSurface(_) => &traversal::RAY_FROM_SURFACE,
            RayLint::LosesTime(_) => &traversal::RAY_LOSES_TIME,
        };
        let (names, tlas) = (self.names, self.ray(launch_id).map(|ray| ray.tlas.clone()));
        let Some(tlas) = tlas else { return };
        self.tell(rule, launch_id, 0, || lint.words(names, &tlas));
    }

    /// Whether an instruction traces at a time.
    fn has_time(&self, caller: Caller) -> bool {
        let program = &self.pipeline.programs[caller.shader.index()];
        let offset = program.origins.get(caller.op.index()).map(|origin| origin.offset as usize);
        let head = offset.and_then(|offset| program.module.words.get(offset));
        head.is_some_and(|&head| MotionInstruction::of(Opcode::of_word(head)).is_some())
    }

    /// The innermost ray of an invocation.
    fn ray(&self, launch_id: [u32; 3]) -> Option<&ActiveRay> {
        self.active.iter().rev().find(|ray| ray.launch_id == launch_id)
    }

    /// Tells that the innermost ray of an invocation breaks a rule, once for each instruction that
    /// traces and each part.
    fn tell(
        &mut self,
        rule: &'static Rule,
        launch_id: [u32; 3],
        part: u32,
        told: impl FnOnce() -> (String, Vec<String>),
    ) {
        let level = self.levels.of(rule);
        if level == Level::Allow {
            return;
        }
        let caller = self.ray(launch_id).and_then(|ray| ray.caller);
        let program = caller.map(|caller| (&self.pipeline.programs[caller.shader.index()], caller));
        let place = program.map_or((ShaderIndex(u32::MAX), 0), |(program, caller)| {
            (caller.shader, program.origins.get(caller.op.index()).map_or(0, |origin| origin.offset))
        });
        let key = FindingKey { rule: rule.id, places: [place, (ShaderIndex(u32::MAX), part)] };
        let new = (!self.findings.knows(&key)).then(|| {
            let (message, notes) = told();
            let mut error = Error::new(ErrorKind::Finding, message);
            if let Some((program, caller)) = program {
                error = with_location(program, caller.op, error, "this ray");
            }
            error = notes.into_iter().fold(error, Error::note);
            let mut stack = Vec::new();
            for ray in self.active.iter().rev().filter(|ray| ray.launch_id == launch_id) {
                let Some(Caller { shader, op, .. }) = ray.caller else { continue };
                let program = &self.pipeline.programs[shader.index()];
                let (stage, name) = (program.stage.name(), &program.name);
                error = match stack.is_empty() {
                    true => {
                        error.note(format!("in {stage} `{name}`, {}", program.describe_invocation(launch_id)))
                    }
                    false => error.note(format!("called by {stage} `{name}`{}", source_line(program, op))),
                };
                stack.push(program.frame(shader, op));
            }
            Finding { rule, level, count: 0, launch_id, stack, error }
        });
        self.findings.add(key, 1, new);
        self.findings.note(&key, std::iter::once(launch_id));
    }
}

impl PausedRayWatch {
    /// One that has seen nothing yet, and notes each time that a ray meets a finding.
    pub fn noting_occurrences(log: &OccurrenceLog) -> Self {
        let mut paused = Self::default();
        paused.findings.note_occurrences(log);
        paused
    }

    /// What was found so far.
    pub fn findings(&self) -> &Findings {
        &self.findings
    }
}

impl PipelineObserver for RayWatch<'_> {
    fn observes_traversal(&self) -> bool {
        false
    }

    fn invocation(&mut self, launch_id: [u32; 3]) {
        self.lints.invocation(launch_id);
    }

    fn event(&mut self, event: Event) {
        self.lints.shader(&event);
        match event {
            Event::Trace { caller, tlas, launch_id, trace, sbt, .. } => {
                let [offset, stride, _] = sbt;
                let kind = RayKind {
                    flags: RayFlags(trace.flags.0 & OPACITY),
                    stride: stride & 0xF,
                    offset: offset & 0xF,
                };
                let is_never_culled = self.seen.add(&tlas, &trace, Some(kind)).is_never_culled;
                let (has_micromaps, moves) = (tlas.has_micromaps(), tlas.moves());
                let has_time = caller.map_or(trace.time != 0.0, |caller| self.has_time(caller));
                let lints = self.lints.trace(launch_id, &tlas, &trace, has_time);
                self.active.push(ActiveRay { launch_id, caller, tlas, trace, sbt });
                for lint in lints {
                    self.tell_lint(launch_id, &lint);
                }
                if is_never_culled && trace.flags.0 & FACE_CULLS != 0 {
                    self.tell(&structure::AS_CULL_DISABLED, launch_id, 0, || {
                        let message = "a ray culls triangles by their facing, which all instances disable";
                        (message.to_owned(), Vec::new())
                    });
                }
                if !moves && caller.is_some_and(|caller| self.has_time(caller)) {
                    self.tell(&trace::RAY_MOTION_NEEDS_AS, launch_id, 0, || {
                        let message = "a ray has a time, and nothing moves in its acceleration structure";
                        (message.to_owned(), Vec::new())
                    });
                }
                if has_micromaps && !self.pipeline.flags.opacity_micromap {
                    self.tell(&structure::PIPE_MICROMAP_FLAG, launch_id, 0, || {
                        let message = "a pipeline that is not made for opacity micromaps traces some";
                        (message.to_owned(), Vec::new())
                    });
                }
            }
            Event::Candidate { launch_id, candidate, record, shader, .. } => {
                self.check_group(launch_id, &candidate, record);
                let ray = self.active.iter().rev().find(|ray| ray.launch_id == launch_id);
                if let (Some(shader), Some(ray), true) = (shader, ray, candidate.is_box()) {
                    let Candidate { instance, .. } = candidate;
                    let ray_of = Some((launch_id, ray.trace.time));
                    let intersected = Intersected { shader, tlas: &ray.tlas, instance, ray: ray_of };
                    let Self { pipeline, names, levels, findings, world_reads, .. } = self;
                    world_reads.check(pipeline, *names, levels, intersected, findings);
                }
            }
            Event::Traversed { launch_id, committed, record, shader, to_hit_object } => {
                if let (Some(hit), Some(_)) = (committed, shader) {
                    self.check_group(launch_id, &hit.candidate, record);
                }
                if let Some(ActiveRay { tlas, trace, .. }) = self.ray(launch_id).cloned() {
                    self.lints.traversed(launch_id, &tlas, &trace, committed.as_ref(), to_hit_object);
                }
            }
            Event::Traced { .. } => {
                if let Some(ray) = self.active.pop() {
                    self.lints.traced(ray.launch_id);
                }
            }
            event @ Event::RayQuery(_) => self.seen.add_event(&event),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::accel::{Blas, Geometry, GeometryData, GeometryFlags};
    use anyhit_engine::geometry::Ray;

    /// A structure of triangles with the given flags of their instances.
    fn triangles(flags: &[InstanceFlags]) -> Arc<Tlas> {
        let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let data = GeometryData::Triangles { vertices, indices: None, transform: None };
        let blas = Blas::new(vec![Geometry::new(data, GeometryFlags::default())]).expect("a triangle");
        let transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let instance =
            |&flags: &InstanceFlags| TlasInstance { flags, ..TlasInstance::of(blas.clone(), transform) };
        Tlas::new(flags.iter().map(instance).collect()).expect("instances")
    }

    fn ray(cull_mask: u32) -> TraceRay {
        let ray = Ray { origin: [0.0; 3], t_min: 0.0, direction: [0.0, 0.0, 1.0], t_max: 1.0 };
        TraceRay { ray, flags: RayFlags::default(), cull_mask, time: 0.0 }
    }

    #[test]
    fn rays_are_noted_by_structure_and_kind() {
        let [one, other] = [triangles(&[InstanceFlags(0)]), triangles(&[InstanceFlags(0)])];
        let mut seen = SeenRays::default();
        let kind = |offset| Some(RayKind { flags: RayFlags::OPAQUE, stride: 1, offset });
        for (tlas, mask, kind) in
            [(&one, 0x101, kind(0)), (&other, 4, None), (&one, 2, kind(1)), (&one, 2, kind(0))]
        {
            seen.add(tlas, &ray(mask), kind);
        }
        let found: Vec<_> = seen.structures.iter().map(|one| (one.masks, one.kinds.len())).collect();
        assert_eq!(found, [(3, 2), (4, 0)]);
    }

    #[test]
    fn rays_of_parts_are_those_of_the_whole() {
        let structures = [triangles(&[InstanceFlags(0)]), triangles(&[InstanceFlags(0)])];
        let kind = |offset| Some(RayKind { flags: RayFlags::OPAQUE, stride: 1, offset });
        let rays = [(0, 1, 0), (0, 2, 3), (1, 4, 1), (0, 1, 1), (1, 8, 2), (0, 16, 3)];
        let add = |seen: &mut SeenRays, &(at, mask, offset): &(usize, u32, u32)| {
            seen.add(&structures[at], &ray(mask), kind(offset));
        };
        let mut whole = SeenRays::default();
        rays.iter().for_each(|ray| add(&mut whole, ray));
        let mut merged = SeenRays::default();
        for part in rays.chunks(2) {
            let mut seen = SeenRays::default();
            part.iter().for_each(|ray| add(&mut seen, ray));
            merged.merge(&seen);
        }
        let content = |seen: &SeenRays| -> Vec<_> {
            seen.structures.iter().map(|one| (Arc::as_ptr(&one.tlas), one.masks, one.kinds.clone())).collect()
        };
        assert_eq!(content(&merged), content(&whole));
    }

    #[test]
    fn culling_has_no_effect_where_every_instance_of_triangles_disables_it() {
        let disabled = InstanceFlags::TRIANGLE_FACING_CULL_DISABLE;
        let never = |flags: &[InstanceFlags]| SeenStructure::new(&triangles(flags)).is_never_culled;
        assert!(never(&[disabled, disabled]));
        assert!(!never(&[disabled, InstanceFlags(0)]));
        assert!(!never(&[]));
    }
}
