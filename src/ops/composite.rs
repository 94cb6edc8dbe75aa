//! Composite instructions (SPIR-V 3.3.12), `OpSelect`, copies and undefined values: lists of registers
//! rearranged; only an index that is computed needs an operation.

use rspirv::spirv::Op as Opcode;
use smallvec::SmallVec;

use crate::error::Result;
use crate::machine::Reg;
use crate::module::Instruction;
use crate::module::ty::{Type, TypeId};
use crate::ops::address;
use crate::ops::decode::{Decoder, Words, registers_from};
use crate::ops::integer_operand::Reading;
use crate::ops::linear_algebra;
use crate::ops::memory::{self, Length};
use crate::ops::op::Op;
use crate::ops::relational_logical::select::SelectWord;

/// Opcodes decoded here.
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
    Opcode::CopyLogical,
    Opcode::Undef,
    Opcode::Select,
    Opcode::Bitcast,
];

/// Decodes composite instructions; `false` for an instruction of another section.
pub fn decode(decoder: &mut Decoder<'_>, opcode: Opcode, instruction: &Instruction) -> Result<bool> {
    match opcode {
        Opcode::CompositeConstruct => {
            let ty = decoder.result_type(instruction)?;
            check_constituents(decoder, ty, decoder.operands(instruction), true)?;
            let mut words = Words::new();
            for &id in decoder.operands(instruction) {
                words.extend(decoder.words(crate::module::Id(id))?);
            }
            check_count(decoder, instruction, &words)?;
            decoder.result(instruction, words);
        }
        Opcode::CompositeConstructReplicateEXT => {
            let part = decoder.id(instruction, 0)?;
            let ty = decoder.result_type(instruction)?;
            let words = replicate(decoder, ty, part)?;
            decoder.result(instruction, words);
        }
        Opcode::CompositeExtract => {
            let composite = decoder.id(instruction, 0)?;
            let ty = decoder.type_of(composite)?;
            let words = decoder.words(composite)?;
            let indices = &decoder.operands(instruction)[1..];
            let (first, count) = part(decoder, ty, indices)?;
            decoder.result(instruction, words[first..first + count].into());
        }
        Opcode::CompositeInsert => {
            let object = decoder.operand(instruction, 0)?;
            let composite = decoder.id(instruction, 1)?;
            let ty = decoder.type_of(composite)?;
            let mut words = decoder.words(composite)?;
            let indices = &decoder.operands(instruction)[2..];
            let (first, count) = part(decoder, ty, indices)?;
            if object.len() != count {
                return Err(decoder.invalid("the object inserted has another type than the part it replaces"));
            }
            words[first..first + count].copy_from_slice(&object);
            decoder.result(instruction, words);
        }
        Opcode::VectorShuffle => {
            let (a, b) = (decoder.id(instruction, 0)?, decoder.id(instruction, 1)?);
            let width = decoder.type_of(a).and_then(|ty| decoder.scalar_width(ty))?;
            let ty = decoder.result_type(instruction)?;
            let component = |ty: TypeId| match *decoder.module.ty(ty) {
                Type::Vector { component, .. } => Some(component),
                _ => None,
            };
            let parts = [decoder.type_of(a)?, decoder.type_of(b)?, ty].map(component);
            if parts[0].is_none() || parts.iter().any(|&part| part != parts[0]) {
                return Err(decoder.invalid("a shuffle takes and gives vectors of one component type"));
            }
            let mut components = decoder.components(a)?;
            components.extend(decoder.components(b)?);
            let undefined = decoder.wide_constant(0)?;
            let mut chosen = Words::new();
            for &literal in &decoder.operands(instruction)[2..] {
                let component = match literal {
                    u32::MAX => undefined,
                    _ => *components
                        .get(literal as usize)
                        .ok_or_else(|| decoder.invalid(format!("component {literal} of a shuffle")))?,
                };
                chosen.push(component);
            }
            let words = decoder.spread(&chosen, width);
            decoder.result(instruction, words);
        }
        Opcode::VectorExtractDynamic => {
            let vector = decoder.id(instruction, 0)?;
            let index = decoder.id(instruction, 1)?;
            let words = decoder.words(vector)?;
            let count = decoder.component_count(decoder.type_of(vector)?);
            let each = words.len() as u32 / count.max(1);
            let first = decoder.consecutive(&words)?;
            decoder.addressed.push((first, words.len() as u32));
            let index = scaled(decoder, index, each, count)?;
            let to = decoder.fresh(each)?;
            decoder.emit(Op::Memory(memory::Op::Gather { to, count: each, first, index }));
            decoder.result(instruction, registers_from(to, each));
        }
        Opcode::VectorInsertDynamic => {
            let vector = decoder.id(instruction, 0)?;
            let component = decoder.operand(instruction, 1)?;
            let index = decoder.id(instruction, 2)?;
            let words = decoder.words(vector)?;
            let count = decoder.component_count(decoder.type_of(vector)?);
            let each = component.len() as u32;
            let to = decoder.fresh(words.len() as u32)?;
            for (at, &from) in words.iter().enumerate() {
                decoder.emit(Op::Memory(memory::Op::Move { to: to.plus(at as u32), from }));
            }
            decoder.addressed.push((to, words.len() as u32));
            let index = scaled(decoder, index, each, count)?;
            let from = decoder.consecutive(&component)?;
            decoder.emit(Op::Memory(memory::Op::Scatter { from, count: each, first: to, index }));
            decoder.result(instruction, registers_from(to, words.len() as u32));
        }
        Opcode::Transpose => {
            let matrix = decoder.id(instruction, 0)?;
            let columns = columns(decoder, matrix)?;
            let width = scalar_width_of_matrix(decoder, matrix)?;
            let rows = columns.first().map_or(0, SmallVec::len);
            linear_algebra::check_shape(decoder, instruction, rows, columns.len())?;
            if !linear_algebra::have_one_scalar_type(decoder, instruction)? {
                return Err(decoder.invalid("a transposed matrix has the component type of the matrix"));
            }
            let transposed: Words =
                (0..rows).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
            let words = decoder.spread(&transposed, width);
            decoder.result(instruction, words);
        }
        Opcode::CopyObject => {
            let id = decoder.id(instruction, 0)?;
            let value = decoder.value(id)?;
            if let Some(result) = instruction.result {
                decoder.define(result, value);
            }
        }
        Opcode::CopyLogical => {
            let (from, to) = (decoder.id(instruction, 0)?, decoder.result_type(instruction)?);
            let from = decoder.type_of(from)?;
            if decoder.scalars(from)? != decoder.scalars(to)? {
                let [from, to] = [from, to].map(|ty| decoder.module.describe_type(ty));
                return Err(decoder.invalid(format!("OpCopyLogical of {from} to {to}, which do not match")));
            }
            let words = decoder.operand(instruction, 0)?;
            check_count(decoder, instruction, &words)?;
            decoder.result(instruction, words);
        }
        Opcode::Undef => {
            let ty = decoder.result_type(instruction)?;
            let words = decoder.zero(ty)?;
            decoder.result(instruction, words);
        }
        Opcode::Select => {
            let condition = decoder.components_of_bool(instruction, 0)?;
            let objects = [decoder.id(instruction, 1)?, decoder.id(instruction, 2)?];
            let (a, b) = (decoder.carried(objects[0])?, decoder.carried(objects[1])?);
            if a.len() != b.len() || a.is_empty() {
                return Err(decoder.invalid("the objects of a select differ in type"));
            }
            // A vector of conditions chooses component by component, a scalar the whole object.
            let each = a.len() / condition.len().max(1);
            let mut words = Words::new();
            let first = decoder.fresh(a.len() as u32)?;
            let mut folded = true;
            for at in 0..a.len() {
                let from = [condition[(at / each.max(1)).min(condition.len() - 1)], a[at], b[at]];
                if let Some(word) = decoder.constant_word(from[0]) {
                    words.push(if word != 0 { from[1] } else { from[2] });
                    continue;
                }
                folded = false;
                let to = first.plus(at as u32);
                decoder.emit(Op::LaneKernel { kernel: &SelectWord.kernels[0], to, from });
                words.push(to);
            }
            if !folded && condition.len() > 1 {
                // Known and computed conditions may be mixed: keep the words of a pair together.
                let start = decoder.consecutive(&words)?;
                words = registers_from(start, words.len() as u32);
            }
            decoder.result(instruction, words);
        }
        Opcode::Bitcast => {
            let words = bitcast(decoder, instruction)?;
            decoder.result(instruction, words);
        }
        _ => return Ok(false),
    }
    Ok(true)
}

