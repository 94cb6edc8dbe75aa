//! The end of rays: finds the closest-hit and miss shaders that they call, and elides those without
//! effect.

use smallvec::SmallVec;

use crate::accel::{Committed, RayFlags};
use crate::machine::stop::RegSpan;
use crate::machine::{Mask, Registers, TrapCode};
use crate::pipeline::Pipeline;
use crate::pipeline::group::Shader;
use crate::pipeline::observer::{Caller, Event, PipelineObserver};
use crate::pipeline::sbt::ends_before;
use crate::pipeline::stack::Role;
use crate::pipeline::trace::{Data, Trace, at, general, hit_group_at};

impl<const W: usize> Trace<W> {
    /// Chooses closest-hit or miss for each ray.
    pub(super) fn finish<T: PipelineObserver>(
        &mut self,
        pipeline: &Pipeline,
        mut payload: Option<(&mut Registers<W>, RegSpan)>,
        observer: &mut T,
    ) {
        let mut ends: SmallVec<[(Role, u64, Mask<W>); 4]> = SmallVec::new();
        for lane in self.lanes.without(self.trapping).lanes() {
            let (role, index) = match &self.committed[lane] {
                Some(_) if self.settled => (Role::ClosestHit, self.records[lane]),
                Some(committed) => (Role::ClosestHit, self.hit_index(lane, &committed.candidate)),
                None if self.settled => (Role::Miss, self.records[lane]),
                None => (Role::Miss, self.miss_record(lane)),
            };
            self.records[lane] = index;
            match ends.iter_mut().find(|end| (end.0, end.1) == (role, index)) {
                Some(end) => end.2 = end.2 | Mask::lane(lane),
                None => ends.push((role, index, Mask::lane(lane))),
            }
        }
        for (role, index, lanes) in ends {
            let Ending { shader, has_any_hit, is_empty, leaves_unread } = self.ending(pipeline, role, index);
            let mut skipped = Mask::NONE;
            if role == Role::ClosestHit {
                let skips =
                    |lane| RayFlags(self.rays.flags.0[lane]).contains(RayFlags::SKIP_CLOSEST_HIT_SHADER);
                skipped = lanes & Mask::from_fn(skips);
            }
            // The lanes whose record is read.
            let called = if self.shades { lanes.without(skipped) } else { Mask::NONE };
            if has_any_hit {
                let is_opaque = |hit: &Committed| hit.candidate.opaque;
                let opaque = |lane: &usize| self.committed[*lane].as_ref().is_some_and(is_opaque);
                self.stats.elided.any_hit += lanes.lanes().filter(opaque).count() as u64;
            }
            if T::ACTIVE && !self.settled {
                for lane in lanes.lanes() {
                    let shader = shader.filter(|_| called.contains(lane));
                    let (committed, kept) = (self.committed[lane], !self.shades);
                    observer.invocation(self.launch_id(lane));
                    observer.event(Event::Traversed { committed, record: index, shader, kept });
                }
            }
            let promised = match role {
                Role::Miss if ends_before(&pipeline.sbt.miss, index) => Some(TrapCode::MissRecordMissing),
                Role::Miss => pipeline.flags.no_null_miss_shaders.then_some(TrapCode::NullMiss),
                _ if ends_before(&pipeline.sbt.hit, index) => Some(TrapCode::HitRecordMissing),
                _ => pipeline.flags.no_null_closest_hit_shaders.then_some(TrapCode::NullClosestHit),
            };
            match (shader, promised) {
                (Some(shader), _) if !self.suits(pipeline, shader) => {
                    called.lanes().for_each(|lane| self.end_by_mismatch(lane, shader));
                }
                (Some(shader), _) if !T::ACTIVE && is_empty => {
                    self.stats.elide(pipeline.programs[shader.0 as usize].stage, called.count());
                }
                (Some(shader), _) if !self.observed && leaves_unread => {
                    self.stats.elide_unread(pipeline.programs[shader.0 as usize].stage, called.count());
                }
                (Some(shader), _) => self.wait(shader, role, called),
                (None, Some(code)) => called.lanes().for_each(|lane| self.trap(lane, code)),
                (None, None) if T::ACTIVE => {
                    let (Some(caller), Some((registers, span))) = (self.caller, &mut payload) else {
                        continue;
                    };
                    for lane in called.lanes() {
                        let mut words: Data = registers.lane_words(span.first, span.count, lane).collect();
                        observer.invocation(self.launch_id(lane));
                        observer.absent(caller, &mut words);
                        registers.set_lane_words(span.first, lane, words);
                    }
                }
                (None, None) => {}
            }
        }
    }

    /// What a record specifies for the end of a ray.
    fn ending(&self, pipeline: &Pipeline, role: Role, index: u64) -> Ending {
        let (shader, has_any_hit) = match role {
            Role::Miss => (at(&pipeline.sbt.miss, index).and_then(|record| general(pipeline, record)), false),
            _ => {
                let (_, group) = hit_group_at(pipeline, index);
                (group.closest_hit, group.any_hit.is_some())
            }
        };
        let is_empty = shader.is_some_and(|shader| pipeline.is_empty(shader));
        let unread = |shader| self.caller.is_some_and(|caller| leaves_unread(pipeline, caller, shader));
        Ending { shader, has_any_hit, is_empty, leaves_unread: shader.is_some_and(unread) }
    }
}

/// What a record specifies for the end of a ray.
#[derive(Clone, Copy, Debug)]
struct Ending {
    shader: Option<Shader>,
    has_any_hit: bool,
    is_empty: bool,
    leaves_unread: bool,
}

/// Whether a shader's only effect is on words of the payload that its caller does not read.
fn leaves_unread(pipeline: &Pipeline, caller: Caller, shader: Shader) -> bool {
    let [caller_program, program] = [caller.shader, shader].map(|one| &pipeline.programs[one.0 as usize]);
    let read = || caller_program.payloads.read_after(caller.op);
    program.payloads.writes_only.is_some_and(|written| !written.intersects(read()))
}
