//! Instructions that are made of kernels but not componentwise: conversions (a kernel for each pair of
//! widths), extended arithmetic, bit fields, `OpAny`/`OpAll`, and the packing half of
//! `GLSL.std.450`.

use rspirv::spirv::{GlslStd450Op, Op as Opcode};
use smallvec::SmallVec;

use crate::error::Result;
use crate::machine::Reg;
use crate::module::ty::Type;
use crate::module::{Id, Instruction};
use crate::ops::arithmetic::{self, extended};
use crate::ops::bit::{self, field};
use crate::ops::conversion::encoded::{self, Rounding};
use crate::ops::conversion::{self, Conversion};
use crate::ops::decode::{Decoder, Words};
use crate::ops::glsl::parts;
use crate::ops::integer_operand::Reading;
use crate::ops::lane_kernel::{InstructionSet, OpFamily, family};
use crate::ops::relational_logical as logical;
use crate::ops::{amd, componentwise, debug_printf, linear_algebra};

/// Opcodes decoded here.
pub const OPCODES: &[Opcode] = &[
    Opcode::ConvertFToU,
    Opcode::ConvertFToS,
    Opcode::ConvertSToF,
    Opcode::ConvertUToF,
    Opcode::UConvert,
    Opcode::SConvert,
    Opcode::FConvert,
    Opcode::IAddCarry,
    Opcode::ISubBorrow,
    Opcode::UMulExtended,
    Opcode::SMulExtended,
    Opcode::BitFieldInsert,
    Opcode::BitFieldSExtract,
    Opcode::BitFieldUExtract,
    Opcode::Any,
    Opcode::All,
    Opcode::ExpectKHR,
    Opcode::AssumeTrueKHR,
    Opcode::ReadClockKHR,
    Opcode::ExtInst,
];

/// `GLSL.std.450` instructions decoded here.
pub const GLSL: &[GlslStd450Op] = &[
    GlslStd450Op::Modf,
    GlslStd450Op::ModfStruct,
    GlslStd450Op::Frexp,
    GlslStd450Op::FrexpStruct,
    GlslStd450Op::PackSnorm4x8,
    GlslStd450Op::PackUnorm4x8,
    GlslStd450Op::PackSnorm2x16,
    GlslStd450Op::PackUnorm2x16,
    GlslStd450Op::PackHalf2x16,
    GlslStd450Op::PackDouble2x32,
    GlslStd450Op::UnpackSnorm4x8,
    GlslStd450Op::UnpackUnorm4x8,
    GlslStd450Op::UnpackSnorm2x16,
    GlslStd450Op::UnpackUnorm2x16,
    GlslStd450Op::UnpackHalf2x16,
    GlslStd450Op::UnpackDouble2x32,
];

