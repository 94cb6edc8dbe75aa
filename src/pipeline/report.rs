//! `OpReportIntersectionKHR` in progress: any-hit shaders that decide on reported hits.

use smallvec::SmallVec;

use crate::accel::HitKind;
use crate::machine::stop::Rows;
use crate::machine::{Batch, Exit, Mask, Reg, TrapCode};
use crate::ops::pointer::storage;
use crate::pipeline::Pipeline;
use crate::pipeline::group::Shader;
use crate::pipeline::sbt::Record;
use crate::pipeline::stack::{Called, Role};
use crate::pipeline::trace::{Data, Trace, hit_group};
use crate::pipeline::witness::{Event, Witness};
use crate::program::Program;

/// Reports of the lanes of an intersection shader's batch.
#[derive(Clone, Debug)]
pub(super) struct Report {
    accepted: Reg,
    /// By any-hit shader: the intersection batch's lanes.
    waiting: SmallVec<[(Shader, SmallVec<[usize; 4]>); 1]>,
    reports: SmallVec<[Option<Reported>; 4]>,
}

#[derive(Clone, Debug)]
struct Reported {
    /// The lane of the trace.
    ray: usize,
    t: f32,
    kind: HitKind,
    attributes: Data,
}

impl Report {
    /// Takes the reports of an intersection batch; `callers` maps its lanes to the trace's.
    #[allow(clippy::too_many_arguments, reason = "the operands of the instruction, and who serves it")]
    pub fn new<const W: usize, T: Witness>(
        pipeline: &Pipeline,
        trace: &mut Trace,
        program: &Program,
        batch: &mut Batch<W>,
        callers: &[usize],
        (mask, t, hit_kind, accepted): (Mask<W>, Reg, Reg, Reg),
        witness: &mut T,
    ) -> Self {
        let mut report = Self { accepted, waiting: SmallVec::new(), reports: SmallVec::from_elem(None, W) };
        for lane in mask.lanes() {
            let t = f32::from_bits(batch.registers[t].0[lane]);
            let kind = HitKind(batch.registers[hit_kind].0[lane]);
            if kind.0 > 127 {
                let op = batch.op - 1;
                batch.trap(Mask::lane(lane), TrapCode::InvalidHitKind, op);
                continue;
            }
            let attributes = match program.interface_rows(storage::HIT_ATTRIBUTE) {
                Some(rows) => batch.registers.lane_words(rows.first, rows.count, lane).collect(),
                None => Data::new(),
            };
            let reported = Reported { ray: callers[lane], t, kind, attributes };
            let ray = trace.ray_mut(reported.ray);
            let candidate = ray.cursor.candidate().copied();
            let Some(candidate) = candidate.filter(|_| ray.cursor.accepts(t)) else {
                report.answer(batch, lane, &reported, false, witness);
                continue;
            };
            let any_hit = hit_group(pipeline, &ray.query, &candidate).2.any_hit;
            match any_hit.filter(|_| !candidate.opaque) {
                None => {
                    ray.cursor.generate(t, kind);
                    ray.commit_attributes(reported.attributes.clone());
                    report.answer(batch, lane, &reported, true, witness);
                }
                Some(shader) => {
                    report.reports[lane] = Some(reported);
                    match report.waiting.iter_mut().find(|group| group.0 == shader) {
                        Some(group) => group.1.push(lane),
                        None => report.waiting.push((shader, SmallVec::from_iter([lane]))),
                    }
                }
            }
        }
        report.waiting.reverse();
        report
    }

    /// The next any-hit shader that must run; `None` when every report is answered.
    pub fn advance(&mut self, pipeline: &Pipeline, trace: &mut Trace) -> Option<Called> {
        let (shader, lanes) = self.waiting.pop()?;
        let program = &pipeline.programs[shader.0 as usize];
        let mut called = Called::new(shader, Role::ReportedAnyHit, lanes.len());
        for lane in lanes {
            let Some(reported) = &self.reports[lane] else { continue };
            let ray = trace.ray_mut(reported.ray);
            let candidate = ray.cursor.candidate().copied();
            let record = candidate.map(|candidate| hit_group(pipeline, &ray.query, &candidate));
            let data = record.and_then(|(_, record, _)| record).and_then(Record::shader_record);
            let mut invocation = ray.candidate_invocation(program, data);
            invocation.called_through = record.map_or(0, |(index, ..)| index);
            invocation.t_max = reported.t;
            if let Some(hit) = &mut invocation.hit {
                hit.kind = reported.kind;
            }
            called.push(lane, invocation, ray.query.payload.clone(), reported.attributes.clone());
        }
        Some(called)
    }

    /// Takes the decision of an any-hit shader on a lane of the intersection batch.
    #[allow(clippy::too_many_arguments, reason = "who decided, who asked, and who serves them")]
    pub fn deliver<const W: usize, T: Witness>(
        &mut self,
        trace: &mut Trace,
        intersection: &mut Batch<W>,
        lane: usize,
        payload: Option<Rows>,
        any_hit: &Batch<W>,
        from: usize,
        witness: &mut T,
    ) {
        let Some(reported) = self.reports[lane].take() else { return };
        let ray = trace.ray_mut(reported.ray);
        ray.take_payload(payload, any_hit, from);
        let accepted = match any_hit.exits[from] {
            Exit::Ignored => false,
            Exit::Trapped(_) => {
                let op = intersection.op - 1;
                intersection.trap(Mask::lane(lane), TrapCode::Callee, op);
                return;
            }
            Exit::Returned | Exit::Terminated => {
                ray.cursor.generate(reported.t, reported.kind);
                ray.commit_attributes(reported.attributes.clone());
                true
            }
        };
        if any_hit.exits[from] == Exit::Terminated {
            // The report does not return where an any-hit shader terminates the ray.
            ray.cursor.terminate();
            intersection.exit(Mask::lane(lane), Exit::Terminated);
        }
        self.answer(intersection, lane, &reported, accepted, witness);
    }

    fn answer<const W: usize, T: Witness>(
        &self,
        batch: &mut Batch<W>,
        lane: usize,
        reported: &Reported,
        accepted: bool,
        witness: &mut T,
    ) {
        batch.registers[self.accepted].0[lane] = u32::from(accepted);
        if accepted {
            batch.invocations[lane].t_max = reported.t;
        }
        if T::ACTIVE {
            witness.invocation(batch.invocations[lane].launch_id);
            witness.event(Event::Report { t: reported.t, hit_kind: reported.kind, accepted });
        }
    }
}
