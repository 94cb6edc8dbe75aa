//! Drawn contents of the memory of workgroups, before anything is written to it.

use crate::many_seeds::first_reads::FirstReads;
use crate::many_seeds::undefined::told_name;
use crate::many_seeds::word_kind::WordKind;
use anyhit_engine::machine::{Batch, ChoiceKind, DrawnDetails, OpIndex, OpenChoices, Workgroup};
use anyhit_engine::program::Program;

/// A variable in workgroup memory that has no initializer.
#[derive(Debug)]
struct SharedVariable {
    id: u32,
    name: String,
    /// The first operation that reads it.
    read: Option<OpIndex>,
    /// The offset of its first word.
    offset: u64,
    words: Vec<WordKind>,
}

/// The variables of a program in workgroup memory that have no initializer.
#[derive(Debug)]
pub(super) struct SharedVariables(Vec<SharedVariable>);

impl SharedVariables {
    /// Those of a program.
    pub(super) fn of(program: &Program) -> Self {
        let module = &program.module;
        let reads = FirstReads::of(program);
        let variables = program.workgroup_variables.iter().filter(|variable| !variable.is_initialized);
        let shared = variables.map(|variable| {
            let count = variable.bytes.len() / 4;
            let mut words = Vec::new();
            match module.pointee(variable.id) {
                Some(ty) if !variable.is_block => WordKind::of_type(module, ty, &mut words),
                _ => words.resize(count, WordKind::Integer(u32::BITS)),
            }
            words.truncate(count);
            let (id, name) = (variable.id.0, told_name(module, variable.id));
            let read = reads.find(variable.id);
            SharedVariable { id, name, read, offset: variable.bytes.start.into(), words }
        });
        Self(shared.collect())
    }

    /// Draws the memory of the workgroups of lanes that begin. All invocations of a workgroup begin
    /// before one of them runs.
    pub(super) fn begin<const W: usize>(&self, choices: &OpenChoices, batch: &Batch<W>) {
        if self.0.is_empty() {
            return;
        }
        let mut last = None;
        for lane in batch.mask.lanes() {
            let Some(workgroup) = batch.invocations.workgroup(lane) else { continue };
            if last.replace(workgroup.id) != Some(workgroup.id) {
                self.0.iter().for_each(|variable| variable.draw(choices, workgroup));
            }
        }
    }
}

impl SharedVariable {
    /// Draws the variable in the memory of a workgroup.
    fn draw(&self, choices: &OpenChoices, workgroup: &Workgroup) {
        let place = u64::from(choices.shader.0) << 32 | u64::from(self.id);
        let site = choices.site(ChoiceKind::WorkgroupMemory, workgroup.global_id(0), place);
        let Some(mut random) = choices.draw(site) else { return };
        for (offset, kind) in (self.offset..).step_by(4).zip(&self.words) {
            if let Some(word) = kind.draw(&mut random) {
                workgroup.memory.store(offset, u32::BITS, word);
            }
        }
        let what =
            || Some(format!("{} in workgroup memory is read before anything is written to it", self.name));
        let (shader, op) = (choices.shader, self.read);
        choices.note(site, || DrawnDetails::Value { shader, op, what: what() });
    }
}
