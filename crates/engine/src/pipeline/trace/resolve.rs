//! The decisions of a trace's shaders, and its end: takes over what any-hit and intersection
//! shaders decide, finds the closest-hit and miss shaders that its rays call, and elides those
//! without effect.

use smallvec::SmallVec;

use crate::accel::{Candidate, Committed, HitKind, RayFlags, RecordIndex};
use crate::machine::invocation::Invocations;
use crate::machine::stop::RegSpan;
use crate::machine::{Batch, Exit, HitRecordTerms, Lanes, Mask, Registers, ShaderIndex, TrapCode};
use crate::math::array;
use crate::pipeline::Pipeline;
use crate::pipeline::group::Role;
use crate::pipeline::observer::{Caller, Event, EventReceiver};
use crate::pipeline::sbt::{SbtRecord, is_beyond_end};
use crate::pipeline::trace::{Trace, Words, general_shader, hit_group_at, record_at};

impl<const W: usize> Trace<W> {
    /// Calls the closest-hit or miss shader of each ray, unless it can be elided.
    pub(super) fn begin_hit_or_miss(
        &mut self,
        pipeline: &Pipeline,
        mut payload: Option<(&mut Registers<W>, RegSpan)>,
        observer: &mut EventReceiver<'_>,
    ) {
        let mut groups: SmallVec<[(Role, RecordIndex, Mask<W>); 4]> = SmallVec::new();
        for lane in self.lanes.without(self.trapped_lanes).lanes() {
            let (role, index) = match &self.committed[lane] {
                Some(_) if self.from_hit_objects => (Role::ClosestHit, self.record_indices[lane]),
                Some(committed) => (Role::ClosestHit, self.hit_record_index(lane, &committed.candidate)),
                None if self.from_hit_objects => (Role::Miss, self.record_indices[lane]),
                None => (Role::Miss, self.miss_record_index(lane)),
            };
            self.record_indices[lane] = index;
            match groups.iter_mut().find(|group| (group.0, group.1) == (role, index)) {
                Some(group) => group.2 = group.2 | Mask::lane(lane),
                None => groups.push((role, index, Mask::lane(lane))),
            }
        }
        for (role, index, lanes) in groups {
            let HitOrMissShader { shader, has_any_hit, is_empty, writes_only_unread } =
                self.hit_or_miss_shader(pipeline, role, index);
            let mut skipped = Mask::NONE;
            if role == Role::ClosestHit {
                let skips =
                    |lane| RayFlags(self.rays.flags.0[lane]).contains(RayFlags::SKIP_CLOSEST_HIT_SHADER);
                skipped = lanes & Mask::from_fn(skips);
            }
            // The lanes whose shader record is used.
            let called = if self.invokes_hit_or_miss { lanes.without(skipped) } else { Mask::NONE };
            if has_any_hit {
                let is_opaque = |hit: &Committed| hit.candidate.opaque;
                let opaque = |lane: &usize| self.committed[*lane].as_ref().is_some_and(is_opaque);
                self.stats.elided.any_hit += lanes.lanes().filter(opaque).count() as u64;
            }
            if let Some(observer) = observer
                && !self.from_hit_objects
                && !observer.counts_tests()
            {
                for lane in lanes.lanes() {
                    let shader = shader.filter(|_| called.contains(lane));
                    let (committed, to_hit_object) = (self.committed[lane], !self.invokes_hit_or_miss);
                    let launch_id = self.launch_id(lane);
                    observer.invocation(launch_id);
                    let record = index;
                    observer.event(Event::Traversed { launch_id, committed, record, shader, to_hit_object });
                }
            }
            let missing_trap = match role {
                Role::Miss if is_beyond_end(&pipeline.sbt.miss, index) => Some(TrapCode::MissRecordMissing),
                Role::Miss => pipeline.flags.no_null_miss_shaders.then_some(TrapCode::NullMiss),
                _ if is_beyond_end(&pipeline.sbt.hit, index) => Some(TrapCode::HitRecordMissing),
                _ => pipeline.flags.no_null_closest_hit_shaders.then_some(TrapCode::NullClosestHit),
            };
            match (shader, missing_trap) {
                (Some(shader), _) if !self.payload_matches(pipeline, shader) => {
                    called.lanes().for_each(|lane| self.trap_payload_mismatch(lane, shader));
                }
                (Some(shader), _) if observer.is_none() && is_empty => {
                    self.stats.elide(pipeline.programs[shader.index()].stage, called.count());
                }
                (Some(shader), _) if !self.observed && writes_only_unread => {
                    self.stats.elide_unread(pipeline.programs[shader.index()].stage, called.count());
                }
                (Some(shader), _) => self.enqueue_call(shader, role, called),
                (None, Some(code)) => {
                    for lane in called.lanes() {
                        let candidate = self.committed[lane].as_ref().map(|committed| committed.candidate);
                        self.trap_at_record(lane, code, candidate.as_ref());
                    }
                }
                (None, None) => {
                    let (Some(observer), Some(caller), Some((registers, span))) =
                        (&mut *observer, self.caller, &mut payload)
                    else {
                        continue;
                    };
                    for lane in called.lanes() {
                        let mut words: Words = registers.lane_words(span.first, span.count, lane).collect();
                        observer.invocation(self.launch_id(lane));
                        if observer.null_shader(caller, &mut words) {
                            registers.set_lane_words(span.first, lane, words);
                            registers.define(span.first, span.count, Mask::lane(lane));
                        }
                    }
                }
            }
        }
    }