impl Decoder<'_> {
    /// The registers of an operand that is a bool or a vector of bools.
    fn components_of_bool(&mut self, instruction: &Instruction, at: usize) -> Result<Words> {
        let id = self.id(instruction, at)?;
        let words = self.words(id)?;
        if words.is_empty() { Err(self.invalid("a condition without a value")) } else { Ok(words) }
    }
}

/// A composite all of whose constituents are one value.
pub fn replicate(decoder: &mut Decoder<'_>, ty: TypeId, part: crate::module::Id) -> Result<Words> {
    let element = match *decoder.module.ty(ty) {
        Type::Vector { component: element, .. }
        | Type::Matrix { column: element, .. }
        | Type::Array { element, .. } => Some(element),
        _ => None,
    };
    if let (Some(element), Some(found)) = (element, decoder.module.type_of(part))
        && element != found
    {
        let [name, found] = [ty, found].map(|ty| decoder.module.describe_type(ty));
        return Err(decoder.invalid(format!("a {name} is not made of copies of a {found}")));
    }
    let words = decoder.words(part)?;
    let count = decoder.word_count(ty)? as usize;
    if words.is_empty() || !count.is_multiple_of(words.len()) {
        let name = decoder.module.describe_type(ty);
        return Err(decoder.invalid(format!("the constituent repeated does not make a {name}")));
    }
    Ok(words.iter().copied().cycle().take(count).collect())
}