/// Decodes the instructions of this file; `false` for any other.
pub fn decode(decoder: &mut Decoder<'_>, opcode: Opcode, instruction: &Instruction) -> Result<bool> {
    let conversion = match opcode {
        Opcode::ConvertFToU => Some(Conversion::FToU),
        Opcode::ConvertFToS => Some(Conversion::FToS),
        Opcode::ConvertSToF => Some(Conversion::SToF),
        Opcode::ConvertUToF => Some(Conversion::UToF),
        Opcode::UConvert => Some(Conversion::U),
        Opcode::SConvert => Some(Conversion::S),
        Opcode::FConvert => Some(Conversion::F),
        _ => None,
    };
    if let Some(conversion) = conversion {
        convert(decoder, conversion, instruction)?;
        return Ok(true);
    }
    match opcode {
        Opcode::IAddCarry => pair_of(decoder, instruction, &arithmetic::IAdd, &extended::Carry)?,
        Opcode::ISubBorrow => pair_of(decoder, instruction, &arithmetic::ISub, &extended::Borrow)?,
        Opcode::UMulExtended => pair_of(decoder, instruction, &arithmetic::IMul, &extended::UMulHigh)?,
        Opcode::SMulExtended => pair_of(decoder, instruction, &arithmetic::IMul, &extended::SMulHigh)?,
        Opcode::BitFieldInsert => {
            let width = width(decoder, instruction, 0)?;
            let (base, insert) = (components(decoder, instruction, 0)?, components(decoder, instruction, 1)?);
            let (offset, count) = (bits(decoder, instruction, 2)?, bits(decoder, instruction, 3)?);
            let mask = decoder.emit_family(&field::FieldMask, width, &[offset, count])?;
            let mut result = Words::new();
            for (&base, &insert) in base.iter().zip(&insert) {
                let moved = decoder.emit_family(&bit::ShiftLeftLogical, width, &[insert, offset])?;
                result.push(decoder.emit_family(&field::FieldMerge, width, &[mask, moved, base])?);
            }
            finish(decoder, instruction, &result, width);
        }
        Opcode::BitFieldSExtract | Opcode::BitFieldUExtract => {
            let width = width(decoder, instruction, 0)?;
            let base = components(decoder, instruction, 0)?;
            let (offset, count) = (bits(decoder, instruction, 1)?, bits(decoder, instruction, 2)?);
            let signed = opcode == Opcode::BitFieldSExtract;
            let family = if signed { &field::FieldSExtract } else { &field::FieldUExtract };
            let mut result = Words::new();
            for &base in &base {
                result.push(decoder.emit_family(family, width, &[base, offset, count])?);
            }
            finish(decoder, instruction, &result, width);
        }
        Opcode::Any | Opcode::All => {
            let words = decoder.operand(instruction, 0)?;
            let family = if opcode == Opcode::Any { &logical::LogicalOr } else { &logical::LogicalAnd };
            let mut result = words[0];
            for &word in &words[1..] {
                result = decoder.emit_family(family, 0, &[result, word])?;
            }
            decoder.result(instruction, SmallVec::from_slice(&[result]));
        }
        // What a shader promises of a value changes none.
        Opcode::ExpectKHR => {
            let words = decoder.operand(instruction, 0)?;
            decoder.result(instruction, words);
        }
        Opcode::AssumeTrueKHR => {}
        Opcode::ReadClockKHR => {
            let words = decoder.read_clock()?;
            decoder.result(instruction, words);
        }
        Opcode::ExtInst => return extended_instruction(decoder, instruction).map(|()| true),
        _ => return Ok(false),
    }
    Ok(true)
}

fn width(decoder: &Decoder<'_>, instruction: &Instruction, at: usize) -> Result<u32> {
    let ty = decoder.type_of(decoder.id(instruction, at)?)?;
    decoder.scalar_width(ty)
}

fn components(decoder: &mut Decoder<'_>, instruction: &Instruction, at: usize) -> Result<Words> {
    let id = decoder.id(instruction, at)?;
    decoder.components(id)
}

/// The offset or count of a bit field, an integer of any width.
fn bits(decoder: &mut Decoder<'_>, instruction: &Instruction, at: usize) -> Result<Reg> {
    let id = decoder.id(instruction, at)?;
    decoder.integer(id, Reading::Unsigned)
}

fn finish(decoder: &mut Decoder<'_>, instruction: &Instruction, components: &[Reg], width: u32) {
    let words = decoder.spread(components, width);
    decoder.result(instruction, words);
}

fn convert(decoder: &mut Decoder<'_>, conversion: Conversion, instruction: &Instruction) -> Result<()> {
    let operand = decoder.type_of(decoder.id(instruction, 0)?)?;
    let ty = decoder.result_type(instruction)?;
    let (from, to) = (decoder.scalar_width(operand)?, decoder.scalar_width(ty)?);
    let takes_float = matches!(conversion, Conversion::FToU | Conversion::FToS | Conversion::F);
    let gives_float = matches!(conversion, Conversion::SToF | Conversion::UToF | Conversion::F);
    let [source, target] = [operand, ty].map(|ty| decoder.float_format(ty));
    if source.is_some() != takes_float || target.is_some() != gives_float {
        let name = crate::module::names::opcode_name(instruction.opcode);
        let [operand, ty] = [operand, ty].map(|ty| decoder.module.describe_type(ty));
        return Err(decoder.invalid(format!("{name} from {operand} to {ty} (SPIR-V 3.3.11)")));
    }
    let rounding = Rounding::of(decoder, instruction.result)?;
    let modes = decoder.float_controls;
    decoder.float_controls = modes.rounding(to, rounding);
    let mut result = Words::new();
    for component in components(decoder, instruction, 0)? {
        let (value, from) = match source {
            Some(source) if Some(source) != target => encoded::widened(decoder, source, component)?,
            _ => (component, from),
        };
        result.push(match target {
            Some(target) if source != Some(target) => {
                encoded::narrowed(decoder, (conversion, from), (target, rounding), value)?
            }
            _ => encoded::between(decoder, conversion, (from, to), value)?,
        });
    }
    decoder.float_controls = modes;
    finish(decoder, instruction, &result, to);
    Ok(())
}

