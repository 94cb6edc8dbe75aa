//! Mutants of SPIR-V modules: each differs from its module by a change or two that a compiler's author could have
//! made by mistake. A seed makes the same mutant for ever.
//!
//! Most changes keep the grammar and look at types, so that a good part of the mutants is valid: the
//! rest breaks one rule, and rarely a second one.

use std::collections::HashMap;
use std::sync::LazyLock;

use rspirv::binary::{Assemble, Consumer, ParseAction, parse_words};
use rspirv::dr::{self, Operand};
use rspirv::grammar::{INSTRUCTION_TABLE, LogicalOperand, OperandKind, OperandQuantifier};
use rspirv::spirv::{self, Op};

/// SplitMix64.
pub struct Random(pub u64);

impl Random {
    /// For a name and a number: other modules and other numbers change nothing.
    pub fn of(name: &str, number: u64) -> Self {
        // FNV-1a.
        let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3);
        let mut random = Self(name.bytes().fold(0xCBF2_9CE4_8422_2325, hash) ^ number.rotate_left(32));
        random.next();
        random
    }

    /// 64 random bits.
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number below a limit, which is not 0.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }

    /// One of several; `None` of none.
    pub fn pick<'a, T>(&mut self, all: &'a [T]) -> Option<&'a T> {
        if all.is_empty() { None } else { Some(&all[self.below(all.len())]) }
    }
}

/// What an operand word is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Slot {
    Id,
    Literal,
    /// Words of strings and the high words of numbers.
    Rest,
    /// The number of an extended instruction.
    Extended,
    StorageClass,
    BuiltIn,
    Decoration,
    Enumerant,
}

#[derive(Clone, Debug)]
struct Instruction {
    op: Op,
    result_type: Option<u32>,
    result: Option<u32>,
    operands: Vec<(u32, Slot)>,
}

impl Instruction {
    fn of(parsed: &dr::Instruction) -> Self {
        let mut operands = Vec::new();
        for operand in &parsed.operands {
            let slot = match operand {
                Operand::IdRef(_) | Operand::IdScope(_) | Operand::IdMemorySemantics(_) => Slot::Id,
                Operand::LiteralBit32(_) | Operand::LiteralBit64(_) => Slot::Literal,
                Operand::LiteralString(_) => Slot::Rest,
                Operand::LiteralExtInstInteger(_) => Slot::Extended,
                Operand::StorageClass(_) => Slot::StorageClass,
                Operand::BuiltIn(_) => Slot::BuiltIn,
                Operand::Decoration(_) => Slot::Decoration,
                _ => Slot::Enumerant,
            };
            let words = operand.assemble();
            operands.extend(words.into_iter().enumerate().map(|(at, word)| {
                let slot = if at == 0 { slot } else { Slot::Rest };
                (word, slot)
            }));
        }
        Self { op: parsed.class.opcode, result_type: parsed.result_type, result: parsed.result_id, operands }
    }

    fn words(&self, all: &mut Vec<u32>) {
        let start = all.len();
        all.push(self.op as u32);
        all.extend(self.result_type);
        all.extend(self.result);
        all.extend(self.operands.iter().map(|(word, _)| word));
        all[start] |= ((all.len() - start) as u32) << 16;
    }

    fn word(&self, at: usize) -> u32 {
        self.operands.get(at).map_or(0, |(word, _)| *word)
    }

    /// The places of its operands of some kind.
    fn places(&self, wanted: impl Fn(Slot) -> bool) -> Vec<usize> {
        (0..self.operands.len()).filter(|&at| wanted(self.operands[at].1)).collect()
    }
}

