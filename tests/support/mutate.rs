//! Mutants of SPIR-V modules: each differs from its module by a change or two that a compiler's
//! author could have made by mistake. A seed makes the same mutant for ever.
//!
//! Most changes keep the grammar and look at types, so that a good part of the mutants is valid:
//! the rest breaks one rule, and rarely a second one.

// With their paths, as another crate names this file by its own.
#[path = "mutate/declarations.rs"]
mod declarations;
#[path = "mutate/instructions.rs"]
mod instructions;
#[path = "mutate/opcodes.rs"]
mod opcodes;
#[path = "mutate/operands.rs"]
mod operands;

use std::collections::HashMap;

use rspirv::binary::{Assemble, Consumer, ParseAction, parse_words};
use rspirv::dr::{self, Operand};
use rspirv::spirv::{self, Op};

use opcodes::name;

/// The generator SplitMix64 (Steele, Lea and Flood, 2014).
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
}