/// The two members of an extended operation: low part, then carry or high part.
fn pair_of(
    decoder: &mut Decoder<'_>,
    instruction: &Instruction,
    low: &'static OpFamily,
    high: &'static OpFamily,
) -> Result<()> {
    let width = width(decoder, instruction, 0)?;
    let (a, b) = (components(decoder, instruction, 0)?, components(decoder, instruction, 1)?);
    if a.len() != b.len() {
        return Err(decoder.invalid("the operands of an extended operation differ in size"));
    }
    let mut members = [Words::new(), Words::new()];
    for (&a, &b) in a.iter().zip(&b) {
        members[0].push(decoder.emit_family(low, width, &[a, b])?);
        members[1].push(decoder.emit_family(high, width, &[a, b])?);
    }
    let members = members.concat();
    finish(decoder, instruction, &members, width);
    Ok(())
}

fn extended_instruction(decoder: &mut Decoder<'_>, instruction: &Instruction) -> Result<()> {
    let (set, number) = (decoder.id(instruction, 0)?, decoder.literal(instruction, 1)?);
    let name = match decoder.module.definition(set) {
        Some(crate::module::Definition::InstructionSet(at)) => {
            decoder.module.instruction_sets[at as usize].as_str()
        }
        _ => return Err(decoder.invalid(format!("%{} is no instruction set", set.0))),
    };
    if name == debug_printf::SET {
        return debug_printf::decode(decoder, instruction);
    }
    if name.starts_with("NonSemantic.") {
        return Ok(());
    }
    if amd::decode(decoder, name, number, instruction)? {
        return Ok(());
    }
    if name != "GLSL.std.450" {
        return Err(decoder.unsupported(format!("the instruction set {name}")));
    }
    if let Some(family) = family(InstructionSet::Glsl, number) {
        return componentwise(decoder, family, instruction, 2);
    }
    let known = GlslStd450Op::from_u32(number);
    let done = match known {
        Some(number) => {
            linear_algebra::decode_glsl(decoder, number, instruction)?
                || decode_glsl(decoder, number, instruction)?
        }
        None => false,
    };
    if done {
        return Ok(());
    }
    Err(decoder.unsupported(crate::module::names::ext_inst_name(name, number).into_owned()))
}

