//! Composite instructions (SPIR-V 3.3.12), `OpSelect`, copies and undefined values: lists of
//! registers rearranged; only an index that is computed needs an operation.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::math::array;
use crate::module::ty::{Type, TypeId};
use crate::module::{Instruction, Opcode};
use crate::ops::integer_operand::ReadAs;
use crate::ops::linear_algebra::{columns, scalar_width_of_matrix};
use crate::ops::memory::{self, Length, MemoryOp};
use crate::ops::op::Op;
use crate::ops::relational_logical::select::SelectWord;
use crate::ops::translate::budget::WORDS_OF_A_STEP;
use crate::ops::translate::{IdValue, Translator};
use crate::ops::value_registers::{Words, registers_from};
use crate::ops::{address, linear_algebra};
use anyhit_base::error::Result;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::CompositeConstruct,
    Opcode::CompositeConstructReplicateEXT,
    Opcode::CompositeExtract,
    Opcode::CompositeInsert,
    Opcode::VectorShuffle,
    Opcode::VectorExtractDynamic,
    Opcode::VectorInsertDynamic,
    Opcode::Transpose,
    Opcode::CopyObject,
    Opcode::FreezeKHR,
    Opcode::CopyLogical,
    Opcode::Undef,
    Opcode::PoisonKHR,
    Opcode::Select,
    Opcode::Bitcast,
];