/// The first register of each component of each column of a matrix.
pub fn columns(decoder: &mut Decoder<'_>, matrix: crate::module::Id) -> Result<Vec<Words>> {
    let ty = decoder.type_of(matrix)?;
    let Type::Matrix { column, count } = *decoder.module.ty(ty) else {
        return Err(decoder.invalid("a matrix is needed here"));
    };
    let each = decoder.scalar_width(column)?.div_ceil(32) as usize;
    let words = decoder.words(matrix)?;
    let components: Words = words.chunks(each).map(|chunk| chunk[0]).collect();
    Ok(components.chunks((components.len() / count.max(1) as usize).max(1)).map(Words::from_slice).collect())
}

/// Bits of a matrix's scalars.
pub fn scalar_width_of_matrix(decoder: &Decoder<'_>, matrix: crate::module::Id) -> Result<u32> {
    match *decoder.module.ty(decoder.type_of(matrix)?) {
        Type::Matrix { column, .. } => decoder.scalar_width(column),
        _ => Err(decoder.invalid("a matrix is needed here")),
    }
}

/// Where the part that literal indices name lies among the words of a composite.
fn part(decoder: &mut Decoder<'_>, mut ty: TypeId, indices: &[u32]) -> Result<(usize, usize)> {
    let mut first = 0;
    for &index in indices {
        let outside =
            |decoder: &Decoder<'_>| decoder.invalid(format!("index {index} of a composite is too big"));
        ty = match *decoder.module.ty(ty) {
            Type::Struct { ref members, .. } => {
                let member = members.get(index as usize).ok_or_else(|| outside(decoder))?;
                for member in &members[..index as usize] {
                    first += decoder.word_count(member.ty)?;
                }
                member.ty
            }
            Type::Vector { component: element, count } | Type::Matrix { column: element, count } => {
                if index >= count {
                    return Err(outside(decoder));
                }
                first += index * decoder.word_count(element)?;
                element
            }
            Type::Array { element, length, .. } => {
                if index >= decoder.array_length(length)? {
                    return Err(outside(decoder));
                }
                first += index * decoder.word_count(element)?;
                element
            }
            _ => return Err(decoder.invalid("an index into what is no composite")),
        };
    }
    Ok((first as usize, decoder.word_count(ty)? as usize))
}

