//! What the sanitizer knows while shaders run, and how its checks ask and report.
//!
//! A value is undefined where a variable was not written, or where an instruction's result is for
//! its operands. Whatever is computed from it is undefined, too; nothing is reported until a
//! branch, an index or address, a ray or an output depends on it, as in MemorySanitizer. Undefined
//! behaviour is reported where it happens. Of a NaN the sanitizer keeps the instruction that made
//! it.

use rustc_hash::FxHashSet;

use crate::cause::{Cause, CauseDetails, Causes, OpPlace};
use crate::expectations::Expectations;
use crate::finding::{Findings, OccurrenceLog};
use crate::levels::Levels;
use crate::memory_shadow::WorkgroupShadow;
use crate::payload_use::PassedData;
use crate::plan::ProgramPlan;
use crate::races::{Race, Races, overlapping_bindings};
use crate::report::{CallFrame, Reporter, Sink};
use crate::rule::{Level, Rule, race};
use crate::surface_point::SurfacePoint;
use crate::unwritten::{UnwrittenMemory, UnwrittenPart};
use anyhit_engine::machine::image::Image;
use anyhit_engine::machine::{Batch, Mask, NO_CAUSE, OpIndex, Reg, Resources, ShaderIndex, ShadowRegisters};
use anyhit_engine::ops::access::Access;
use anyhit_engine::pipeline::Pipeline;
use anyhit_engine::program::Program;

/// Calls a visitor with the accesses of an operation.
pub(super) type Accesses<'a> = dyn FnMut(&mut dyn FnMut(Access)) + 'a;

/// Checks the shaders of a pipeline, or of a dispatch, while they run.
#[derive(Debug)]
pub struct Sanitizer<'a> {
    pub(super) plans: &'a [ProgramPlan],
    levels: &'a Levels,
    /// The pipeline of the shaders, where there is one.
    pub(super) pipeline: Option<&'a Pipeline>,
    causes: Causes,
    findings: Findings,
    pub(super) frames: Vec<CallFrame>,
    /// The accesses to shared memory so far, unless nobody is told of races.
    pub(super) races: Option<Races>,
    /// Which workgroup memory is undefined.
    pub(super) shared: WorkgroupShadow,
    /// Which buffers and images are undefined.
    pub(super) unwritten: UnwrittenMemory,
    /// What came of hints about values.
    pub(super) expectations: Expectations,
    /// The first of the workgroups that run.
    pub(super) first_workgroup: Option<u32>,
    /// Calls, by their operation and the called shader, that pass what that shader declares.
    pub(super) matching_calls: FxHashSet<(OpPlace, ShaderIndex)>,
    /// The shaders that the host has called and that have ended, in their order.
    pub(super) ended: Vec<ShaderIndex>,
    /// Which shaders are called with which variables.
    pub(super) passed: PassedData,
    /// The surfaces that are known while a ray query is initialized, with their lanes.
    pub(super) query_surfaces: Vec<(usize, SurfacePoint)>,
}

impl<'a> Sanitizer<'a> {
    /// A sanitizer of shaders, by their index in the pipeline.
    pub fn new(plans: &'a [ProgramPlan], levels: &'a Levels) -> Self {
        let told = |rule: &&Rule| levels.of(rule) != Level::Allow;
        Self {
            plans,
            levels,
            pipeline: None,
            causes: Causes::default(),
            findings: Findings::default(),
            frames: Vec::new(),
            races: race::RULES.iter().any(told).then(|| Races::new(plans, &FxHashSet::default())),
            shared: WorkgroupShadow::default(),
            unwritten: UnwrittenMemory::default(),
            expectations: Expectations::default(),
            first_workgroup: None,
            matching_calls: FxHashSet::default(),
            ended: Vec::new(),
            passed: PassedData::default(),
            query_surfaces: Vec::new(),
        }
    }

    /// A sanitizer that knows which buffers and images nobody has filled.
    #[must_use]
    pub fn with_unwritten(self, unwritten: UnwrittenMemory) -> Self {
        Self { unwritten, ..self }
    }

    /// A sanitizer that knows which resources are bound, and so where several bindings reach the
    /// same memory.
    #[must_use]
    pub fn with_resources(self, resources: &Resources) -> Self {
        let overlapping = overlapping_bindings(resources);
        let plans = self.plans;
        Self { races: self.races.map(|_| Races::new(plans, &overlapping)), ..self }
    }