/// Translates composite instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    match opcode {
        Opcode::CompositeConstruct => {
            let ty = translator.result_type(instruction)?;
            // Before its words are listed: a few operands may make more than there can be.
            translator.word_count(ty)?;
            let constituents = translator.operands(instruction);
            check_constituents(translator, ty, constituents, true)?;
            if let (Some(_), &[part]) = (translator.module.cooperative_matrix(ty), constituents) {
                let words = replicate(translator, ty, crate::module::Id(part))?;
                translator.define_result(instruction, words);
                return Ok(true);
            }
            let mut words = Words::new();
            for &id in translator.operands(instruction) {
                words.extend(translator.words(crate::module::Id(id))?);
            }
            check_count(translator, instruction, &words)?;
            translator.define_result(instruction, words);
        }
        Opcode::CompositeConstructReplicateEXT => {
            let part = translator.id(instruction, 0)?;
            let ty = translator.result_type(instruction)?;
            let words = replicate(translator, ty, part)?;
            translator.define_result(instruction, words);
        }
        Opcode::CompositeExtract => {
            let composite = translator.id(instruction, 0)?;
            let ty = translator.type_of(composite)?;
            let words = translator.words(composite)?;
            let indices = &translator.operands(instruction)[1..];
            let (first, count) = part_words(translator, ty, indices)?;
            translator.define_result(instruction, words[first..first + count].into());
        }
        Opcode::CompositeInsert => {
            let object = translator.operand(instruction, 0)?;
            let composite = translator.id(instruction, 1)?;
            let ty = translator.type_of(composite)?;
            let mut words = translator.words(composite)?;
            let indices = &translator.operands(instruction)[2..];
            let (first, count) = part_words(translator, ty, indices)?;
            if object.len() != count {
                return Err(
                    translator.invalid("the inserted object differs in type from the part that it replaces")
                );
            }
            words[first..first + count].copy_from_slice(&object);
            translator.define_result(instruction, words);
        }
        Opcode::VectorShuffle => {
            let (a, b) = (translator.id(instruction, 0)?, translator.id(instruction, 1)?);
            let width = translator.type_of(a).and_then(|ty| translator.scalar_width(ty))?;
            let ty = translator.result_type(instruction)?;
            let component = |ty: TypeId| match *translator.module.ty(ty) {
                Type::Vector { component, .. } => Some(component),
                _ => None,
            };
            let types = [translator.type_of(a)?, translator.type_of(b)?, ty];
            let module = translator.module;
            let is_cooperative =
                |ty: &TypeId| module.is_cooperative_vector(*ty) || module.cooperative_matrix(*ty).is_some();
            if types.iter().any(is_cooperative) {
                let message = "OpVectorShuffle is not defined for cooperative vectors and matrices";
                return Err(translator.invalid(message).note("SPV_NV_cooperative_vector, 2.2.2"));
            }
            let parts = array::map(types, component);
            if parts[0].is_none() || parts.iter().any(|&part| part != parts[0]) {
                return Err(translator.invalid(
                    "the operands and the result of a shuffle must be vectors of one component type",
                ));
            }
            let mut components = translator.components(a)?;
            components.extend(translator.components(b)?);
            let mut chosen = Words::new();
            for &literal in &translator.operands(instruction)[2..] {
                let component = match literal {
                    u32::MAX => translator.undefined_component()?,
                    _ => *components.get(literal as usize).ok_or_else(|| {
                        translator.invalid(format!("component {literal} of a shuffle does not exist"))
                    })?,
                };
                chosen.push(component);
            }
            let words = translator.expand_components(&chosen, width);
            translator.define_result(instruction, words);
        }
        Opcode::VectorExtractDynamic => {
            let vector = translator.id(instruction, 0)?;
            let index = translator.id(instruction, 1)?;
            let words = translator.words(vector)?;
            let count = translator.component_count(translator.type_of(vector)?);
            let each = words.len() as u32 / count.max(1);
            let first = translator.consecutive(&words)?;
            translator.addressed.push((first, words.len() as u32));
            let index = component_offset(translator, index, each, count)?;
            let to = translator.fresh(each)?;
            translator.emit(Op::Memory(memory::MemoryOp::Gather { to, count: each, first, index }));
            translator.define_result(instruction, registers_from(to, each));
        }
        Opcode::VectorInsertDynamic => {
            let vector = translator.id(instruction, 0)?;
            let component = translator.operand(instruction, 1)?;
            let index = translator.id(instruction, 2)?;
            let words = translator.words(vector)?;
            let count = translator.component_count(translator.type_of(vector)?);
            let each = component.len() as u32;
            let to = translator.fresh(words.len() as u32)?;
            for (at, &from) in words.iter().enumerate() {
                translator.emit(Op::Memory(memory::MemoryOp::Move { to: to.plus(at as u32), from }));
            }
            translator.addressed.push((to, words.len() as u32));
            let index = component_offset(translator, index, each, count)?;
            let from = translator.consecutive(&component)?;
            translator.emit(Op::Memory(memory::MemoryOp::Scatter { from, count: each, first: to, index }));
            translator.define_result(instruction, registers_from(to, words.len() as u32));
        }
        Opcode::Transpose => {
            let matrix = translator.id(instruction, 0)?;
            let columns = columns(translator, matrix)?;
            let width = scalar_width_of_matrix(translator, matrix)?;
            let rows = columns.first().map_or(0, SmallVec::len);
            linear_algebra::check_shape(translator, instruction, rows, columns.len())?;
            if !linear_algebra::have_one_scalar_type(translator, instruction)? {
                return Err(
                    translator.invalid("a transposed matrix must have the component type of the matrix")
                );
            }
            let transposed: Words =
                (0..rows).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
            let words = translator.expand_components(&transposed, width);
            translator.define_result(instruction, words);
        }
        Opcode::CopyObject => {
            let id = translator.id(instruction, 0)?;
            let value = translator.value(id)?;
            if let Some(result) = instruction.result {
                translator.define(result, value);
            }
        }
        Opcode::FreezeKHR => freeze(translator, instruction)?,
        Opcode::CopyLogical => {
            let (from, to) = (translator.id(instruction, 0)?, translator.result_type(instruction)?);
            let from = translator.type_of(from)?;
            if translator.scalar_fingerprint(from)? != translator.scalar_fingerprint(to)? {
                let [from, to] = [from, to].map(|ty| translator.module.describe_type(ty));
                return Err(
                    translator.invalid(format!("OpCopyLogical from {from} to {to}, which do not match"))
                );
            }
            let words = translator.operand(instruction, 0)?;
            check_count(translator, instruction, &words)?;
            translator.define_result(instruction, words);
        }
        Opcode::Undef | Opcode::PoisonKHR => {
            let ty = translator.result_type(instruction)?;
            let words = translator.undefined(ty)?;
            translator.define_result(instruction, words);
        }
        Opcode::Select => {
            let condition = translator.components_of_bool(instruction, 0)?;
            let objects = [translator.id(instruction, 1)?, translator.id(instruction, 2)?];
            let (a, b) = (translator.words_unchecked(objects[0])?, translator.words_unchecked(objects[1])?);
            if a.len() != b.len() || a.is_empty() {
                return Err(translator.invalid("the objects of a select differ in type"));
            }
            // A vector of conditions chooses component by component, a scalar the whole object.
            let each = a.len() / condition.len().max(1);
            let mut words = Words::new();
            let first = translator.fresh(a.len() as u32)?;
            let mut folded = true;
            for at in 0..a.len() {
                let from = [condition[(at / each.max(1)).min(condition.len() - 1)], a[at], b[at]];
                if let Some(word) = translator.constant_word(from[0]) {
                    words.push(if word != 0 { from[1] } else { from[2] });
                    continue;
                }
                folded = false;
                let to = first.plus(at as u32);
                translator.emit(Op::LaneKernel { kernel: &SelectWord.kernels[0], to, from });
                words.push(to);
            }
            if !folded && condition.len() > 1 {
                // Known and computed conditions may be mixed: keep the words of a pair together.
                let start = translator.consecutive(&words)?;
                words = registers_from(start, words.len() as u32);
            }
            translator.define_result(instruction, words);
        }
        Opcode::Bitcast => {
            let words = bitcast(translator, instruction)?;
            translator.define_result(instruction, words);
        }
        _ => return Ok(false),
    }
    Ok(true)
}