    /// The closest-hit or miss shader of a record, and what is known of it.
    fn hit_or_miss_shader(&self, pipeline: &Pipeline, role: Role, index: RecordIndex) -> HitOrMissShader {
        let (shader, has_any_hit) = match role {
            Role::Miss => (
                record_at(&pipeline.sbt.miss, index).and_then(|record| general_shader(pipeline, record)),
                false,
            ),
            _ => {
                let (_, group) = hit_group_at(pipeline, index);
                (group.closest_hit, group.any_hit.is_some())
            }
        };
        let is_empty = shader.is_some_and(|shader| pipeline.is_empty(shader));
        let unread = |shader| self.caller.is_some_and(|caller| writes_only_unread(pipeline, caller, shader));
        HitOrMissShader { shader, has_any_hit, is_empty, writes_only_unread: shader.is_some_and(unread) }
    }

    /// The index of the record of a lane's miss shader.
    pub(crate) fn miss_record_index(&self, lane: usize) -> RecordIndex {
        RecordIndex::of_miss(self.miss_index.0[lane])
    }

    /// The index of the hit record of a lane's candidate.
    #[inline]
    pub(crate) fn hit_record_index(&self, lane: usize, candidate: &Candidate) -> RecordIndex {
        let HitRecordTerms { instance_offset, geometry, stride, offset } =
            self.hit_record_terms(lane, candidate);
        RecordIndex::of_hit(instance_offset, geometry, stride, offset)
    }

    /// What the index of the hit record of a lane's candidate is made of.
    pub(crate) fn hit_record_terms(&self, lane: usize, candidate: &Candidate) -> HitRecordTerms {
        HitRecordTerms {
            instance_offset: candidate.instance_in(self.tlas(lane)).sbt_record_offset,
            geometry: candidate.geometry,
            stride: self.sbt_stride.0[lane],
            offset: self.sbt_offset.0[lane],
        }
    }

    /// Applies the exits of a shader that the lanes' rays called.
    #[inline]
    pub(crate) fn apply_exits(&mut self, role: Role, lanes: Mask<W>, batch: &Batch<W>) {
        for lane in (lanes & batch.trapped()).lanes() {
            self.trap(lane, TrapCode::Callee);
        }
        if role != Role::AnyHit {
            return;
        }
        for lane in lanes.without(batch.trapped()).lanes() {
            let exit = batch.exits[lane];
            let cursor = self.cursor_mut(lane);
            if exit != Exit::Ignored {
                cursor.confirm();
            }
            if exit == Exit::Terminated {
                cursor.terminate();
            }
        }
    }

    /// Stores the attributes of a lane's committed hit.
    pub(crate) fn commit_attributes(&mut self, lane: usize, attributes: Words) {
        if self.attributes.len() <= lane {
            self.attributes.resize_with(lane + 1, Words::new);
        }
        self.attributes[lane] = attributes;
    }

