//! Changes to the operands of an instruction.

use rspirv::spirv::Op;

use super::opcodes::{decoration, name, storage_class};
use super::{Original, Random, Slot};

impl Original {
    pub(super) fn operand_of_its_type(&mut self, random: &mut Random) -> Option<String> {
        let (at, operand) = self.value_operand(random)?;
        let ty = self.types[&self.instructions[at].word(operand)];
        let word = *random.pick(self.values.get(&ty)?)?;
        self.set(at, operand, word)
    }

    pub(super) fn operand_of_another_type(&mut self, random: &mut Random) -> Option<String> {
        let (at, operand) = self.value_operand(random)?;
        // Constants are defined everywhere.
        let from = if random.below(2) == 0 { &self.constants } else { &self.value_ids };
        let word = *random.pick(from)?;
        self.set(at, operand, word)
    }

    pub(super) fn operand_of_any_kind(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| one.operands.iter().any(|(_, slot)| *slot == Slot::Id))?;
        let places = self.instructions[at].places(|slot| slot == Slot::Id);
        let operand = *random.pick(&places)?;
        let old = self.instructions[at].word(operand);
        let word = match random.below(4) {
            0 => *random.pick(&self.all_ids)?,
            // Of the same kind, and defined before.
            _ => {
                let is_type = self.type_ids.contains(&old);
                let before = self.instructions[..at].iter().filter(|one| match is_type {
                    true => name(one.op).starts_with("Type"),
                    false => one.result_type.is_some(),
                });
                let before: Vec<u32> = before.filter_map(|one| one.result).collect();
                *random.pick(&before)?
            }
        };
        self.set(at, operand, word)
    }

    pub(super) fn result_type(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| one.result_type.is_some())?;
        let ty = *random.pick(&self.types_before(at))?;
        let one = &mut self.instructions[at];
        let old = one.result_type.replace(ty);
        (old != Some(ty)).then(|| format!("result type of {:?} becomes {ty}", one.op))
    }

    pub(super) fn number(&self, old: u32, random: &mut Random) -> u32 {
        match random.below(6) {
            0 => old.wrapping_add(1),
            1 => old.wrapping_sub(1),
            2 => random.below(9) as u32,
            3 => 1 << random.below(32),
            4 => [u32::MAX, 0x3f80_0000, 0x7fc0_0000, 255, 256, 65536][random.below(6)],
            _ => random.pick(&self.literals).copied().unwrap_or(0),
        }
    }

    pub(super) fn literal(&mut self, random: &mut Random) -> Option<String> {
        let is_literal = |slot: Slot| slot == Slot::Literal;
        let at = self.anywhere(random, |one| one.operands.iter().any(|(_, slot)| is_literal(*slot)))?;
        let places = self.instructions[at].places(is_literal);
        let operand = *random.pick(&places)?;
        let word = self.number(self.instructions[at].word(operand), random);
        self.set(at, operand, word)
    }

    pub(super) fn enumerant(&mut self, random: &mut Random) -> Option<String> {
        let wanted = |slot: Slot| {
            matches!(slot, Slot::Enumerant | Slot::BuiltIn | Slot::Decoration | Slot::StorageClass)
        };
        let at = self.anywhere(random, |one| one.operands.iter().any(|(_, slot)| wanted(*slot)))?;
        let places = self.instructions[at].places(wanted);
        let operand = *random.pick(&places)?;
        let (old, slot) = self.instructions[at].operands[operand];
        let op = self.instructions[at].op;
        let word = match slot {
            // One class of the two that must agree: `storage_class` changes both.
            Slot::StorageClass if random.below(4) > 0 => return None,
            Slot::StorageClass => storage_class(random),
            Slot::BuiltIn => *random.pick(&[
                6, 7, 24, 25, 26, 27, 28, 29, 36, 41, 4416, 5319, 5320, 5321, 5322, 5325, 5326, 5327, 5330,
                5331, 5333, 5335, 5351, 5352, 5359, 5361, 5396, 5420, 5436, 6021, 0, 1, 15, 42,
            ])?,
            Slot::Decoration => decoration(random),
            _ if op == Op::Capability => {
                *random.pick(&[1, 9, 10, 11, 22, 39, 50, 61, 4441, 4472, 4478, 4479, 5301])?
            }
            _ if op == Op::EntryPoint => *random.pick(&[0, 4, 5, 5313, 5314, 5315, 5316, 5317, 5318])?,
            _ if op == Op::ExecutionMode => {
                *random.pick(&[17, 38, 5289, 5290, 4459, 4460, 4461, 4462, 7, 0])?
            }
            _ => match random.below(4) {
                0 => old ^ (1 << random.below(8)),
                1 => old.wrapping_add(1),
                2 => 0,
                _ => random.below(16) as u32,
            },
        };
        self.set(at, operand, word)
    }

    pub(super) fn constant(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| matches!(one.op, Op::Constant | Op::SpecConstant))?;
        let word = self.number(self.instructions[at].word(0), random);
        self.set(at, 0, word)
    }

    /// The class of a pointer type and of all variables that have it.
    pub(super) fn storage_class(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| one.op == Op::TypePointer && !one.operands.is_empty())?;
        let class = storage_class(random);
        let ty = self.instructions[at].result;
        let old = self.instructions[at].word(0);
        self.instructions[at].operands[0].0 = class;
        for one in &mut self.instructions {
            if one.op == Op::Variable
                && one.result_type == ty
                && let Some(own) = one.operands.first_mut()
            {
                own.0 = class;
            }
        }
        (old != class).then(|| format!("pointers and variables of storage class {old} get {class}"))
    }

    pub(super) fn operand_count(&mut self, random: &mut Random) -> Option<String> {
        let at = match random.below(2) {
            0 => self.in_function(random, |one| {
                matches!(one.op, Op::Load | Op::Store | Op::CopyMemory) || name(one.op).starts_with("Image")
            })?,
            _ => self.anywhere(random, |one| !one.operands.is_empty())?,
        };
        let value = random.pick(&self.value_ids).copied().unwrap_or(1);
        let scope = random.pick(&self.constants).copied().unwrap_or(1);
        let one = &mut self.instructions[at];
        let op = one.op;
        let plain = match op {
            Op::Load => one.operands.len() == 1,
            Op::Store | Op::CopyMemory => one.operands.len() == 2,
            _ => false,
        };
        if plain {
            let (mask, more): (u32, Vec<u32>) = match random.below(6) {
                0 => (1, vec![]),
                1 => (2, vec![1 << random.below(6)]),
                2 => (4, vec![]),
                3 => (2, vec![3]),
                4 => (8 | 16 | 32, vec![scope]),
                _ => (64, vec![]),
            };
            one.operands.push((mask, Slot::Enumerant));
            one.operands.extend(more.into_iter().map(|word| (word, Slot::Literal)));
            return Some(format!("memory operands {mask} for {op:?}"));
        }
        match random.below(3) {
            0 => {
                one.operands.pop();
                Some(format!("the last operand of {op:?} dropped"))
            }
            1 => {
                one.operands.push((value, Slot::Id));
                Some(format!("one operand more for {op:?}"))
            }
            _ => {
                let bit = 1 << random.below(14);
                one.operands.push((bit, Slot::Enumerant));
                let ids = match bit {
                    0x4 => 2,
                    0x400 | 0x800 | 0x1000 | 0x2000 => 0,
                    _ => 1,
                };
                one.operands.extend((0..ids).map(|_| (value, Slot::Id)));
                Some(format!("image operand {bit:#x} for {op:?}"))
            }
        }
    }

    pub(super) fn extended(&mut self, random: &mut Random) -> Option<String> {
        let at = self.in_function(random, |one| one.op == Op::ExtInst)?;
        let operand = *self.instructions[at].places(|slot| slot == Slot::Extended).first()?;
        let word = match random.below(3) {
            0 => random.below(82) as u32,
            1 => self.instructions[at].word(operand).wrapping_add(1),
            _ => self.instructions[at].word(operand).wrapping_sub(1),
        };
        self.set(at, operand, word)
    }

    pub(super) fn swap_operands(&mut self, random: &mut Random) -> Option<String> {
        let at = self.in_function(random, |one| one.operands.len() >= 2)?;
        let one = &mut self.instructions[at];
        let (left, right) = (random.below(one.operands.len()), random.below(one.operands.len()));
        let differ = one.operands[left] != one.operands[right];
        one.operands.swap(left, right);
        differ.then(|| format!("operands {left} and {right} of {:?} change places", one.op))
    }
}