impl Translator<'_> {
    /// The registers of an operand that is a bool or a vector of bools.
    fn components_of_bool(&mut self, instruction: &Instruction, at: usize) -> Result<Words> {
        let id = self.id(instruction, at)?;
        let words = self.words(id)?;
        if words.is_empty() { Err(self.invalid("the condition has no value")) } else { Ok(words) }
    }
}

/// `OpFreezeKHR` (`SPV_KHR_poison_freeze`): the value of its operand, which is defined from here
/// on. Undefined values hold bits that do not change, so only programs that are not optimised have
/// operations for it.
fn freeze(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let id = translator.id(instruction, 0)?;
    let value = match translator.value(id)? {
        IdValue::Words(words) if !translator.optimizes && !translator.in_constant => {
            let count = words.len() as u32;
            let first = translator.fresh(count)?;
            for (at, &from) in words.iter().enumerate() {
                translator.emit(Op::Memory(MemoryOp::Move { to: first.plus(at as u32), from }));
            }
            translator.emit(Op::Memory(MemoryOp::Freeze { first, count }));
            IdValue::Words(registers_from(first, count))
        }
        value => value,
    };
    if let Some(result) = instruction.result {
        translator.define(result, value);
    }
    Ok(())
}

/// A composite all of whose constituents are one value.
pub fn replicate(translator: &mut Translator<'_>, ty: TypeId, part: crate::module::Id) -> Result<Words> {
    let element = match *translator.module.ty(ty) {
        Type::Vector { component: element, .. }
        | Type::Matrix { column: element, .. }
        | Type::Array { element, .. } => Some(element),
        _ => None,
    };
    if let (Some(element), Some(found)) = (element, translator.module.type_of(part))
        && element != found
    {
        let [name, found] = [ty, found].map(|ty| translator.module.describe_type(ty));
        return Err(translator.invalid(format!("a {name} cannot consist of copies of a {found}")));
    }
    let words = translator.words(part)?;
    let count = translator.word_count(ty)? as usize;
    if words.is_empty() || !count.is_multiple_of(words.len()) {
        let name = translator.module.describe_type(ty);
        return Err(translator.invalid(format!("copies of the constituent do not form a {name}")));
    }
    Ok(words.iter().copied().cycle().take(count).collect())
}