/// A module that mutants are made of.
#[derive(Clone)]
pub struct Original {
    header: [u32; 5],
    instructions: Vec<Instruction>,
    /// By id: its type.
    types: HashMap<u32, u32>,
    /// By type: the ids that have it.
    values: HashMap<u32, Vec<u32>>,
    /// Ids in the order of their definitions, by kind.
    type_ids: Vec<u32>,
    value_ids: Vec<u32>,
    labels: Vec<u32>,
    constants: Vec<u32>,
    all_ids: Vec<u32>,
    /// Literals that the module holds.
    literals: Vec<u32>,
    /// The first instruction of the functions.
    functions: usize,
}

struct Collector(Vec<Instruction>);

impl Consumer for Collector {
    fn initialize(&mut self) -> ParseAction {
        ParseAction::Continue
    }

    fn finalize(&mut self) -> ParseAction {
        ParseAction::Continue
    }

    fn consume_header(&mut self, _: dr::ModuleHeader) -> ParseAction {
        ParseAction::Continue
    }

    fn consume_instruction(&mut self, instruction: dr::Instruction) -> ParseAction {
        self.0.push(Instruction::of(&instruction));
        ParseAction::Continue
    }
}

impl Original {
    /// `None` where rspirv does not know an instruction.
    pub fn new(words: &[u32]) -> Option<Self> {
        let mut collector = Collector(Vec::new());
        parse_words(words, &mut collector).ok()?;
        let instructions = collector.0;
        let mut all = Self {
            header: words[..5].try_into().ok()?,
            types: HashMap::new(),
            values: HashMap::new(),
            type_ids: Vec::new(),
            value_ids: Vec::new(),
            labels: Vec::new(),
            constants: Vec::new(),
            all_ids: Vec::new(),
            literals: Vec::new(),
            functions: instructions
                .iter()
                .position(|one| one.op == Op::Function)
                .unwrap_or(instructions.len()),
            instructions,
        };
        for one in &all.instructions {
            all.literals
                .extend(one.operands.iter().filter(|(_, slot)| *slot == Slot::Literal).map(|(w, _)| *w));
            let Some(id) = one.result else { continue };
            all.all_ids.push(id);
            let name = name(one.op);
            if let Some(ty) = one.result_type {
                all.types.insert(id, ty);
                all.values.entry(ty).or_default().push(id);
                all.value_ids.push(id);
                if name.contains("Constant") {
                    all.constants.push(id);
                }
            } else if name.starts_with("Type") {
                all.type_ids.push(id);
            } else if one.op == Op::Label {
                all.labels.push(id);
            }
        }
        // What is assembled again is what was there, or the reader has lost something.
        (all.words() == words).then_some(all)
    }

    fn words(&self) -> Vec<u32> {
        let mut words = self.header.to_vec();
        for one in &self.instructions {
            one.words(&mut words);
        }
        words
    }

    /// A mutant with what was done to it.
    pub fn mutant(&self, random: &mut Random) -> (Vec<u32>, String) {
        let mut copy = self.clone();
        let mut story = Vec::new();
        // Types of other widths are of no use without their capabilities.
        if random.below(3) == 0 {
            copy.enable();
            story.push("capabilities added".to_owned());
        }
        let changes = [1, 1, 1, 1, 1, 1, 1, 2, 2, 3][random.below(10)];
        let mut done = 0;
        for _ in 0..40 {
            if let Some(what) = copy.change(random) {
                story.push(what);
                done += 1;
            }
            if done == changes {
                break;
            }
        }
        (copy.words(), story.join(", "))
    }

    fn fresh(&mut self) -> u32 {
        self.header[3] += 1;
        self.header[3] - 1
    }

