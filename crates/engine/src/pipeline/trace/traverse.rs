//! The traversal of the rays of a trace, up to each candidate that a shader decides on.

use crate::accel::{Candidate, Cursor, RayFlags, RecordIndex, TestCounts, TraceRay};
use crate::machine::{Mask, OpenChoices, ShaderIndex, TrapCode};
use crate::module::interface::Stage;
use crate::pipeline::Pipeline;
use crate::pipeline::group::Role;
use crate::pipeline::observer::{Event, EventReceiver, TraversalAdapter};
use crate::pipeline::sbt::is_beyond_end;
use crate::pipeline::trace::{Trace, hit_group_at};

impl<const W: usize> Trace<W> {
    /// Traces all rays that can hit only opaque geometry, and gives the others a resumable
    /// traversal.
    pub(super) fn begin_traversal(&mut self, is_observed: bool, choices: Option<&OpenChoices>) {
        if !is_observed && choices.is_none() {
            for number in 0..self.structures.all().len() {
                self.trace_opaque(number);
            }
        }
        for lane in self.traversing.lanes() {
            let trace = self.ray_with_pipeline_flags(lane);
            if self.cursors.len() <= lane {
                self.cursors.resize_with(lane + 1, || None);
            }
            let tlas = self.structures.get(lane).expect("bug in anyhit: a ray without a structure");
            match &mut self.cursors[lane] {
                Some(cursor) => cursor.reset(tlas, trace),
                empty => *empty = Some(Cursor::new(tlas, trace)),
            }
        }
        if let Some(choices) = choices {
            self.draw_traversals(choices);
        }
    }

    /// Draws what is open about the traversals, which have not begun yet.
    #[cold]
    fn draw_traversals(&mut self, choices: &OpenChoices) {
        let op = self.caller.map(|caller| caller.op);
        for lane in self.traversing.lanes() {
            let launch_id = self.launch_id(lane);
            let tlas = self.structures.get(lane).expect("bug in anyhit: a ray without a structure");
            if let Some(cursor) = &mut self.cursors[lane] {
                choices.draw_traversal(launch_id, op, tlas, cursor);
            }
        }
    }

    /// A lane's ray with the flags that the pipeline adds.
    #[inline]
    fn ray_with_pipeline_flags(&self, lane: usize) -> TraceRay {
        let trace = self.rays.get(lane);
        TraceRay { flags: trace.flags | RayFlags(self.pipeline_flags), ..trace }
    }

    /// Traces the rays of one acceleration structure that can hit only opaque geometry.
    fn trace_opaque(&mut self, number: usize) {
        let in_structure = match self.structures.all().len() {
            1 => self.traversing,
            _ => self.traversing & Mask::equal(self.structures.indices(), number as u32),
        };
        // Nothing reads which hit an occlusion ray commits, unless a hit object records it.
        let occlusion = RayFlags::TERMINATE_ON_FIRST_HIT | RayFlags::SKIP_CLOSEST_HIT_SHADER;
        let hit_is_unread = self.invokes_hit_or_miss && self.caller.is_some();
        let tlas = &self.structures.all()[number];
        if !tlas.is_fully_opaque(RayFlags::default()) {
            return;
        }
        let mut remaining = in_structure;
        while let Some(first) = remaining.lanes().next() {
            let flags = self.ray_with_pipeline_flags(first).flags;
            let mut same_flags = Mask::NONE;
            self.opaque.rays.clear();
            for lane in remaining.lanes() {
                let ray = self.ray_with_pipeline_flags(lane);
                if ray.flags == flags {
                    self.opaque.rays.push(ray);
                    same_flags = same_flags | Mask::lane(lane);
                }
            }
            remaining = remaining.without(same_flags);
            if !tlas.is_fully_opaque(flags) {
                continue;
            }
            let occlusion_only = hit_is_unread && flags.contains(occlusion);
            if occlusion_only {
                self.stats.elided.occlusion += self.opaque.rays.len() as u64;
            }
            self.opaque.trace(tlas, occlusion_only);
            for (lane, hit) in same_flags.lanes().zip(&self.opaque.hits) {
                self.committed[lane] = *hit;
            }
            self.traversing = self.traversing.without(same_flags);
        }
    }

    /// Finds what the rays come to next together, as far as that pays.
    fn look_ahead(&mut self) {
        let Self { structures, cursors, look_ahead, .. } = self;
        for number in 0..structures.all().len() {
            let tlas = &structures.all()[number];
            let in_structure = match structures.all().len() {
                1 => self.traversing,
                _ => self.traversing & Mask::equal(structures.indices(), number as u32),
            };
            if !look_ahead.begin(tlas, in_structure.count() as usize) {
                continue;
            }
            for lane in in_structure.lanes() {
                cursors[lane].iter().for_each(|cursor| look_ahead.add(lane as u32, cursor, tlas));
            }
            look_ahead.find(|lane, hit| {
                cursors[lane as usize].iter_mut().for_each(|cursor| cursor.take_next_hit(hit));
            });
        }
    }