/// The first word, among those of a composite, of the part that literal indices name, and its
/// words.
fn part_words(translator: &mut Translator<'_>, mut ty: TypeId, indices: &[u32]) -> Result<(usize, usize)> {
    let mut first = 0;
    for &index in indices {
        let outside = |translator: &Translator<'_>| {
            translator.invalid(format!("index {index} of a composite is out of range"))
        };
        ty = match *translator.module.ty(ty) {
            Type::Struct { ref members, .. } => {
                let member = members.get(index as usize).ok_or_else(|| outside(translator))?;
                translator.charge(index as usize / WORDS_OF_A_STEP);
                for member in &members[..index as usize] {
                    first += translator.word_count(member.ty)?;
                }
                member.ty
            }
            Type::Vector { component: element, count } | Type::Matrix { column: element, count } => {
                if index >= count {
                    return Err(outside(translator));
                }
                first += index * translator.word_count(element)?;
                element
            }
            Type::Array { element, length, .. } => {
                if index >= translator.array_length(length)? {
                    return Err(outside(translator));
                }
                first += index * translator.word_count(element)?;
                element
            }
            _ => return Err(translator.invalid("an index applies to a type that is not a composite")),
        };
    }
    Ok((first as usize, translator.word_count(ty)? as usize))
}

/// Checks the constituents of a composite against its type. If `flattens_vectors`, those of a
/// vector may be vectors (`OpCompositeConstruct`).
///
/// # Errors
/// `InvalidModule`
pub fn check_constituents(
    translator: &Translator<'_>,
    ty: TypeId,
    ids: &[u32],
    flattens_vectors: bool,
) -> Result<()> {
    let types = ids.iter().map(|&id| translator.module.type_of(crate::module::Id(id)));
    let is = |found: Option<TypeId>, part: TypeId| found.is_none_or(|found| found == part);
    let fits = match *translator.module.ty(ty) {
        // Its one constituent is the value of all components.
        Type::Vector { component, .. } if translator.module.cooperative_matrix(ty).is_some() => {
            ids.len() == 1 && types.into_iter().all(|found| is(found, component))
        }
        Type::Vector { component, count } => {
            let parts: Vec<Option<TypeId>> = types.collect();
            let part = |found: Option<TypeId>| match found.map(|found| translator.module.ty(found)) {
                Some(&Type::Vector { component, count }) if flattens_vectors => (Some(component), count),
                _ => (found, 1),
            };
            parts.len() > usize::from(count > 1)
                && parts.iter().all(|&found| is(part(found).0, component))
                && parts.iter().map(|&found| u64::from(part(found).1)).sum::<u64>() == u64::from(count)
        }
        Type::Matrix { column: part, .. } | Type::Array { element: part, .. } => {
            types.into_iter().all(|found| is(found, part))
        }
        Type::Struct { ref members, .. } => {
            members.len() == types.len() && types.zip(members).all(|(found, member)| is(found, member.ty))
        }
        _ => true,
    };
    if fits {
        return Ok(());
    }
    let name = translator.module.describe_type(ty);
    Err(translator.invalid(format!("the constituents do not form a {name}")))
}

fn check_count(translator: &mut Translator<'_>, instruction: &Instruction, words: &Words) -> Result<()> {
    let ty = translator.result_type(instruction)?;
    if translator.word_count(ty)? as usize != words.len() {
        let name = translator.module.describe_type(ty);
        return Err(translator.invalid(format!("the constituents do not form a {name}")));
    }
    Ok(())
}

/// The offset of a component, in registers.
fn component_offset(
    translator: &mut Translator<'_>,
    index: crate::module::Id,
    stride: u32,
    count: u32,
) -> Result<Reg> {
    let index = translator.integer(index, ReadAs::Index)?;
    let to = translator.fresh(1)?;
    let length = Length::Known(count);
    translator.emit(Op::Memory(memory::MemoryOp::Index { to, base: None, index, stride, length }));
    Ok(to)
}