    /// Adds the capabilities that Vulkan devices offer for arithmetic, with their extensions.
    fn enable(&mut self) {
        use spirv::Capability as C;
        const CORE: &[C] = &[
            C::Int8,
            C::Int16,
            C::Int64,
            C::Float16,
            C::Float64,
            C::Int64Atomics,
            C::ImageQuery,
            C::StorageImageReadWithoutFormat,
            C::StorageImageWriteWithoutFormat,
            C::StorageImageExtendedFormats,
            C::GroupNonUniform,
            C::GroupNonUniformVote,
            C::GroupNonUniformArithmetic,
            C::GroupNonUniformBallot,
            C::GroupNonUniformShuffle,
            C::GroupNonUniformShuffleRelative,
            C::GroupNonUniformClustered,
            C::GroupNonUniformQuad,
            C::VariablePointersStorageBuffer,
            C::VariablePointers,
            C::StorageBuffer16BitAccess,
            C::StorageBuffer8BitAccess,
            C::Sampled1D,
            C::Image1D,
            C::SampledBuffer,
            C::ImageBuffer,
            C::MinLod,
        ];
        const EXTENDED: &[(C, &str)] = &[
            (C::BFloat16TypeKHR, "SPV_KHR_bfloat16"),
            (C::Float8EXT, "SPV_EXT_float8"),
            (C::AtomicFloat32AddEXT, "SPV_EXT_shader_atomic_float_add"),
            (C::AtomicFloat32MinMaxEXT, "SPV_EXT_shader_atomic_float_min_max"),
            (C::AtomicFloat16VectorNV, "SPV_NV_shader_atomic_fp16_vector"),
            (C::RayQueryKHR, "SPV_KHR_ray_query"),
            (C::ShaderClockKHR, "SPV_KHR_shader_clock"),
        ];
        let has = |all: &Self, wanted: C| {
            all.instructions.iter().any(|one| one.op == Op::Capability && one.word(0) == wanted as u32)
        };
        let mut first = Vec::new();
        for &capability in CORE.iter().chain(EXTENDED.iter().map(|(capability, _)| capability)) {
            if !has(self, capability) {
                first.push(Instruction {
                    op: Op::Capability,
                    result_type: None,
                    result: None,
                    operands: vec![(capability as u32, Slot::Enumerant)],
                });
            }
        }
        self.functions += first.len();
        self.instructions.splice(0..0, first);
        let behind = self.instructions.iter().take_while(|one| one.op == Op::Capability).count();
        let extensions: Vec<Instruction> = EXTENDED
            .iter()
            .map(|(_, name)| Instruction {
                op: Op::Extension,
                result_type: None,
                result: None,
                operands: Operand::LiteralString((*name).into())
                    .assemble()
                    .into_iter()
                    .map(|word| (word, Slot::Rest))
                    .collect(),
            })
            .filter(|one| {
                !self.instructions.iter().any(|old| old.op == Op::Extension && old.operands == one.operands)
            })
            .collect();
        self.functions += extensions.len();
        self.instructions.splice(behind..behind, extensions);
    }

    /// One change; `None` where the module offers no place for the kind of change that was drawn.
    fn change(&mut self, random: &mut Random) -> Option<String> {
        type Change = fn(&mut Original, &mut Random) -> Option<String>;
        const CHANGES: &[(usize, Change)] = &[
            (12, Original::operand_of_its_type),
            (8, Original::operand_of_another_type),
            (3, Original::operand_of_any_kind),
            (6, Original::result_type),
            (10, Original::type_declaration),
            (8, Original::literal),
            (6, Original::enumerant),
            (5, Original::drop_decoration),
            (5, Original::drop_in_function),
            (2, Original::drop_declaration),
            (3, Original::duplicate),
            (4, Original::move_instruction),
            (10, Original::opcode),
            (4, Original::constant),
            (5, Original::branch),
            (4, Original::phi),
            (5, Original::storage_class),
            (4, Original::operand_count),
            (4, Original::extended),
            (14, Original::insert),
            (4, Original::swap_operands),
            (4, Original::decorate),
            (5, Original::retype),
            (1, Original::version),
        ];
        let mut draw = random.below(CHANGES.iter().map(|(weight, _)| weight).sum());
        for (weight, change) in CHANGES {
            if draw < *weight {
                return change(self, random);
            }
            draw -= weight;
        }
        None
    }