    /// Advances each ray to the next candidate that needs a shader's decision.
    pub(super) fn traverse(&mut self, pipeline: &Pipeline, observer: &mut EventReceiver<'_>) {
        if observer.is_none() {
            self.look_ahead();
        }
        // Mostly all candidates have one record.
        let mut known: Option<CandidateShader> = None;
        for lane in self.traversing.lanes() {
            if let Some(observer) = observer {
                observer.invocation(self.launch_id(lane));
            }
            loop {
                let tlas = self.structures.get(lane).expect("bug in anyhit: a ray without a structure");
                let cursor = self.cursors[lane].as_mut().expect("bug in anyhit: a ray without a traversal");
                let next = match observer {
                    None => cursor.proceed(tlas),
                    Some(observer) if observer.counts_tests() => {
                        let mut counts = TestCounts::default();
                        let next = cursor.proceed_counted(tlas, &mut counts);
                        observer.tests(counts);
                        next
                    }
                    Some(observer) => cursor.proceed_observed(tlas, &mut TraversalAdapter::new(*observer)),
                };
                let Some(candidate) = next else {
                    self.committed[lane] = cursor.committed().copied();
                    self.traversing = self.traversing.without(Mask::lane(lane));
                    break;
                };
                let index = self.hit_record_index(lane, &candidate);
                let found =
                    known.filter(|known| (known.record, known.of_boxes) == (index, candidate.is_box()));
                let CandidateShader { shader, takes_payload, is_empty, is_beyond_end, .. } = *known.insert(
                    found.unwrap_or_else(|| self.candidate_shader(pipeline, index, candidate.is_box())),
                );
                if let Some(observer) = observer
                    && !observer.counts_tests()
                {
                    let instance = &self.tlas(lane).instances()[candidate.instance as usize];
                    let arithmetic = [
                        instance.sbt_record_offset,
                        candidate.geometry,
                        self.sbt_stride.0[lane] & 0xF,
                        self.sbt_offset.0[lane] & 0xF,
                    ];
                    let (launch_id, record) = (self.launch_id(lane), index);
                    observer.event(Event::Candidate { launch_id, candidate, record, arithmetic, shader });
                }
                if let Some(shader) = shader.filter(|_| !takes_payload) {
                    self.trap_payload_mismatch(lane, shader);
                    self.cursor_mut(lane).terminate();
                    continue;
                }
                // Under an observer every shader runs.
                if observer.is_none() && is_empty {
                    // An empty intersection shader reports no hit, an empty any-hit shader accepts.
                    self.stats.elide(if candidate.is_box() { Stage::Intersection } else { Stage::AnyHit }, 1);
                    self.cursor_mut(lane).confirm();
                    continue;
                }
                match shader {
                    _ if is_beyond_end => {
                        self.trap_and_terminate(lane, TrapCode::HitRecordMissing, index, &candidate);
                    }
                    Some(shader) => {
                        let role = if candidate.is_box() { Role::Intersection } else { Role::AnyHit };
                        self.record_indices[lane] = index;
                        self.enqueue_call(shader, role, Mask::lane(lane));
                        break;
                    }
                    None if candidate.is_box() => {
                        if pipeline.flags.no_null_intersection_shaders {
                            self.trap_and_terminate(lane, TrapCode::NullIntersection, index, &candidate);
                        }
                    }
                    None if pipeline.flags.no_null_any_hit_shaders => {
                        self.trap_and_terminate(lane, TrapCode::NullAnyHit, index, &candidate);
                    }
                    None => {
                        self.cursor_mut(lane).confirm();
                    }
                }
            }
        }
    }

    /// The shader that decides on the candidates of a record.
    fn candidate_shader(&self, pipeline: &Pipeline, record: RecordIndex, of_boxes: bool) -> CandidateShader {
        let (_, group) = hit_group_at(pipeline, record);
        let shader = if of_boxes { group.intersection } else { group.any_hit };
        CandidateShader {
            record,
            of_boxes,
            shader,
            takes_payload: shader.is_some_and(|shader| self.payload_matches(pipeline, shader)),
            is_empty: shader.is_some_and(|shader| pipeline.is_empty(shader)),
            is_beyond_end: is_beyond_end(&pipeline.sbt.hit, record),
        }
    }

    /// Ends a ray during its traversal, so that its caller traps.
    fn trap_and_terminate(&mut self, lane: usize, code: TrapCode, index: RecordIndex, candidate: &Candidate) {
        self.record_indices[lane] = index;
        self.trap_at_record(lane, code, Some(candidate));
        self.cursor_mut(lane).terminate();
    }
}

/// The shader that decides on the candidates of a record, and what is known of it.
#[derive(Clone, Copy, Debug)]
struct CandidateShader {
    record: RecordIndex,
    /// Whether it is the intersection shader, which decides on boxes.
    of_boxes: bool,
    shader: Option<ShaderIndex>,
    /// Whether it declares the payload that the rays have.
    takes_payload: bool,
    /// Whether it has no effect.
    is_empty: bool,
    /// Whether the record is beyond the end of the table.
    is_beyond_end: bool,
}