/// Which instructions make logical pointers.
const LOGICAL_POINTERS: &str = "SPIR-V, 2.16.1: a logical pointer is the result of OpVariable, \
                                OpAccessChain, OpFunctionParameter or a similar instruction";

/// Bits of a scalar; a device address has 64.
fn bits(translator: &Translator<'_>, ty: TypeId) -> Result<u32> {
    match translator.module.ty(ty) {
        Type::Pointer { .. } if address::is_physical(translator, ty) => Ok(64),
        Type::Pointer { .. } => {
            let message = "OpBitcast converts device addresses, not logical pointers";
            Err(translator.invalid(message).note(LOGICAL_POINTERS))
        }
        Type::Int { .. } | Type::Float { .. } => translator.scalar_width(ty),
        &Type::Vector { component, .. } => bits(translator, component),
        _ => {
            let name = translator.module.describe_type(ty);
            Err(translator
                .invalid(format!("OpBitcast converts numbers, vectors of numbers and pointers, not {name}")))
        }
    }
}

fn bitcast(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<Words> {
    let id = translator.id(instruction, 0)?;
    let (source, target) = (translator.type_of(id)?, translator.result_type(instruction)?);
    let (from, to) = (bits(translator, source)?, bits(translator, target)?);
    if from * translator.component_count(source) != to * translator.component_count(target) {
        let [source, target] = [source, target].map(|ty| translator.module.describe_type(ty));
        let message = format!("OpBitcast from {source} to {target}, which differ in their number of bits");
        return Err(translator
            .invalid(message)
            .note("SPIR-V, 3.3.11, OpBitcast: both sides have the same number of bits"));
    }
    let words = translator.words(id)?;
    if from == to || (from >= 32 && to == 32) {
        return Ok(words);
    }
    match (from, to) {
        (32, 64) => {
            let mut pairs = Words::new();
            for pair in words.chunks_exact(2) {
                let first = translator.pair(pair[0], pair[1])?;
                pairs.extend([first, first.plus(1)]);
            }
            Ok(pairs)
        }
        // Narrow scalars are packed or unpacked, the lowest first.
        _ => {
            let mut packed: Vec<Reg> = Vec::new();
            if from < 32 {
                for group in words.chunks((32 / from) as usize) {
                    let mut sum = translator.constant(0)?;
                    for (at, &part) in group.iter().enumerate() {
                        let by = translator.constant(from * at as u32)?;
                        let moved =
                            translator.emit_family(&crate::ops::bit::ShiftLeftLogical, 32, &[part, by])?;
                        sum = translator.emit_family(&crate::ops::bit::BitwiseOr, 32, &[sum, moved])?;
                    }
                    packed.push(sum);
                }
            } else {
                packed.extend(&words);
            }
            let mut result = Words::new();
            match to {
                64 => {
                    for pair in packed.chunks_exact(2) {
                        let first = translator.pair(pair[0], pair[1])?;
                        result.extend([first, first.plus(1)]);
                    }
                }
                32 => result.extend(packed),
                _ => {
                    let count =
                        translator.result_type(instruction).map(|ty| translator.component_count(ty))?;
                    let mask = translator.constant((1 << to) - 1)?;
                    'all: for &word in &packed {
                        for at in 0..32 / to {
                            if result.len() as u32 == count {
                                break 'all;
                            }
                            let by = translator.constant(to * at)?;
                            let moved = translator.emit_family(
                                &crate::ops::bit::ShiftRightLogical,
                                32,
                                &[word, by],
                            )?;
                            result.push(translator.emit_family(
                                &crate::ops::bit::BitwiseAnd,
                                32,
                                &[moved, mask],
                            )?);
                        }
                    }
                }
            }
            Ok(result)
        }
    }
}