    /// An instruction in a function that a test holds for.
    fn in_function(&self, random: &mut Random, test: impl Fn(&Instruction) -> bool) -> Option<usize> {
        let all: Vec<usize> =
            (self.functions..self.instructions.len()).filter(|&at| test(&self.instructions[at])).collect();
        random.pick(&all).copied()
    }

    fn anywhere(&self, random: &mut Random, test: impl Fn(&Instruction) -> bool) -> Option<usize> {
        let all: Vec<usize> =
            (0..self.instructions.len()).filter(|&at| test(&self.instructions[at])).collect();
        random.pick(&all).copied()
    }

    /// An operand that is a value, as (instruction, operand).
    fn value_operand(&self, random: &mut Random) -> Option<(usize, usize)> {
        let is_value = |word: u32, slot: Slot| slot == Slot::Id && self.types.contains_key(&word);
        let at =
            self.in_function(random, |one| one.operands.iter().any(|&(word, slot)| is_value(word, slot)))?;
        let one = &self.instructions[at];
        let places: Vec<usize> =
            (0..one.operands.len()).filter(|&at| is_value(one.operands[at].0, one.operands[at].1)).collect();
        Some((at, *random.pick(&places)?))
    }

    fn set(&mut self, at: usize, operand: usize, word: u32) -> Option<String> {
        let one = &mut self.instructions[at];
        // An earlier change may have taken it away.
        let old = std::mem::replace(&mut one.operands.get_mut(operand)?.0, word);
        (old != word).then(|| format!("operand {operand} of {:?}: {old} becomes {word}", one.op))
    }

    fn operand_of_its_type(&mut self, random: &mut Random) -> Option<String> {
        let (at, operand) = self.value_operand(random)?;
        let ty = self.types[&self.instructions[at].word(operand)];
        let word = *random.pick(self.values.get(&ty)?)?;
        self.set(at, operand, word)
    }

    fn operand_of_another_type(&mut self, random: &mut Random) -> Option<String> {
        let (at, operand) = self.value_operand(random)?;
        // Constants are defined everywhere.
        let from = if random.below(2) == 0 { &self.constants } else { &self.value_ids };
        let word = *random.pick(from)?;
        self.set(at, operand, word)
    }

    fn operand_of_any_kind(&mut self, random: &mut Random) -> Option<String> {
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

    /// The types that are declared before an instruction.
    fn types_before(&self, at: usize) -> Vec<u32> {
        let declarations = self.instructions[..at].iter().filter(|one| name(one.op).starts_with("Type"));
        declarations.filter_map(|one| one.result).collect()
    }

    fn result_type(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| one.result_type.is_some())?;
        let ty = *random.pick(&self.types_before(at))?;
        let one = &mut self.instructions[at];
        let old = one.result_type.replace(ty);
        (old != Some(ty)).then(|| format!("result type of {:?} becomes {ty}", one.op))
    }

