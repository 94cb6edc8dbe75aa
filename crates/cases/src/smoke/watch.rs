//! Records the operations that a run executes, and answers calls in place of missing shaders.

use std::collections::HashMap;

use crate::smoke::fill::{ValueSource, mix};
use crate::smoke::resources;
use anyhit_base::sorted::SortedSet;
use anyhit_engine::machine::{Batch, Bindings, Observer, OpIndex, RayQueryStep, ShaderIndex};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::op::Op;
use anyhit_engine::pipeline::{Caller, Event, PipelineObserver};
use anyhit_engine::program::Program;

/// Sees which operations of one program run.
pub(super) struct OpRecorder<'a> {
    program: &'a Program,
    executed: Vec<bool>,
    passed: Vec<bool>,
    /// Operations, counted once for all lanes of a batch.
    pub spent: u64,
}

impl<'a> OpRecorder<'a> {
    /// One that has seen nothing.
    pub(super) fn new(program: &'a Program) -> Self {
        let none = vec![false; program.ops.len()];
        Self { program, executed: none.clone(), passed: none, spent: 0 }
    }

    /// The instructions that some lane executed and went on from, by their word offset.
    pub(super) fn passed(&self) -> SortedSet<u32> {
        self.offsets(&self.passed)
    }

    /// The instructions that some lane executed, by their word offset.
    pub(super) fn executed(&self) -> SortedSet<u32> {
        self.offsets(&self.executed)
    }

    fn offsets(&self, ops: &[bool]) -> SortedSet<u32> {
        let marked = ops.iter().zip(&self.program.origins).filter(|(marked, _)| **marked);
        marked.map(|(_, origin)| origin.offset).collect()
    }
}

impl<const W: usize> Observer<W> for OpRecorder<'_> {
    fn resumed(&mut self, _: ShaderIndex, batch: &mut Batch<W>) {
        // Behind a trace or call of which some lane came back.
        if let Some(last) = batch.op.previous()
            && !batch.mask.is_empty()
            && self.program.ops.get(last.index()).is_some_and(Op::stops)
            && self.executed[last.index()]
        {
            self.passed[last.index()] = true;
        }
    }

    fn before(&mut self, batch: &mut Batch<W>, op: OpIndex) -> bool {
        if !batch.mask.is_empty() {
            self.executed[op.index()] = true;
        }
        self.spent += 1;
        false
    }

    fn after(&mut self, _: &mut Batch<W>, _: &Bindings, op: OpIndex) {
        self.passed[op.index()] = true;
    }
}

/// The instructions of a program that trace, and those that begin ray queries, by their word
/// offsets.
pub(super) fn tracing(program: &Program) -> [SortedSet<u32>; 2] {
    let mut found = [SortedSet::new(), SortedSet::new()];
    for (op, origin) in program.ops.iter().zip(&program.origins) {
        let kind = match (op.traces(), op.begins_query()) {
            (true, _) => 0,
            (_, true) => 1,
            _ => continue,
        };
        found[kind].insert(origin.offset);
    }
    found
}

/// What integers of an answer are that is far from others.
const FAR: u32 = 1000;

/// How often what happened.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Happened {
    /// Rays that the shader traced.
    pub traces: u64,
    /// Ray queries that it began.
    pub ray_queries: u64,
    /// Any-hit shaders that ran.
    pub any_hits: u64,
    /// Hits that intersection shaders reported.
    pub reports: u64,
}

/// Answers in the place of the shaders that are not there, and counts what happens.
pub(super) struct StandIn<'a> {
    program: &'a Program,
    numbers: ValueSource,
    launch_id: [u32; 3],
    /// How many answers each invocation was given.
    answers: HashMap<[u32; 3], u64>,
    /// What happened so far.
    pub happened: Happened,
}

impl<'a> StandIn<'a> {
    /// One whose answers are made of these numbers.
    pub(super) fn new(program: &'a Program, numbers: ValueSource) -> Self {
        let (launch_id, answers) = ([0; 3], HashMap::new());
        Self { program, numbers, launch_id, answers, happened: Happened::default() }
    }
}

impl PipelineObserver for StandIn<'_> {
    fn invocation(&mut self, launch_id: [u32; 3]) {
        self.launch_id = launch_id;
    }

    fn event(&mut self, event: Event) {
        let happened = &mut self.happened;
        let count = match event {
            Event::Trace { caller: Some(_), .. } => &mut happened.traces,
            Event::RayQuery(event) if matches!(event.step, RayQueryStep::Initialize(..)) => {
                &mut happened.ray_queries
            }
            Event::Enter { stage: Stage::AnyHit, .. } => &mut happened.any_hits,
            Event::Report { .. } => &mut happened.reports,
            _ => return,
        };
        *count += 1;
    }

    /// The answer depends on the invocation and on how many it was given before: not on the order
    /// in which invocations run.
    fn null_shader(&mut self, caller: Caller, words: &mut [u32]) -> bool {
        let before = self.answers.entry(self.launch_id).or_default();
        let [x, y, z] = self.launch_id.map(u64::from);
        let before = std::mem::replace(before, *before + 1);
        let root = mix(mix(x | y << 32, z), before);
        let registers = self.program.interface.iter().find(|registers| registers.first == caller.payload);
        let Some(registers) = registers.filter(|_| caller.shader == ShaderIndex(0)) else { return false };
        // Loops that wait for a sum end, too.
        let far = FAR.saturating_mul(1 + (before / 16) as u32);
        let answer = resources::answer(&self.program.module, registers, self.numbers, root, far);
        words.iter_mut().zip(answer).for_each(|(to, word)| *to = word);
        true
    }
}