    /// A lane's hit of a built-in primitive (no box), whose attributes traversal computes.
    #[inline]
    fn built_in_candidate(&self, lane: usize) -> Option<&Candidate> {
        let candidate = self.committed[lane].as_ref().map(|committed| &committed.candidate);
        candidate.filter(|candidate| !self.from_hit_objects && !candidate.is_box())
    }

    /// The attributes of a lane's committed hit.
    pub(crate) fn committed_attributes(&self, lane: usize) -> Words {
        match self.built_in_candidate(lane) {
            Some(candidate) => {
                Words::from_slice(&array::map(candidate.intersection.attributes, f32::to_bits))
            }
            None => self.attributes.get(lane).cloned().unwrap_or_default(),
        }
    }

    /// Writes the builtins of a shader that runs in a role.
    pub(crate) fn write_builtins(
        &self,
        pipeline: &Pipeline,
        role: Role,
        lanes: Mask<W>,
        to: &mut Invocations<W>,
    ) {
        (to.launch_id, to.launch_size, to.depth) = (self.launch_id, self.launch_size, self.depth);
        to.rays = self.rays;
        to.structures.copy(&self.structures);
        to.record_indices = self.record_indices;
        to.hit = role != Role::Miss;
        let table = if to.hit { &pipeline.sbt.hit } else { &pipeline.sbt.miss };
        let mut record = None;
        for lane in lanes.lanes() {
            let index = self.record_indices[lane];
            if record.as_ref().is_none_or(|(known, _)| *known != index) {
                record = Some((index, record_at(table, index).and_then(SbtRecord::shader_record)));
            }
            to.set_record(lane, record.as_ref().and_then(|(_, record)| record.as_ref()));
        }
        match role {
            Role::ClosestHit => {
                for lane in lanes.lanes() {
                    if let Some(Committed { candidate, t, hit_kind }) = &self.committed[lane] {
                        to.hits.set(lane, candidate.hit_primitive(), *hit_kind);
                        to.set_t_max(lane, *t);
                    }
                }
            }
            Role::AnyHit | Role::ReportedAnyHit | Role::Intersection => {
                for lane in lanes.lanes() {
                    let cursor = self.cursor(lane);
                    let Some(candidate) = cursor.candidate() else { continue };
                    let kind = candidate.hit_kind().unwrap_or(HitKind(0));
                    to.hits.set(lane, candidate.hit_primitive(), kind);
                    let t = if candidate.is_box() { cursor.t_max() } else { candidate.intersection.t };
                    to.set_t_max(lane, t);
                }
            }
            _ => to.t_max = self.rays.t_max,
        }
    }

    /// Writes the initial hit attributes of a shader that runs in a role.
    pub(crate) fn write_hit_attributes(&self, role: Role, lanes: Mask<W>, registers: &mut [Lanes<W>]) {
        for lane in lanes.lanes() {
            let candidate = match role {
                Role::AnyHit => self.cursor(lane).candidate(),
                Role::ClosestHit => self.built_in_candidate(lane),
                _ => return,
            };
            if let Some(candidate) = candidate {
                let values = candidate.intersection.attributes;
                registers
                    .iter_mut()
                    .zip(values)
                    .for_each(|(register, value)| register.0[lane] = value.to_bits());
            } else if role == Role::ClosestHit {
                let words = self.attributes.get(lane).into_iter().flatten();
                registers.iter_mut().zip(words).for_each(|(register, &word)| register.0[lane] = word);
            }
        }
    }
}

/// The closest-hit or miss shader of a record, and what is known of it.
#[derive(Clone, Copy, Debug)]
struct HitOrMissShader {
    shader: Option<ShaderIndex>,
    /// Whether its hit group has an any-hit shader.
    has_any_hit: bool,
    /// Whether the shader has no effect.
    is_empty: bool,
    /// Whether the shader writes only payload words that the caller does not read.
    writes_only_unread: bool,
}

/// Whether a shader's only effect is on words of the payload that its caller does not read.
fn writes_only_unread(pipeline: &Pipeline, caller: Caller, shader: ShaderIndex) -> bool {
    let [caller_program, program] = [caller.shader, shader].map(|one| &pipeline.programs[one.index()]);
    let read = || caller_program.payloads.read_after(caller.op);
    program.payloads.writes_only.is_some_and(|written| !written.intersects(read()))
}
