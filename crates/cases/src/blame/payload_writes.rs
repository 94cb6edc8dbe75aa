//! Finds the line that wrote a word of a ray's payload last.

use std::cell::Cell;
use std::collections::HashMap;

use crate::blame::{Blame, last_write};
use crate::case::Loaded;
use crate::observe::fresh_resources;
use crate::run::trace;
use anyhit_engine::machine::{Batch, Bindings, Observer, OpIndex, Reg, ShaderIndex};
use anyhit_engine::ops::access::{Access, ComputedRegisters};
use anyhit_engine::ops::memory::computed_register;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::pipeline::{Event, Launch, Pipeline};
use anyhit_engine::program::Program;
use anyhit_explain::names;
use anyhit_scene::file::RayEntry;

/// Finds who wrote a word of the payload of a ray; of an invocation of ray generation, that of its
/// first ray.
pub(super) fn blame(loaded: &Loaded, ray: &RayEntry, word: u32) -> Option<Blame> {
    let resources = fresh_resources(&loaded.assembled);
    let single = loaded.assembled.single_launch(ray.pass().map(|key| key.value.0.as_str())).ok()?;
    single.run_before(&resources).ok()?;
    let resources = single.resources(&resources);
    let launch = Launch { pipeline: &single.pipeline, resources: &resources };
    let depth = Cell::new(0_u32);
    let has_ended = Cell::new(false);
    let mut finder = PayloadFinder::new(&single.pipeline, word, &has_ended);
    let mut on_event = |event: Event| match event {
        Event::Trace { .. } => depth.set(depth.get() + 1),
        Event::Traced { .. } => {
            depth.set(depth.get().saturating_sub(1));
            has_ended.set(has_ended.get() || depth.get() == 0);
        }
        _ => {}
    };
    let _ = trace(&loaded.scene, &launch, single.size_in(&resources), ray, &mut on_event, Some(&mut finder));
    Some(finder.into_blame())
}

/// A write of the word.
#[derive(Clone, Copy, Debug)]
struct PayloadWrite {
    shader: ShaderIndex,
    op: OpIndex,
    was_unchanged: bool,
}

/// Observes the registers that hold the word in each shader that is given the payload.
struct PayloadFinder<'a> {
    pipeline: &'a Pipeline,
    /// The word in the payload of the ray.
    word: u32,
    /// Whether the ray has ended, after which its payload is the caller's.
    has_ended: &'a Cell<bool>,
    shader: ShaderIndex,
    /// The depth of rays that were given the payload on, and the word in theirs.
    levels: Vec<(u32, u32)>,
    /// What the word held before the running operation.
    before: Option<u32>,
    last: Option<PayloadWrite>,
    /// The last operation of ray generation that wrote each register, until it traces.
    caller_writes: HashMap<Reg, OpIndex>,
    has_traced: bool,
}

impl<'a> PayloadFinder<'a> {
    fn new(pipeline: &'a Pipeline, word: u32, has_ended: &'a Cell<bool>) -> Self {
        Self {
            pipeline,
            word,
            has_ended,
            shader: ShaderIndex(0),
            levels: vec![(1, word)],
            before: None,
            last: None,
            caller_writes: HashMap::new(),
            has_traced: false,
        }
    }

    fn program(&self) -> &'a Program {
        &self.pipeline.programs[self.shader.index()]
    }

    /// The register of the running shader that holds the word.
    fn register(&self, batch: &Batch<1>) -> Option<Reg> {
        if self.has_ended.get() {
            return None;
        }
        let &(_, word) = self.levels.iter().rfind(|(depth, _)| *depth == batch.invocations.depth)?;
        let registers = self.program().interface_registers(storage::INCOMING_RAY_PAYLOAD)?;
        (word < registers.count).then(|| registers.first.plus(word))
    }

    /// Whether an operation writes a register.
    fn writes(op: &Op, batch: &Batch<1>, register: Reg) -> bool {
        if let Some(ComputedRegisters { count, first, index, writes: true, .. }) = op.computed_registers() {
            let at = computed_register(&batch.registers, first, batch.registers[index].0[0], count);
            return at.is_ok_and(|at| (at..at.plus(count)).contains(&register));
        }
        // What begins to live undefined is not written.
        if op.undefines().is_some() || op.calls_pipeline() {
            return false;
        }
        let mut writes = false;
        op.accesses(|access| {
            if let Access::Write(first, count) = access {
                writes |= (first..first.plus(count)).contains(&register);
            }
        });
        writes
    }

    /// Notes which registers ray generation has written, and what they are when it traces.
    fn observe_caller(&mut self, op: OpIndex) {
        let op_of = |op: OpIndex| self.program().ops.get(op.index());
        let Some(running) = op_of(op) else { return };
        if running.calls_pipeline() {
            let span = running.payload_span().filter(|span| self.word < span.count);
            let written = span.and_then(|span| self.caller_writes.get(&span.first.plus(self.word)));
            self.last = written.map(|&op| PayloadWrite { shader: self.shader, op, was_unchanged: false });
            self.has_traced = span.is_some();
            return;
        }
        running.accesses(|access| {
            if let Access::Write(first, count) = access {
                self.caller_writes.extend((0..count).map(|word| (first.plus(word), op)));
            }
        });
    }

    fn into_blame(self) -> Blame {
        let Some(PayloadWrite { shader, op, was_unchanged }) = self.last else {
            let note = "never written: it still has the initial value of the ray's payload";
            return Blame { notes: vec![note.to_owned()], ..Blame::default() };
        };
        let program = &self.pipeline.programs[shader.index()];
        let line = names::source_line(program, op);
        let name = format!("{} `{}`", program.stage.name(), program.name);
        let note = last_write(line.as_ref(), &name, was_unchanged);
        Blame { request: None, line, notes: vec![note] }
    }
}

impl Observer<1> for PayloadFinder<'_> {
    fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<1>) {
        self.shader = shader;
        let depth = batch.invocations.depth;
        while self.levels.len() > 1 && self.levels.last().is_some_and(|(level, _)| *level > depth) {
            self.levels.pop();
        }
        self.before = self.register(batch).map(|register| batch.registers[register].0[0]);
    }

    fn before(&mut self, batch: &mut Batch<1>, op: OpIndex) -> bool {
        if batch.invocations.depth == 0 && !self.has_traced {
            self.observe_caller(op);
        }
        let Some(register) = self.register(batch) else { return false };
        self.before = Some(batch.registers[register].0[0]);
        // A payload that is given on is that of the next ray, too.
        if let Some(span) = self.program().ops.get(op.index()).and_then(Op::payload_span)
            && (span.first..span.first.plus(span.count)).contains(&register)
        {
            self.levels.push((batch.invocations.depth + 1, register.0 - span.first.0));
        }
        false
    }

    fn after(&mut self, batch: &mut Batch<1>, _: &Bindings, op: OpIndex) {
        let Some(register) = self.register(batch) else { return };
        let Some(running) = self.program().ops.get(op.index()) else { return };
        if Self::writes(running, batch, register) {
            let was_unchanged = self.before == Some(batch.registers[register].0[0]);
            self.last = Some(PayloadWrite { shader: self.shader, op, was_unchanged });
        }
    }
}