/// Holds the constituents of a composite against its type; those of a vector may be vectors where `joined`
/// says so (`OpCompositeConstruct`).
///
/// # Errors
/// `InvalidModule`
pub fn check_constituents(decoder: &Decoder<'_>, ty: TypeId, ids: &[u32], joined: bool) -> Result<()> {
    let types = ids.iter().map(|&id| decoder.module.type_of(crate::module::Id(id)));
    let is = |found: Option<TypeId>, part: TypeId| found.is_none_or(|found| found == part);
    let fits = match *decoder.module.ty(ty) {
        Type::Vector { component, count } => {
            let parts: Vec<Option<TypeId>> = types.collect();
            let part = |found: Option<TypeId>| match found.map(|found| decoder.module.ty(found)) {
                Some(&Type::Vector { component, count }) if joined => (Some(component), count),
                _ => (found, 1),
            };
            parts.len() > 1
                && parts.iter().all(|&found| is(part(found).0, component))
                && parts.iter().map(|&found| part(found).1).sum::<u32>() == count
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
    let name = decoder.module.describe_type(ty);
    Err(decoder.invalid(format!("the constituents do not make a {name}")))
}

fn check_count(decoder: &mut Decoder<'_>, instruction: &Instruction, words: &Words) -> Result<()> {
    let ty = decoder.result_type(instruction)?;
    if decoder.word_count(ty)? as usize != words.len() {
        let name = decoder.module.describe_type(ty);
        return Err(decoder.invalid(format!("the constituents do not make a {name}")));
    }
    Ok(())
}

/// The register offset of a component.
fn scaled(decoder: &mut Decoder<'_>, index: crate::module::Id, stride: u32, count: u32) -> Result<Reg> {
    let index = decoder.integer(index, Reading::Index)?;
    let to = decoder.fresh(1)?;
    let length = Length::Known(count);
    decoder.emit(Op::Memory(memory::Op::Index { to, base: None, index, stride, length }));
    Ok(to)
}

/// Bits of a scalar; a device address has 64.
fn bits(decoder: &Decoder<'_>, ty: TypeId) -> Result<u32> {
    match decoder.module.ty(ty) {
        Type::Pointer { .. } if address::is_physical(decoder, ty) => Ok(64),
        Type::Pointer { .. } => Err(decoder.unsupported("OpBitcast of a logical pointer")),
        Type::Int { .. } | Type::Float { .. } => decoder.scalar_width(ty),
        &Type::Vector { component, .. } => bits(decoder, component),
        _ => {
            let name = decoder.module.describe_type(ty);
            Err(decoder.invalid(format!(
                "OpBitcast takes and gives numbers, vectors of them and pointers, not {name}"
            )))
        }
    }
}

fn bitcast(decoder: &mut Decoder<'_>, instruction: &Instruction) -> Result<Words> {
    let id = decoder.id(instruction, 0)?;
    let (source, target) = (decoder.type_of(id)?, decoder.result_type(instruction)?);
    let (from, to) = (bits(decoder, source)?, bits(decoder, target)?);
    if from * decoder.component_count(source) != to * decoder.component_count(target) {
        let [source, target] = [source, target].map(|ty| decoder.module.describe_type(ty));
        return Err(decoder.invalid(format!("OpBitcast of {source} to {target}, which has other bits")));
    }
    let words = decoder.words(id)?;
    if from == to || (from >= 32 && to == 32) {
        return Ok(words);
    }
    match (from, to) {
        (32, 64) => {
            let mut pairs = Words::new();
            for pair in words.chunks_exact(2) {
                let first = decoder.pair(pair[0], pair[1])?;
                pairs.extend([first, first.plus(1)]);
            }
            Ok(pairs)
        }
        // Narrow scalars are packed or unpacked, the lowest first.
        _ => {
            let mut packed: Vec<Reg> = Vec::new();
            if from < 32 {
                for group in words.chunks((32 / from) as usize) {
                    let mut sum = decoder.constant(0)?;
                    for (at, &part) in group.iter().enumerate() {
                        let by = decoder.constant(from * at as u32)?;
                        let moved =
                            decoder.emit_family(&crate::ops::bit::ShiftLeftLogical, 32, &[part, by])?;
                        sum = decoder.emit_family(&crate::ops::bit::BitwiseOr, 32, &[sum, moved])?;
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
                        let first = decoder.pair(pair[0], pair[1])?;
                        result.extend([first, first.plus(1)]);
                    }
                }
                32 => result.extend(packed),
                _ => {
                    let count = decoder.result_type(instruction).map(|ty| decoder.component_count(ty))?;
                    let mask = decoder.constant((1 << to) - 1)?;
                    'all: for &word in &packed {
                        for at in 0..32 / to {
                            if result.len() as u32 == count {
                                break 'all;
                            }
                            let by = decoder.constant(to * at)?;
                            let moved =
                                decoder.emit_family(&crate::ops::bit::ShiftRightLogical, 32, &[word, by])?;
                            result.push(decoder.emit_family(
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