    fn type_declaration(&mut self, random: &mut Random) -> Option<String> {
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

    fn number(&self, old: u32, random: &mut Random) -> u32 {
        match random.below(6) {
            0 => old.wrapping_add(1),
            1 => old.wrapping_sub(1),
            2 => random.below(9) as u32,
            3 => 1 << random.below(32),
            4 => [u32::MAX, 0x3f80_0000, 0x7fc0_0000, 255, 256, 65536][random.below(6)],
            _ => random.pick(&self.literals).copied().unwrap_or(0),
        }
    }

    fn literal(&mut self, random: &mut Random) -> Option<String> {
        let is_literal = |slot: Slot| slot == Slot::Literal;
        let at = self.anywhere(random, |one| one.operands.iter().any(|(_, slot)| is_literal(*slot)))?;
        let places = self.instructions[at].places(is_literal);
        let operand = *random.pick(&places)?;
        let word = self.number(self.instructions[at].word(operand), random);
        self.set(at, operand, word)
    }

    fn enumerant(&mut self, random: &mut Random) -> Option<String> {
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

    fn remove(&mut self, at: usize) -> Option<String> {
        let gone = self.instructions.remove(at);
        if at < self.functions {
            self.functions -= 1;
        }
        Some(format!("{:?} dropped", gone.op))
    }

    fn drop_decoration(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| {
            matches!(one.op, Op::Decorate | Op::MemberDecorate | Op::DecorateString | Op::DecorateId)
        })?;
        self.remove(at)
    }

    fn drop_in_function(&mut self, random: &mut Random) -> Option<String> {
        // A value that is used would be missed at once.
        let results = random.below(4) == 0;
        let at = self.in_function(random, |one| results || one.result.is_none())?;
        self.remove(at)
    }

    fn drop_declaration(&mut self, random: &mut Random) -> Option<String> {
        let wanted =
            [Op::Capability, Op::Extension, Op::ExecutionMode, Op::MemoryModel, Op::TypeForwardPointer];
        let at = self.anywhere(random, |one| wanted.contains(&one.op))?;
        self.remove(at)
    }

    fn duplicate(&mut self, random: &mut Random) -> Option<String> {
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

    fn move_instruction(&mut self, random: &mut Random) -> Option<String> {
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

    fn opcode(&mut self, random: &mut Random) -> Option<String> {
        let at = self.in_function(random, |one| !same_shape(one.op).is_empty())?;
        let op = usual(random, same_shape(self.instructions[at].op), |op| *op)?;
        let old = std::mem::replace(&mut self.instructions[at].op, op);
        Some(format!("{old:?} becomes {op:?}"))
    }

    fn constant(&mut self, random: &mut Random) -> Option<String> {
        let at = self.anywhere(random, |one| matches!(one.op, Op::Constant | Op::SpecConstant))?;
        let word = self.number(self.instructions[at].word(0), random);
        self.set(at, 0, word)
    }

    fn branch(&mut self, random: &mut Random) -> Option<String> {
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

    fn phi(&mut self, random: &mut Random) -> Option<String> {
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

    /// The class of a pointer type and of all variables that have it.
    fn storage_class(&mut self, random: &mut Random) -> Option<String> {
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

    fn operand_count(&mut self, random: &mut Random) -> Option<String> {
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

    fn extended(&mut self, random: &mut Random) -> Option<String> {
        let at = self.in_function(random, |one| one.op == Op::ExtInst)?;
        let operand = *self.instructions[at].places(|slot| slot == Slot::Extended).first()?;
        let word = match random.below(3) {
            0 => random.below(82) as u32,
            1 => self.instructions[at].word(operand).wrapping_add(1),
            _ => self.instructions[at].word(operand).wrapping_sub(1),
        };
        self.set(at, operand, word)
    }

    /// An instruction more: one that gives a value, of operands of one type for the most part.
    fn insert(&mut self, random: &mut Random) -> Option<String> {
        let before = self.in_function(random, |one| {
            !matches!(one.op, Op::Label | Op::Function | Op::FunctionParameter | Op::Phi | Op::Variable)
        })?;
        // Values that are defined where it will stand: those of its function before it, and of module scope.
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

    fn swap_operands(&mut self, random: &mut Random) -> Option<String> {
        let at = self.in_function(random, |one| one.operands.len() >= 2)?;
        let one = &mut self.instructions[at];
        let (left, right) = (random.below(one.operands.len()), random.below(one.operands.len()));
        let differ = one.operands[left] != one.operands[right];
        one.operands.swap(left, right);
        differ.then(|| format!("operands {left} and {right} of {:?} change places", one.op))
    }

    fn decorate(&mut self, random: &mut Random) -> Option<String> {
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
    fn retype(&mut self, random: &mut Random) -> Option<String> {
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

    fn version(&mut self, random: &mut Random) -> Option<String> {
        let version = (1 << 16) | (random.below(8) as u32) << 8;
        let old = std::mem::replace(&mut self.header[1], version);
        (old != version).then(|| format!("version {version:#x}"))
    }
}

fn storage_class(random: &mut Random) -> u32 {
    const ALL: &[u32] = &[0, 1, 2, 3, 4, 6, 7, 9, 11, 12, 5328, 5329, 5338, 5339, 5342, 5343, 5349, 5385];
    ALL[random.below(ALL.len())]
}

fn decoration(random: &mut Random) -> u32 {
    const ALL: &[u32] = &[
        0, 1, 2, 3, 4, 5, 6, 7, 11, 13, 14, 18, 19, 20, 21, 23, 24, 25, 26, 29, 30, 31, 33, 34, 35, 36, 39,
        40, 42, 44, 5300, 5355, 5356, 5386,
    ];
    ALL[random.below(ALL.len())]
}

/// One of several, seldom with an opcode that no Vulkan device offers.
fn usual<T: Copy>(random: &mut Random, all: &[T], op: impl Fn(&T) -> Op) -> Option<T> {
    const RARE: &[&str] =
        &["Tensor", "Cooperative", "Graph", "Pipe", "Enqueue", "SubgroupAvc", "Kernel", "Event", "Untyped"];
    let rare = |one: &T| {
        let name = name(op(one));
        ["INTEL", "ARM", "ALTERA"].iter().any(|end| name.ends_with(end))
            || RARE.iter().any(|part| name.contains(part))
    };
    for _ in 0..20 {
        let one = random.pick(all)?;
        if !rare(one) || random.below(20) == 0 {
            return Some(*one);
        }
    }
    None
}

/// An opcode's name without its `Op`.
fn name(op: Op) -> &'static str {
    static NAMES: LazyLock<HashMap<u32, &'static str>> =
        LazyLock::new(|| INSTRUCTION_TABLE.iter().map(|one| (one.opcode as u32, one.opname)).collect());
    NAMES.get(&(op as u32)).copied().unwrap_or("")
}

/// The opcodes with a result type whose operands are so many ids and nothing else.
fn computing() -> &'static [(Op, usize)] {
    static ALL: LazyLock<Vec<(Op, usize)>> = LazyLock::new(|| {
        let plain = |operand: &LogicalOperand| {
            matches!(operand.kind, OperandKind::IdRef | OperandKind::IdScope | OperandKind::IdMemorySemantics)
                && operand.quantifier == OperandQuantifier::One
        };
        let computes = |operands: &[LogicalOperand]| {
            operands.len() > 2
                && operands[0].kind == OperandKind::IdResultType
                && operands[1].kind == OperandKind::IdResult
                && operands[2..].iter().all(plain)
        };
        let all = INSTRUCTION_TABLE.iter().filter(|one| computes(one.operands));
        all.map(|one| (one.opcode, one.operands.len() - 2)).collect()
    });
    &ALL
}

/// The other opcodes whose operands are of the same kinds.
fn same_shape(op: Op) -> &'static [Op] {
    static ALL: LazyLock<HashMap<u32, Vec<Op>>> = LazyLock::new(|| {
        let mut by_shape: HashMap<String, Vec<Op>> = HashMap::new();
        let exits = [
            Op::Return,
            Op::Unreachable,
            Op::Kill,
            Op::IgnoreIntersectionKHR,
            Op::TerminateRayKHR,
            Op::TerminateInvocation,
        ];
        for one in INSTRUCTION_TABLE.iter() {
            let shape = match one.operands.first() {
                Some(first) if first.kind == OperandKind::IdResultType => format!("{:?}", one.operands),
                _ if exits.contains(&one.opcode) => "exit".to_owned(),
                _ => continue,
            };
            by_shape.entry(shape).or_default().push(one.opcode);
        }
        let mut all = HashMap::new();
        for alike in by_shape.values() {
            for op in alike {
                all.insert(*op as u32, alike.iter().copied().filter(|other| other != op).collect());
            }
        }
        all
    });
    ALL.get(&(op as u32)).map_or(&[], Vec::as_slice)
}
