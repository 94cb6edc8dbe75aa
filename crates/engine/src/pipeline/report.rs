//! `OpReportIntersectionKHR` in progress: any-hit shaders decide on reported hits.

use smallvec::SmallVec;

use crate::accel::HitKind;
use crate::machine::{Batch, Exit, Lanes, Mask, Reg, ShaderIndex, TrapCode};
use crate::ops::pointer::storage;
use crate::pipeline::Pipeline;
use crate::pipeline::observer::{Event, EventReceiver};
use crate::pipeline::trace::{Trace, Words, hit_group_at};
use crate::program::Program;

/// The registers of an `OpReportIntersectionKHR`.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReportRegisters {
    /// The hit distance.
    pub t: Reg,
    /// The hit kind.
    pub hit_kind: Reg,
    /// The result, a bool: whether the hit is accepted.
    pub accepted: Reg,
}

/// The reported hits of an intersection shader's lanes.
#[derive(Clone, Debug)]
pub(super) struct IntersectionReport<const W: usize> {
    /// The register of the instruction's results.
    accepted: Reg,
    /// The any-hit shaders still to run, and the lanes whose hits they decide on.
    pending: SmallVec<[(ShaderIndex, Mask<W>); 1]>,
    reports: SmallVec<[Option<ReportedHit>; 4]>,
}

/// A hit that an intersection shader reported and that is not yet decided.
#[derive(Clone, Debug)]
struct ReportedHit {
    t: f32,
    kind: HitKind,
    attributes: Words,
}

impl<const W: usize> IntersectionReport<W> {
    /// Reads the hits that the lanes of an intersection batch report, and decides those that need
    /// no any-hit shader.
    pub(super) fn new(
        pipeline: &Pipeline,
        trace: &mut Trace<W>,
        program: &Program,
        batch: &mut Batch<W>,
        mask: Mask<W>,
        registers: ReportRegisters,
        observer: &mut EventReceiver<'_>,
    ) -> Self {
        let ReportRegisters { t, hit_kind, accepted } = registers;
        let mut report = Self { accepted, pending: SmallVec::new(), reports: SmallVec::from_elem(None, W) };
        for lane in mask.lanes() {
            let t = f32::from_bits(batch.registers[t].0[lane]);
            let kind = HitKind(batch.registers[hit_kind].0[lane]);
            if kind.0 > 127 {
                let op = batch.stopped_at();
                batch.fault_value[lane] = kind.0.into();
                batch.trap(Mask::lane(lane), TrapCode::InvalidHitKind, op);
                continue;
            }
            let attributes = match program.interface_registers(storage::HIT_ATTRIBUTE) {
                Some(registers) => {
                    batch.registers.lane_words(registers.first, registers.count, lane).collect()
                }
                None => Words::new(),
            };
            let reported = ReportedHit { t, kind, attributes };
            let cursor = trace.cursor(lane);
            let candidate = cursor.candidate().copied();
            let Some(candidate) = candidate.filter(|_| cursor.accepts(t)) else {
                report.write_result(batch, lane, &reported, false, observer);
                continue;
            };
            let any_hit = hit_group_at(pipeline, trace.hit_record_index(lane, &candidate)).1.any_hit;
            match any_hit.filter(|_| !candidate.opaque) {
                Some(shader) if !trace.payload_matches(pipeline, shader) => {
                    let op = batch.stopped_at();
                    batch.fault_value[lane] = shader.0.into();
                    batch.trap(Mask::lane(lane), TrapCode::PayloadMismatch, op);
                }
                None => {
                    trace.cursor_mut(lane).generate(t, kind);
                    trace.commit_attributes(lane, Words::from_slice(&reported.attributes));
                    report.write_result(batch, lane, &reported, true, observer);
                }
                Some(shader) => {
                    report.reports[lane] = Some(reported);
                    match report.pending.iter_mut().find(|group| group.0 == shader) {
                        Some(group) => group.1 = group.1 | Mask::lane(lane),
                        None => report.pending.push((shader, Mask::lane(lane))),
                    }
                }
            }
        }
        report.pending.reverse();
        report
    }

    /// The next any-hit shader that must run; `None` when every reported hit is decided.
    pub(super) fn advance(&mut self) -> Option<(ShaderIndex, Mask<W>)> {
        self.pending.pop()
    }

    /// Writes the reported hits into the builtins of an any-hit shader.
    pub(super) fn write_builtins(&self, lanes: Mask<W>, batch: &mut Batch<W>) {
        for lane in lanes.lanes() {
            if let Some(reported) = &self.reports[lane] {
                batch.invocations.set_t_max(lane, reported.t);
                batch.invocations.hits.kind.0[lane] = reported.kind.0;
            }
        }
    }

    /// Writes the initial hit attributes of an any-hit shader.
    pub(super) fn write_hit_attributes(&self, lanes: Mask<W>, registers: &mut [Lanes<W>]) {
        for lane in lanes.lanes() {
            let attributes = self.reports[lane].iter().flat_map(|reported| &reported.attributes);
            registers.iter_mut().zip(attributes).for_each(|(register, &word)| register.0[lane] = word);
        }
    }

    /// Applies the decisions of an any-hit shader to lanes of the intersection batch.
    pub(super) fn apply_any_hit(
        &mut self,
        trace: &mut Trace<W>,
        intersection: &mut Batch<W>,
        any_hit: &Batch<W>,
        lanes: Mask<W>,
        observer: &mut EventReceiver<'_>,
    ) {
        for lane in lanes.lanes() {
            let Some(reported) = self.reports[lane].take() else { continue };
            let accepted = match any_hit.exits[lane] {
                Exit::Ignored => false,
                Exit::Trapped(_) => {
                    let op = intersection.stopped_at();
                    intersection.trap(Mask::lane(lane), TrapCode::Callee, op);
                    continue;
                }
                Exit::Returned | Exit::Terminated => {
                    trace.cursor_mut(lane).generate(reported.t, reported.kind);
                    trace.commit_attributes(lane, Words::from_slice(&reported.attributes));
                    true
                }
            };
            if any_hit.exits[lane] == Exit::Terminated {
                // The report does not return if an any-hit shader terminates the ray.
                trace.cursor_mut(lane).terminate();
                intersection.exit(Mask::lane(lane), Exit::Terminated);
            }
            self.write_result(intersection, lane, &reported, accepted, observer);
        }
    }

    /// Writes the result of the report into a lane of the intersection batch.
    fn write_result(
        &self,
        batch: &mut Batch<W>,
        lane: usize,
        reported: &ReportedHit,
        accepted: bool,
        observer: &mut EventReceiver<'_>,
    ) {
        batch.registers[self.accepted].0[lane] = u32::from(accepted);
        if accepted {
            batch.invocations.set_t_max(lane, reported.t);
        }
        if let Some(observer) = observer {
            observer.invocation(batch.invocations.launch_id(lane));
            observer.event(Event::Report { t: reported.t, hit_kind: reported.kind, accepted });
        }
    }
}
