//! Drawn bits for what is undefined: variables that were not written yet, and `OpUndef`.

use rustc_hash::FxHashMap;

use crate::machine::{Batch, ChoiceKind, DrawnDetails, OpIndex, OpenChoices, Reg};
use crate::math::random::Random;
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Module};
use crate::ops::memory::MemoryOp;
use crate::ops::op::Op;
use crate::ops::pointer::{pointer_word_count, storage};
use crate::program::Program;

/// `OpVariable`
const VARIABLE: u16 = 59;
/// `OpUndef`
const UNDEF: u16 = 1;

/// What a word of a value in registers is, as far as bits may be drawn for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WordKind {
    /// A handle or an address: it stays as it is.
    Kept,
    /// 0 or 1.
    Bool,
    /// An integer of a width, or half of one.
    Integer(u32),
    /// A float of a width, or half of one.
    Float(u32),
}

impl WordKind {
    /// Draws a word: any bits, or a number as shaders have them.
    fn draw(self, random: &mut Random) -> Option<u32> {
        let bits = random.bits();
        let any = (bits >> 32) as u32;
        let is_small = bits & 1 == 0;
        Some(match self {
            Self::Kept => return None,
            Self::Bool => any & 1,
            Self::Integer(32..) if !is_small => any,
            // Narrow integers are extended in their registers: small ones, whether signed or not.
            Self::Integer(_) => any & 0x7,
            Self::Float(32) if is_small => (random.unit() * 4.0 - 2.0).to_bits(),
            Self::Float(32..) => any,
            Self::Float(width) => any & ((1 << width) - 1),
        })
    }

    /// Appends the kinds of the words of a type.
    fn of_type(module: &Module, ty: TypeId, kinds: &mut Vec<Self>) {
        match *module.ty(ty) {
            Type::Bool => kinds.push(Self::Bool),
            Type::Int { width, .. } => kinds.extend(vec![Self::Integer(width); width.div_ceil(32) as usize]),
            Type::Float { width, .. } => kinds.extend(vec![Self::Float(width); width.div_ceil(32) as usize]),
            Type::Vector { component: part, count } | Type::Matrix { column: part, count } => {
                (0..count).for_each(|_| Self::of_type(module, part, kinds));
            }
            Type::Array { element, length, .. } => {
                let mut one = Vec::new();
                Self::of_type(module, element, &mut one);
                let count = module.scalar_value(length).unwrap_or(0);
                (0..count).for_each(|_| kinds.extend(&one));
            }
            Type::Struct { ref members, .. } => {
                members.iter().for_each(|member| Self::of_type(module, member.ty, kinds));
            }
            Type::AccelerationStructure => kinds.extend([Self::Kept; 2]),
            Type::Pointer { storage_class, .. } => {
                kinds.extend(vec![Self::Kept; pointer_word_count(storage_class) as usize]);
            }
            _ => kinds.push(Self::Kept),
        }
    }
}

/// Registers that are undefined from some point on.
#[derive(Clone, Debug)]
struct UndefinedRegisters {
    /// The variable, or the result of an instruction.
    id: Id,
    first: Reg,
    words: Vec<WordKind>,
}

/// What of a program is undefined when it begins, and which operations leave more undefined.
#[derive(Debug)]
pub(super) struct UndefinedParts {
    variables: Vec<UndefinedRegisters>,
    by_op: FxHashMap<OpIndex, UndefinedRegisters>,
}

impl UndefinedParts {
    /// The undefined parts of a program that is not optimised.
    pub(super) fn of(program: &Program) -> Self {
        let module = &program.module;
        let registers = |id, ty, first, count: u32| {
            let mut words = Vec::new();
            WordKind::of_type(module, ty, &mut words);
            words.truncate(count as usize);
            UndefinedRegisters { id, first, words }
        };
        let is_given =
            |class| matches!(class, storage::INCOMING_RAY_PAYLOAD | storage::INCOMING_CALLABLE_DATA);
        let own = program.interface.iter().filter(|one| !is_given(one.storage_class));
        let variables = own.map(|one| registers(one.variable, one.ty, one.first, one.count)).collect();
        let results = results(module);
        let by_op = program.ops.iter().zip(&program.origins).enumerate().filter_map(|(at, (op, origin))| {
            let &Op::Memory(MemoryOp::Undefine { first, count }) = op else { return None };
            let (id, ty) = results.get(&origin.offset).copied()?;
            Some((OpIndex::new(at), registers(id, ty, first, count)))
        });
        Self { variables, by_op: by_op.collect() }
    }

    /// Draws the variables of lanes that begin.
    pub(super) fn begin<const W: usize>(&self, choices: &OpenChoices, batch: &mut Batch<W>) {
        for registers in &self.variables {
            registers.draw(choices, None, batch);
        }
    }

    /// Draws what an operation has left undefined.
    pub(super) fn after<const W: usize>(&self, choices: &OpenChoices, op: OpIndex, batch: &mut Batch<W>) {
        if let Some(registers) = self.by_op.get(&op) {
            registers.draw(choices, Some(op), batch);
        }
    }
}

impl UndefinedRegisters {
    /// Draws the registers in the lanes that run.
    fn draw<const W: usize>(&self, choices: &OpenChoices, op: Option<OpIndex>, batch: &mut Batch<W>) {
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
            choices.note(site, || DrawnDetails::Value { shader: choices.shader, op, id: self.id.0 });
        }
    }
}

/// By the words of instructions in a module: their results, with the type of what a variable holds,
/// or of a component of a vector, unless all of it is undefined.
fn results(module: &Module) -> FxHashMap<u32, (Id, TypeId)> {
    let blocks = module.functions.iter().flat_map(|function| &function.blocks);
    let instructions = blocks.flat_map(|block| &block.instructions);
    let results = instructions.filter_map(|one| {
        let id = one.result?;
        let ty = match one.opcode {
            VARIABLE => module.pointee(id)?,
            UNDEF => module.type_of(id)?,
            _ => match *module.ty(module.type_of(id)?) {
                Type::Vector { component, .. } => component,
                _ => return None,
            },
        };
        Some((one.offset, (id, ty)))
    });
    results.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_drawn_as_their_type_has_them() {
        let mut random = Random::new(1);
        let mut draw = |kind: WordKind| (0..200).filter_map(|_| kind.draw(&mut random)).collect::<Vec<u32>>();
        assert!(draw(WordKind::Kept).is_empty());
        assert!(draw(WordKind::Bool).iter().all(|&word| word <= 1));
        assert!(draw(WordKind::Integer(8)).iter().all(|&word| word < 0x80));
        assert!(draw(WordKind::Float(16)).iter().all(|&word| word <= 0xFFFF));
        let floats = draw(WordKind::Float(32));
        assert!(floats.iter().any(|&word| f32::from_bits(word).abs() > 2.0));
        assert!(floats.iter().filter(|&&word| f32::from_bits(word).abs() <= 2.0).count() > 80);
    }
}