fn decode_glsl(decoder: &mut Decoder<'_>, number: GlslStd450Op, instruction: &Instruction) -> Result<bool> {
    use GlslStd450Op as G;
    match number {
        G::Modf | G::ModfStruct => {
            split(decoder, instruction, [&parts::ModfFraction, &crate::ops::glsl::Trunc], number == G::Modf)?;
        }
        G::Frexp | G::FrexpStruct => {
            split(decoder, instruction, [&parts::FrexpMantissa, &parts::FrexpExponent], number == G::Frexp)?;
        }
        G::PackSnorm4x8 => pack(decoder, instruction, &parts::Snorm8, 8)?,
        G::PackUnorm4x8 => pack(decoder, instruction, &parts::Unorm8, 8)?,
        G::PackSnorm2x16 => pack(decoder, instruction, &parts::Snorm16, 16)?,
        G::PackUnorm2x16 => pack(decoder, instruction, &parts::Unorm16, 16)?,
        G::PackHalf2x16 => pack(decoder, instruction, &parts::Half, 16)?,
        G::UnpackSnorm4x8 => unpack(decoder, instruction, &parts::FromSnorm8, 8)?,
        G::UnpackUnorm4x8 => unpack(decoder, instruction, &parts::FromUnorm8, 8)?,
        G::UnpackSnorm2x16 => unpack(decoder, instruction, &parts::FromSnorm16, 16)?,
        G::UnpackUnorm2x16 => unpack(decoder, instruction, &parts::FromUnorm16, 16)?,
        G::UnpackHalf2x16 => unpack(decoder, instruction, &parts::FromHalf, 16)?,
        G::PackDouble2x32 => {
            let words = decoder.operand(instruction, 2)?;
            let &[low, high] = &words[..] else {
                return Err(decoder.invalid("a vector of two is needed here"));
            };
            let first = decoder.pair(low, high)?;
            decoder.result(instruction, SmallVec::from_slice(&[first, first.plus(1)]));
        }
        G::UnpackDouble2x32 => {
            let words = decoder.operand(instruction, 2)?;
            decoder.result(instruction, words);
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// `Modf` and `Frexp`: the first part is the result, the second goes to a pointer or a member.
fn split(
    decoder: &mut Decoder<'_>,
    instruction: &Instruction,
    families: [&'static OpFamily; 2],
    to_pointer: bool,
) -> Result<()> {
    let width = width(decoder, instruction, 2)?;
    let operand_type = decoder.type_of(decoder.id(instruction, 2)?)?;
    let operand = components(decoder, instruction, 2)?;
    let mut results = [Words::new(), Words::new()];
    for &component in &operand {
        for (result, family) in results.iter_mut().zip(families) {
            let kernel = family.kernel(width);
            let kernel = kernel.ok_or_else(|| decoder.unsupported(format!("{width}-bit {}", family.name)))?;
            let first = decoder.emit_kernel(kernel, &[component])?;
            result.extend((0..kernel.words).map(|word| first.plus(word)));
        }
    }
    let [first, mut second] = results;
    let pointer = match to_pointer {
        true => {
            let id = decoder.id(instruction, 3)?;
            Some(decoder.pointer(id)?)
        }
        false => None,
    };
    let ty = match &pointer {
        Some(pointer) => pointer.pointee,
        None => {
            let ty = decoder.result_type(instruction)?;
            match decoder.module.ty(ty) {
                Type::Struct { members, .. } if members.len() == 2 => members[1].ty,
                _ => return Err(decoder.invalid("the result is a struct of two members here")),
            }
        }
    };
    check_second(decoder, families[0], operand_type, ty)?;
    // An exponent has 32 bits, or 16 (SPV_AMD_gpu_shader_int16).
    if std::ptr::eq(families[1], &parts::FrexpExponent)
        && let Some(kernel) = conversion::kernel(Conversion::S, 32, decoder.scalar_width(ty)?)
    {
        let exponents =
            second.iter().map(|&word| decoder.emit_kernel(kernel, &[word])).collect::<Result<Words>>()?;
        second = decoder.spread(&exponents, decoder.scalar_width(ty)?);
    }
    if let Some(pointer) = pointer {
        crate::ops::load_store::store(decoder, &pointer, &second)?;
        decoder.result(instruction, first);
    } else {
        let mut words = first;
        words.extend(second);
        decoder.result(instruction, words);
    }
    Ok(())
}

/// The whole part of `Modf` is of its operand's type, the exponent of `Frexp` an integer of 32 bits, or of 16
/// with `SPV_AMD_gpu_shader_int16`.
fn check_second(
    decoder: &Decoder<'_>,
    first: &'static OpFamily,
    operand: crate::module::ty::TypeId,
    ty: crate::module::ty::TypeId,
) -> Result<()> {
    let scalar = match *decoder.module.ty(ty) {
        Type::Vector { component, .. } => component,
        _ => ty,
    };
    let (fits, needed) = match std::ptr::eq(first, &parts::FrexpMantissa) {
        true => (
            matches!(decoder.module.ty(scalar), Type::Int { width: 16 | 32, .. })
                && decoder.component_count(ty) == decoder.component_count(operand),
            "an integer of 32 bits for each component (16 with SPV_AMD_gpu_shader_int16)",
        ),
        false => (ty == operand, "the type of the operand"),
    };
    if fits {
        return Ok(());
    }
    let name = decoder.module.describe_type(ty);
    Err(decoder
        .invalid(format!("the second part of Modf or Frexp is of type {name}, where {needed} must be")))
}

fn pack(
    decoder: &mut Decoder<'_>,
    instruction: &Instruction,
    family: &'static OpFamily,
    bits: u32,
) -> Result<()> {
    let mut sum = decoder.constant(0)?;
    for (at, component) in components(decoder, instruction, 2)?.into_iter().enumerate() {
        let by = decoder.constant(bits * at as u32)?;
        let part = decoder.emit_family(family, 32, &[component, by])?;
        sum = decoder.emit_family(&bit::BitwiseOr, 32, &[sum, part])?;
    }
    decoder.result(instruction, SmallVec::from_slice(&[sum]));
    Ok(())
}

fn unpack(
    decoder: &mut Decoder<'_>,
    instruction: &Instruction,
    family: &'static OpFamily,
    bits: u32,
) -> Result<()> {
    let id: Id = decoder.id(instruction, 2)?;
    let word = decoder.words(id)?[0];
    let mut words = Words::new();
    for at in 0..32 / bits {
        let by = decoder.constant(bits * at)?;
        words.push(decoder.emit_family(family, 32, &[word, by])?);
    }
    decoder.result(instruction, words);
    Ok(())
}
