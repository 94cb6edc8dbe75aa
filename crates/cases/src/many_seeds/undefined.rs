//! Drawn bits for what is undefined: variables that were not written yet, and `OpUndef`.

use rustc_hash::FxHashMap;

use crate::many_seeds::first_reads::FirstReads;
use crate::many_seeds::word_kind::WordKind;
use anyhit_engine::machine::stop::RegSpan;
use anyhit_engine::machine::{Batch, ChoiceKind, DrawnDetails, Lanes, OpIndex, OpenChoices, Reg};
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Id, Module, Opcode};
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;

/// Registers that are undefined from some point on.
#[derive(Clone, Debug)]
struct UndefinedRegisters {
    /// The variable, or the result of an instruction.
    id: Id,
    /// Its name, or its number.
    name: String,
    first: Reg,
    words: Vec<WordKind>,
    /// The operation that leaves them undefined, or the first that reads them.
    told_at: Option<OpIndex>,
}

/// What of a program is undefined when it begins, and which operations leave more undefined.
#[derive(Debug)]
pub(super) struct UndefinedParts {
    variables: Vec<UndefinedRegisters>,
    /// `OpUndef` at module scope.
    constants: Vec<UndefinedRegisters>,
    by_op: FxHashMap<OpIndex, UndefinedRegisters>,
}

impl UndefinedParts {
    /// The undefined parts of a program that is not optimised.
    pub(super) fn of(program: &Program) -> Self {
        let module = &program.module;
        let reads = FirstReads::of(program);
        let registers = |id, ty, first, count: u32| {
            let mut words = Vec::new();
            WordKind::of_type(module, ty, &mut words);
            words.truncate(count as usize);
            UndefinedRegisters { id, name: told_name(module, id), first, words, told_at: reads.find(id) }
        };
        let is_given =
            |class| matches!(class, storage::INCOMING_RAY_PAYLOAD | storage::INCOMING_CALLABLE_DATA);
        let own = program.interface.iter().filter(|one| !is_given(one.storage_class));
        let variables = own.map(|one| registers(one.variable, one.ty, one.first, one.count)).collect();
        let constants = program.undefined_constants.iter();
        let constants = constants.map(|one| registers(one.id, one.ty, one.first, one.count)).collect();
        let results = results(module);
        let by_op = program.ops.iter().zip(&program.origins).enumerate().filter_map(|(at, (op, origin))| {
            let RegSpan { first, count } = op.undefines()?;
            let (id, ty) = results.get(&origin.offset).copied()?;
            let (op, registers) = (OpIndex::new(at), registers(id, ty, first, count));
            Some((op, UndefinedRegisters { told_at: Some(op), ..registers }))
        });
        Self { variables, constants, by_op: by_op.collect() }
    }

    /// Draws the variables and constants of lanes that begin.
    pub(super) fn begin<const W: usize>(&self, choices: &OpenChoices, batch: &mut Batch<W>) {
        // Constants still hold what was drawn for the lanes before.
        for UndefinedRegisters { first, words, .. } in &self.constants {
            batch.registers.span_mut(*first, words.len() as u32).fill(Lanes::splat(0));
        }
        for registers in self.variables.iter().chain(&self.constants) {
            registers.draw(choices, batch);
        }
    }

    /// Draws what an operation has left undefined.
    pub(super) fn after<const W: usize>(&self, choices: &OpenChoices, op: OpIndex, batch: &mut Batch<W>) {
        if let Some(registers) = self.by_op.get(&op) {
            registers.draw(choices, batch);
        }
    }
}

impl UndefinedRegisters {
    /// Draws the registers in the lanes that run.
    fn draw<const W: usize>(&self, choices: &OpenChoices, batch: &mut Batch<W>) {
        if self.words.iter().all(|&kind| kind == WordKind::Kept) {
            return;
        }
        for lane in batch.mask.lanes() {
            let place = u64::from(choices.shader.0) << 32 | u64::from(self.id.0);
            let launch_id = batch.invocations.launch_id(lane);
            let site = choices.site(ChoiceKind::UndefinedValue, launch_id, place);
            let Some(mut random) = choices.draw(site) else { continue };
            for (register, kind) in (0..).map(|word| self.first.plus(word)).zip(&self.words) {
                if let Some(word) = kind.draw(&mut random) {
                    batch.registers[register].0[lane] = word;
                }
            }
            let what = || Some(format!("{} is read before anything is written to it", self.name));
            let (shader, op) = (choices.shader, self.told_at);
            choices.note(site, || DrawnDetails::Value { shader, op, what: what() });
        }
    }
}

/// The name of a variable or a result in reports.
pub(super) fn told_name(module: &Module, id: Id) -> String {
    module.name(id).map_or_else(|| format!("%{}", id.0), |name| format!("`{name}`"))
}

/// By the words of instructions in a module: their results, with the type of what a variable holds,
/// or of a component of a vector, unless all of it is undefined.
fn results(module: &Module) -> FxHashMap<u32, (Id, TypeId)> {
    let results = module.instructions().filter_map(|one| {
        let id = one.result?;
        let ty = match one.opcode {
            Opcode::Variable => module.pointee(id)?,
            Opcode::Undef | Opcode::PoisonKHR => module.type_of(id)?,
            _ => match *module.ty(module.type_of(id)?) {
                Type::Vector { component, .. } => component,
                _ => return None,
            },
        };
        Some((one.offset, (id, ty)))
    });
    results.collect()
}