    /// The sanitizer of the shaders of a pipeline, which checks what follows from its records, too.
    #[must_use]
    pub fn of_pipeline(self, pipeline: &'a Pipeline) -> Self {
        Self { pipeline: Some(pipeline), ..self }
    }

    /// A sanitizer that notes each time that an invocation meets a finding.
    #[must_use]
    pub fn noting_occurrences(mut self, log: &OccurrenceLog) -> Self {
        self.findings.note_occurrences(log);
        self
    }

    /// What was found so far.
    pub fn findings(&self) -> &Findings {
        &self.findings
    }

    /// Goes on with plans, levels and a pipeline that lie elsewhere: while a run is paused, the
    /// sanitizer is kept without those of its owner.
    #[must_use]
    pub fn borrowing<'b>(
        self,
        plans: &'b [ProgramPlan],
        levels: &'b Levels,
        pipeline: Option<&'b Pipeline>,
    ) -> Sanitizer<'b> {
        Sanitizer {
            plans,
            levels,
            pipeline,
            causes: self.causes,
            findings: self.findings,
            frames: self.frames,
            races: self.races,
            shared: self.shared,
            unwritten: self.unwritten,
            expectations: self.expectations,
            first_workgroup: self.first_workgroup,
            matching_calls: self.matching_calls,
            ended: self.ended,
            passed: self.passed,
            query_surfaces: self.query_surfaces,
        }
    }

    /// What runs next is the part of a launch that begins at a place in launch order.
    pub fn begin_part(&mut self, place: u64) {
        self.unwritten.begin_part(place);
    }

    /// Adds what the sanitizer of other parts of the launch knows. Neither has found anything, and
    /// no invocation of the launch accesses memory that another one writes.
    pub fn merge(&mut self, other: Self) {
        self.unwritten.merge(other.unwritten);
        self.expectations.merge(other.expectations);
        self.passed.merge(other.passed);
    }

    /// What was found.
    pub fn into_findings(self) -> Findings {
        self.into_findings_and_unwritten().0
    }

    /// What was found, and what is still unwritten.
    pub fn into_findings_and_unwritten(self) -> (Findings, UnwrittenMemory) {
        let mut findings = self.findings;
        self.expectations.tell(self.plans, self.levels, &mut findings);
        self.passed.report(self.plans, self.levels, &mut findings);
        (findings, self.unwritten)
    }

    /// The number of a cause.
    pub(super) fn cause(&mut self, cause: Cause, details: impl FnOnce() -> Option<CauseDetails>) -> u32 {
        self.causes.number(cause, details)
    }

    /// The number of the cause that an operation loads what nobody has written: a part of a buffer
    /// or image, which the source may have a name for.
    pub(super) fn unwritten_cause(
        &mut self,
        rule: &'static Rule,
        place: OpPlace,
        part: UnwrittenPart,
        member: impl FnOnce() -> Option<String>,
    ) -> u32 {
        let Self { causes, unwritten, .. } = self;
        let details = || {
            let message = unwritten.describe(part, member());
            Some(CauseDetails { rule, message, operand: NO_CAUSE })
        };
        causes.number(Cause::UnwrittenPart { place, object: part.object }, details)
    }

    /// An operation has written a texel.
    pub(super) fn write_texel(&mut self, image: &Image, index: usize, place: OpPlace) {
        let program = || (self.plans[place.shader.index()].program.clone(), place.op);
        self.unwritten.write_texel(image, index, program);
    }

    /// The cause of what is undefined for a cause, once some of its bits are filled; `None` where
    /// all that there are then are.
    pub(super) fn filled_cause(&mut self, number: u32, bits: u32, all: u32) -> Option<u32> {
        let (of, before) = self.causes.unfilled(number);
        let bits = before | bits;
        match bits {
            0 => Some(of),
            bits if bits & all == all => None,
            bits => Some(self.cause(Cause::Filled { of, bits }, || None)),
        }
    }

    /// Whether a cause, by its number, is an instruction that made a NaN or an infinity.
    pub(super) fn is_born(&self, number: u32) -> bool {
        matches!(self.causes.get(number), Some((Cause::Born { .. }, _)))
    }

    /// The shader that runs, and its plan.
    pub(super) fn plan(&self) -> Option<(ShaderIndex, &'a ProgramPlan)> {
        let shader = self.frames.last()?.shader;
        Some((shader, self.plans.get(shader.index())?))
    }

    /// What makes reports of a batch.
    pub(super) fn reporter<'b, const W: usize>(&'b mut self, batch: &'b Batch<W>) -> Reporter<'b, W> {
        Reporter {
            plans: self.plans,
            levels: self.levels,
            causes: &self.causes,
            findings: &mut self.findings,
            frames: &self.frames,
            batch,
        }
    }

    /// Reports that something depends on a register, in the lanes where it is undefined.
    #[inline]
    pub(super) fn depend<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        register: Reg,
        sink: Sink,
    ) {
        self.depend_in(batch, shadow, op, register, sink, batch.mask);
    }

    /// As [`Sanitizer::depend`], in some lanes.
    #[inline]
    pub(super) fn depend_in<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        register: Reg,
        sink: Sink,
        lanes: Mask<W>,
    ) {
        let undefined = shadow.undefined(register) & lanes;
        if !undefined.is_empty() {
            self.reporter(batch).undefined(shadow, op, register, undefined, sink);
            // Told once: what is computed from the same register is not told again.
            shadow.define_lanes(register, undefined);
        }
    }

    /// As [`Sanitizer::depend`], of consecutive registers.
    pub(super) fn depend_on_all<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        first: Reg,
        count: u32,
        sink: Sink,
    ) {
        for word in 0..count {
            self.depend(batch, shadow, op, first.plus(word), sink);
        }
    }

    /// Makes the words of a variable undefined, as nobody has written them.
    pub(super) fn undefine_variable<const W: usize>(
        &mut self,
        shadow: &mut ShadowRegisters<W>,
        lanes: Mask<W>,
        first: Reg,
        count: u32,
        cause: impl Fn(u32) -> Cause,
    ) {
        if count == 0 || lanes.is_empty() {
            return;
        }
        let number = self.causes.of_words(count, cause);
        (0..count).for_each(|word| shadow.undefine(first.plus(word), lanes, number + word));
    }

    /// Reports undefined operands of an operation, and makes its results defined.
    pub(super) fn depend_on_reads<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        sink: Sink,
        accesses: &mut Accesses<'_>,
    ) {
        let mut written = Vec::new();
        accesses(&mut |access| match access {
            Access::Read(first, count) => self.depend_on_all(batch, shadow, op, first, count, sink),
            Access::Write(first, count) => written.push((first, count)),
            Access::Effect => {}
        });
        written.into_iter().for_each(|(first, count)| shadow.define_span(first, count, batch.mask));
    }

    /// As [`Sanitizer::tell`], of which the message needs the shader that runs.
    pub(super) fn tell_of_program<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        rule: &'static Rule,
        op: OpIndex,
        lanes: Mask<W>,
        message: impl FnOnce(&Program) -> String,
    ) {
        let Some((_, plan)) = self.plan() else { return };
        self.tell(batch, rule, op, lanes, |_| message(&plan.program));
    }

    /// An error about the shaders of this sanitizer, for what is told apart from values.
    pub(super) fn tell<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        rule: &'static Rule,
        op: OpIndex,
        lanes: Mask<W>,
        message: impl FnOnce(usize) -> String,
    ) {
        let Some(lane) = lanes.lowest() else { return };
        self.reporter(batch).broken(rule, op, lanes, message(lane));
    }

    /// Reports races of an operation.
    pub(super) fn tell_races<const W: usize>(&mut self, batch: &Batch<W>, op: OpIndex, found: &[Race]) {
        for race in found {
            self.reporter(batch).race(op, race);
        }
    }

    /// The causes of the bytes of a lane's workgroup.
    pub(super) fn shared_causes<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        lane: usize,
        shader: ShaderIndex,
    ) -> Option<&mut [u32]> {
        let workgroup = batch.invocations.workgroup(lane)?;
        let program = &self.plans.get(shader.index())?.program;
        Some(self.shared.causes(workgroup.index() as u32, |causes| {
            causes.resize(workgroup.memory.size() as usize, WorkgroupShadow::UNWRITTEN);
            for variable in program.workgroup_variables.iter().filter(|variable| variable.is_initialized) {
                causes[variable.bytes.start as usize..variable.bytes.end as usize].fill(NO_CAUSE);
            }
        }))
    }
}
