//! Changes to what a module declares: capabilities, extensions, versions, layouts.

use rspirv::spirv::{self, Op};

use super::{Instruction, Original, Random, Slot};

/// Decorations of a layout: `ArrayStride`, `MatrixStride`, `Offset`.
const LAYOUT: [u32; 3] = [6, 7, 35];

impl Original {
    /// A mutant whose declarations differ, with what was done to it.
    pub fn declaration_mutant(&self, random: &mut Random) -> (Vec<u32>, String) {
        type Change = fn(&mut Original, &mut Random) -> Option<String>;
        const CHANGES: &[(usize, Change)] = &[
            (14, Original::drop_declared),
            (4, Original::replace_capability),
            (3, Original::older),
            (10, Original::layout_number),
            (4, Original::drop_layout),
            (2, Original::transpose_layout),
            (4, Original::any_enumerant),
            (4, Original::retype),
            (3, Original::type_declaration),
            (4, Original::storage_class),
            (3, Original::decorate),
            (3, Original::opcode),
            (2, Original::constant),
        ];
        let mut copy = self.clone();
        let mut story = Vec::new();
        let changes = [1, 1, 1, 1, 1, 2, 2, 3][random.below(8)];
        for _ in 0..40 {
            let mut draw = random.below(CHANGES.iter().map(|(weight, _)| weight).sum());
            for (weight, change) in CHANGES {
                if draw < *weight {
                    story.extend(change(&mut copy, random));
                    break;
                }
                draw -= weight;
            }
            if story.len() == changes {
                break;
            }
        }
        (copy.words(), story.join(", "))
    }

    fn drop_declared(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| matches!(one.op, Op::Capability | Op::Extension))?;
        let number = self.instructions[at].word(0);
        self.remove(at).map(|what| format!("{what} ({number})"))
    }

    /// Any capability for one that is declared, or one more.
    fn replace_capability(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| one.op == Op::Capability)?;
        // Those of rspirv, a good part of which have small numbers.
        let drawn = |random: &mut Random| match random.below(3) {
            0 => random.below(72) as u32,
            1 => 4096 + random.below(384) as u32,
            _ => 5008 + random.below(1440) as u32,
        };
        let number =
            (0..1000).map(|_| drawn(random)).find(|&number| spirv::Capability::from_u32(number).is_some())?;
        if random.below(2) == 0 {
            return self.set(at, 0, number);
        }
        let operands = vec![(number, Slot::Enumerant)];
        self.instructions
            .insert(at + 1, Instruction { op: Op::Capability, result_type: None, result: None, operands });
        self.functions += 1;
        Some(format!("capability {number} added"))
    }

    /// An older version of SPIR-V.
    fn older(&mut self, random: &mut Random) -> Option<String> {
        let version = (1 << 16) | (random.below(7) as u32) << 8;
        let old = std::mem::replace(&mut self.header[1], version);
        (old != version).then(|| format!("version {version:#x}"))
    }

    fn is_layout(one: &Instruction) -> bool {
        let place = match one.op {
            Op::Decorate => 1,
            Op::MemberDecorate => 2,
            _ => return false,
        };
        LAYOUT.contains(&one.word(place))
    }

    fn layout_number(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, Self::is_layout)?;
        let place = self.instructions[at].operands.len() - 1;
        let old = self.instructions[at].word(place);
        let word = match random.below(8) {
            0 => old.wrapping_add(4),
            1 => old.wrapping_sub(4),
            2 => old / 2,
            3 => old.wrapping_mul(2),
            4 => 0,
            5 => old.wrapping_add(1),
            6 => old.wrapping_add(8),
            _ => *random.pick(&[1, 2, 4, 6, 8, 12, 16, 20, 32, 64])?,
        };
        self.set(at, place, word)
    }

    fn drop_layout(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, Self::is_layout)?;
        self.remove(at)
    }

    /// `RowMajor` for `ColMajor`, or the other way.
    fn transpose_layout(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| one.op == Op::MemberDecorate && matches!(one.word(2), 4 | 5))?;
        let other = 9 - self.instructions[at].word(2);
        self.set(at, 2, other)
    }

    /// Any number for an enumerant: most are unknown to the validator, some need a capability.
    fn any_enumerant(&mut self, random: &mut Random) -> Option<String> {
        let wanted = |slot: Slot| {
            matches!(slot, Slot::Enumerant | Slot::BuiltIn | Slot::Decoration | Slot::StorageClass)
        };
        let at = self.anywhere(random, |one| one.operands.iter().any(|(_, slot)| wanted(*slot)))?;
        let places = self.instructions[at].places(wanted);
        let operand = *random.pick(&places)?;
        let word = match random.below(3) {
            0 => random.below(64) as u32,
            1 => 4416 + random.below(64) as u32,
            _ => 5248 + random.below(192) as u32,
        };
        self.set(at, operand, word)
    }
}
