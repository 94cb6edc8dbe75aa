//! Changes to instructions: added, dropped, moved, of another opcode, types of another shape.

use rspirv::spirv::Op;

use super::opcodes::{computing, decoration, name, same_shape, storage_class, usual};
use super::{Instruction, Original, Random, Slot};

impl Original {
    /// The types that are declared before an instruction.
    pub(super) fn types_before(&self, at: usize) -> Vec<u32> {
        let declarations = self.instructions[..at].iter().filter(|one| name(one.op).starts_with("Type"));
        declarations.filter_map(|one| one.result).collect()
    }

    pub(super) fn type_declaration(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| name(one.op).starts_with("Type") && !one.operands.is_empty())?;
        let one = &self.instructions[at];
        let (op, operand) = (one.op, random.below(one.operands.len()));
        let word = match (op, operand) {
            (Op::TypeInt, 0) => *random.pick(&[8, 16, 32, 64, 64, 16, 4, 128])?,
            (Op::TypeFloat, 0) if random.below(3) == 0 && one.operands.len() == 1 => {
                // An encoding: bfloat16, E4M3, E5M2.
                let (width, encoding) = *random.pick(&[(16, 0), (8, 4214), (8, 4215)])?;
                self.instructions[at].operands = vec![(width, Slot::Literal), (encoding, Slot::Enumerant)];
                return Some(format!("TypeFloat becomes {width} bits of encoding {encoding}"));
            }
            (Op::TypeFloat, 0) => *random.pick(&[16, 32, 64, 8])?,
            (Op::TypeVector | Op::TypeMatrix, 1) => *random.pick(&[1, 2, 3, 4, 5, 8])?,
            (Op::TypeArray, 1) => *random.pick(&self.constants)?,
            (Op::TypeImage, 1..) => random.below(8) as u32,
            (Op::TypePointer, 0) => storage_class(random),
            _ if one.operands[operand].1 == Slot::Id => *random.pick(&self.types_before(at))?,
            _ => random.below(4) as u32,
        };
        self.set(at, operand, word)
    }

    pub(super) fn remove(&mut self, at: usize) -> Option<String> {
        let gone = self.instructions.remove(at);
        if at < self.functions {
            self.functions -= 1;
        }
        Some(format!("{:?} dropped", gone.op))
    }

    pub(super) fn drop_decoration(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| {
            matches!(one.op, Op::Decorate | Op::MemberDecorate | Op::DecorateString | Op::DecorateId)
        })?;
        self.remove(at)
    }

    pub(super) fn drop_in_function(&mut self, random: &mut Random) -> Option<String> {
        // A value that is used would be missed at once.
        let results = random.below(4) == 0;
        let at = self.in_function(random, |one| results || one.result.is_none())?;
        self.remove(at)
    }

    pub(super) fn drop_declaration(&mut self, random: &mut Random) -> Option<String> {
        let wanted =
            [Op::Capability, Op::Extension, Op::ExecutionMode, Op::MemoryModel, Op::TypeForwardPointer];
        let at = self.anywhere(random, |one| wanted.contains(&one.op))?;
        self.remove(at)
    }

    pub(super) fn duplicate(&mut self, random: &mut Random) -> Option<String> {
        let at = match random.below(3) {
            0 => self.anywhere(random, |_| true)?,
            _ => self.in_function(random, |_| true)?,
        };
        let mut copy = self.instructions[at].clone();
        let what = format!("{:?} doubled", copy.op);
        if copy.result.is_some() {
            copy.result = Some(self.fresh());
        }
        self.instructions.insert(at + 1, copy);
        if at < self.functions {
            self.functions += 1;
        }
        Some(what)
    }

    pub(super) fn move_instruction(&mut self, random: &mut Random) -> Option<String> {
        let from = match random.below(4) {
            0 => self.anywhere(random, |_| true)?,
            _ => self.in_function(random, |_| true)?,
        };
        let reach = 1 + random.below(6);
        let last = self.instructions.len() - 1;
        let to = match random.below(2) {
            0 => from.saturating_sub(reach),
            _ => (from + reach).min(last),
        };
        let one = self.instructions.remove(from);
        let what = format!("{:?} moved by {}", one.op, to as i64 - from as i64);
        self.instructions.insert(to, one);
        self.functions = self
            .instructions
            .iter()
            .position(|one| one.op == Op::Function)
            .unwrap_or(self.instructions.len());
        (from != to).then_some(what)
    }

    pub(super) fn opcode(&mut self, random: &mut Random) -> Option<String> {
        let at = self.in_function(random, |one| !same_shape(one.op).is_empty())?;
        let op = usual(random, same_shape(self.instructions[at].op), |op| *op)?;
        let old = std::mem::replace(&mut self.instructions[at].op, op);
        Some(format!("{old:?} becomes {op:?}"))
    }

    pub(super) fn branch(&mut self, random: &mut Random) -> Option<String> {
        let is_label = |all: &Self, word: u32, slot: Slot| slot == Slot::Id && all.labels.contains(&word);
        let at = self.in_function(random, |one| {
            matches!(
                one.op,
                Op::Branch
                    | Op::BranchConditional
                    | Op::Switch
                    | Op::SelectionMerge
                    | Op::LoopMerge
                    | Op::Phi
            )
        })?;
        let one = &self.instructions[at];
        let places: Vec<usize> = (0..one.operands.len())
            .filter(|&place| is_label(self, one.operands[place].0, one.operands[place].1))
            .collect();
        let operand = *random.pick(&places)?;
        let word = *random.pick(&self.labels)?;
        self.set(at, operand, word)
    }

    pub(super) fn phi(&mut self, random: &mut Random) -> Option<String> {
        let at = self.in_function(random, |one| one.op == Op::Phi && one.operands.len() >= 2)?;
        let operands = &mut self.instructions[at].operands;
        let pair = random.below(operands.len() / 2) * 2;
        match random.below(3) {
            0 => {
                operands.drain(pair..pair + 2);
                Some("a pair of a Phi dropped".into())
            }
            1 => {
                let copy = [operands[pair], operands[pair + 1]];
                operands.extend(copy);
                Some("a pair of a Phi doubled".into())
            }
            _ => {
                operands.swap(pair, pair + 1);
                Some("a pair of a Phi turned".into())
            }
        }
    }

    /// An instruction more: one that gives a value, of operands of one type for the most part.
    pub(super) fn insert(&mut self, random: &mut Random) -> Option<String> {
        let before = self.in_function(random, |one| {
            !matches!(one.op, Op::Label | Op::Function | Op::FunctionParameter | Op::Phi | Op::Variable)
        })?;
        // Values that are defined where it will stand: those of its function before it, and of
        // module scope.
        let function =
            (0..before).rev().find(|&at| self.instructions[at].op == Op::Function).unwrap_or(self.functions);
        let defined: Vec<(u32, u32)> = (0..self.functions)
            .chain(function..before)
            .filter_map(|at| Some((self.instructions[at].result?, self.instructions[at].result_type?)))
            .collect();
        let (op, operands) = usual(random, computing(), |(op, _)| *op)?;
        let (_, main) = *random.pick(&defined)?;
        let of_main: Vec<u32> = defined.iter().filter(|(_, ty)| *ty == main).map(|(id, _)| *id).collect();
        let mut ids = Vec::new();
        for _ in 0..operands {
            let id = match random.below(5) {
                0 => random.pick(&defined)?.0,
                _ => *random.pick(&of_main)?,
            };
            ids.push((id, Slot::Id));
        }
        let result_type = match random.below(3) {
            0 => *random.pick(&self.type_ids)?,
            1 => {
                let name = name(op);
                let compares = ["Equal", "Less", "Greater", "Is", "Logical", "Any", "All"];
                let bools: Vec<u32> = self
                    .instructions
                    .iter()
                    .filter(|one| one.op == Op::TypeBool)
                    .filter_map(|one| one.result)
                    .collect();
                match compares.iter().any(|part| name.contains(part)) {
                    true => random.pick(&bools).copied().unwrap_or(main),
                    false => main,
                }
            }
            _ => main,
        };
        let result = self.fresh();
        let one = Instruction { op, result_type: Some(result_type), result: Some(result), operands: ids };
        self.types.insert(result, result_type);
        self.instructions.insert(before, one);
        Some(format!("{op:?} inserted"))
    }

    pub(super) fn decorate(&mut self, random: &mut Random) -> Option<String> {
        let types = self
            .instructions
            .iter()
            .position(|one| name(one.op).starts_with("Type"))
            .unwrap_or(self.functions);
        let target = *random.pick(&self.all_ids)?;
        let number = decoration(random);
        let mut operands = vec![(target, Slot::Id), (number, Slot::Decoration)];
        // Those that take a number.
        if matches!(number, 1 | 6 | 7 | 11 | 29..=31 | 33..=36 | 39 | 40 | 44) {
            operands.push((self.number(0, random), Slot::Literal));
        }
        let one = Instruction { op: Op::Decorate, result_type: None, result: None, operands };
        self.instructions.insert(types, one);
        self.functions += 1;
        Some(format!("decoration {number} for {target}"))
    }

    /// Another width for all values of a type, constants included.
    pub(super) fn retype(&mut self, random: &mut Random) -> Option<String> {
        let at =
            self.anywhere(random, |one| matches!(one.op, Op::TypeInt | Op::TypeFloat) && one.word(0) == 32)?;
        let ty = self.instructions[at].result?;
        let op = self.instructions[at].op;
        let (width, encoding) = match op {
            Op::TypeInt => (*random.pick(&[8, 16, 64])?, None),
            _ => *random.pick(&[(16, None), (64, None), (16, Some(0)), (8, Some(4214)), (8, Some(4215))])?,
        };
        self.instructions[at].operands[0].0 = width;
        self.instructions[at].operands.extend(encoding.map(|number: u32| (number, Slot::Enumerant)));
        for one in &mut self.instructions {
            if matches!(one.op, Op::Constant | Op::SpecConstant) && one.result_type == Some(ty) {
                let word = one.word(0);
                one.operands = match width {
                    64 if op == Op::TypeFloat => {
                        let bits = f64::from(f32::from_bits(word)).to_bits();
                        vec![(bits as u32, Slot::Literal), ((bits >> 32) as u32, Slot::Rest)]
                    }
                    64 => vec![(word, Slot::Literal), (0, Slot::Rest)],
                    16 if op == Op::TypeFloat => vec![(word >> 16, Slot::Literal)],
                    8 if op == Op::TypeFloat => vec![(word >> 24, Slot::Literal)],
                    // Not negative, so that no sign has to fill the word.
                    _ => vec![(word & ((1 << (width - 1)) - 1), Slot::Literal)],
                };
            }
        }
        Some(format!("{op:?} of 32 bits gets {width} and {encoding:?}"))
    }

    pub(super) fn version(&mut self, random: &mut Random) -> Option<String> {
        let version = (1 << 16) | (random.below(8) as u32) << 8;
        let old = std::mem::replace(&mut self.header[1], version);
        (old != version).then(|| format!("version {version:#x}"))
    }
}
