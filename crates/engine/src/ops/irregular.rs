//! Instructions that are made of kernels but not componentwise: conversions (a kernel for each pair
//! of widths), extended arithmetic, bit fields, `OpAny`/`OpAll`, and the packing half of
//! `GLSL.std.450`.

use rspirv::spirv::GlslStd450Op;
use smallvec::SmallVec;

use crate::machine::Reg;
use crate::math::array;
use crate::module::ty::Type;
use crate::module::{Id, Instruction, Opcode};
use crate::ops::arithmetic::{self, extended};
use crate::ops::bit::{self, field};
use crate::ops::conversion::encoded::{self, Rounding};
use crate::ops::conversion::{self, Conversion};
use crate::ops::glsl::parts;
use crate::ops::integer_operand::ReadAs;
use crate::ops::lane_kernel::{InstructionSet, OpFamily, family};
use crate::ops::translate::Translator;
use crate::ops::value_registers::Words;
use crate::ops::{amd, componentwise, debug_printf, linear_algebra, observed, relational_logical as logical};
use anyhit_base::error::Result;

/// Opcodes translated here.
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

/// `GLSL.std.450` instructions translated here.
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

/// Translates the instructions of this file; `false` for any other.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
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
        convert(translator, conversion, instruction)?;
        return Ok(true);
    }
    match opcode {
        Opcode::IAddCarry => {
            extended_arithmetic(translator, instruction, &arithmetic::IAdd, &extended::Carry)?
        }
        Opcode::ISubBorrow => {
            extended_arithmetic(translator, instruction, &arithmetic::ISub, &extended::Borrow)?
        }
        Opcode::UMulExtended => {
            extended_arithmetic(translator, instruction, &arithmetic::IMul, &extended::UMulHigh)?
        }
        Opcode::SMulExtended => {
            extended_arithmetic(translator, instruction, &arithmetic::IMul, &extended::SMulHigh)?
        }
        Opcode::BitFieldInsert => {
            let width = width(translator, instruction, 0)?;
            let (base, insert) =
                (components(translator, instruction, 0)?, components(translator, instruction, 1)?);
            let (offset, count) = (bits(translator, instruction, 2)?, bits(translator, instruction, 3)?);
            let mask = translator.emit_family(&field::FieldMask, width, &[offset, count])?;
            let mut result = Words::new();
            for (&base, &insert) in base.iter().zip(&insert) {
                let moved = translator.emit_family(&bit::ShiftLeftLogical, width, &[insert, offset])?;
                result.push(translator.emit_family(&field::FieldMerge, width, &[mask, moved, base])?);
            }
            define_components(translator, instruction, &result, width);
        }
        Opcode::BitFieldSExtract | Opcode::BitFieldUExtract => {
            let width = width(translator, instruction, 0)?;
            let base = components(translator, instruction, 0)?;
            let (offset, count) = (bits(translator, instruction, 1)?, bits(translator, instruction, 2)?);
            let signed = opcode == Opcode::BitFieldSExtract;
            let family = if signed { &field::FieldSExtract } else { &field::FieldUExtract };
            let mut result = Words::new();
            for &base in &base {
                result.push(translator.emit_family(family, width, &[base, offset, count])?);
            }
            define_components(translator, instruction, &result, width);
        }
        Opcode::Any | Opcode::All => {
            let words = translator.operand(instruction, 0)?;
            let family = if opcode == Opcode::Any { &logical::LogicalOr } else { &logical::LogicalAnd };
            let mut result = words[0];
            for &word in &words[1..] {
                result = translator.emit_family(family, 0, &[result, word])?;
            }
            translator.define_result(instruction, SmallVec::from_slice(&[result]));
        }
        // Hints about a value change no result.
        Opcode::ExpectKHR => {
            let words = translator.operand(instruction, 0)?;
            if !translator.optimizes {
                let expected = translator.operand(instruction, 1)?;
                if let (&[value], &[expected]) = (&words[..], &expected[..]) {
                    translator.emit_family(&observed::Expectation, 32, &[value, expected])?;
                }
            }
            translator.define_result(instruction, words);
        }
        Opcode::AssumeTrueKHR if translator.optimizes => {}
        Opcode::AssumeTrueKHR => {
            let words = translator.operand(instruction, 0)?;
            let &[condition] = &words[..] else {
                return Err(translator.invalid("an assumption must be a bool"));
            };
            translator.emit_family(&observed::Assumption, 0, &[condition])?;
        }
        Opcode::ReadClockKHR => {
            let words = translator.read_clock()?;
            translator.define_result(instruction, words);
        }
        Opcode::ExtInst => return extended_instruction(translator, instruction).map(|()| true),
        _ => return Ok(false),
    }
    Ok(true)
}

fn width(translator: &Translator<'_>, instruction: &Instruction, at: usize) -> Result<u32> {
    let ty = translator.type_of(translator.id(instruction, at)?)?;
    translator.scalar_width(ty)
}

fn components(translator: &mut Translator<'_>, instruction: &Instruction, at: usize) -> Result<Words> {
    let id = translator.id(instruction, at)?;
    translator.components(id)
}

/// The offset or count of a bit field, an integer of any width.
fn bits(translator: &mut Translator<'_>, instruction: &Instruction, at: usize) -> Result<Reg> {
    let id = translator.id(instruction, at)?;
    translator.integer(id, ReadAs::Unsigned)
}

fn define_components(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    components: &[Reg],
    width: u32,
) {
    let words = translator.expand_components(components, width);
    translator.define_result(instruction, words);
}

fn convert(translator: &mut Translator<'_>, conversion: Conversion, instruction: &Instruction) -> Result<()> {
    let operand = translator.type_of(translator.id(instruction, 0)?)?;
    let ty = translator.result_type(instruction)?;
    let (from, to) = (translator.scalar_width(operand)?, translator.scalar_width(ty)?);
    let takes_float = matches!(conversion, Conversion::FToU | Conversion::FToS | Conversion::F);
    let gives_float = matches!(conversion, Conversion::SToF | Conversion::UToF | Conversion::F);
    let [source, target] = array::map([operand, ty], |ty| translator.float_format(ty));
    if source.is_some() != takes_float || target.is_some() != gives_float {
        let opcode = instruction.opcode;
        let [operand, ty] = [operand, ty].map(|ty| translator.module.describe_type(ty));
        return Err(translator.invalid(format!("{opcode} cannot convert {operand} to {ty} (SPIR-V 3.3.11)")));
    }
    let rounding = Rounding::of(translator, instruction.result)?;
    let modes = translator.float_controls;
    translator.float_controls = modes.rounding(to, rounding);
    let mut result = Words::new();
    for component in components(translator, instruction, 0)? {
        let (value, from) = match source {
            Some(source) if Some(source) != target => encoded::widen(translator, source, component)?,
            _ => (component, from),
        };
        result.push(match target {
            Some(target) if source != Some(target) => {
                encoded::narrow(translator, conversion, from, target, rounding, value)?
            }
            _ => encoded::emit_conversion(translator, conversion, from, to, value)?,
        });
    }
    translator.float_controls = modes;
    define_components(translator, instruction, &result, to);
    Ok(())
}

/// Translates extended arithmetic, whose result has two members: low part, then carry or high part.
fn extended_arithmetic(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    low: &'static OpFamily,
    high: &'static OpFamily,
) -> Result<()> {
    let width = width(translator, instruction, 0)?;
    let (a, b) = (components(translator, instruction, 0)?, components(translator, instruction, 1)?);
    if a.len() != b.len() {
        return Err(translator.invalid("the operands of an extended operation differ in size"));
    }
    let mut members = [Words::new(), Words::new()];
    for (&a, &b) in a.iter().zip(&b) {
        members[0].push(translator.emit_family(low, width, &[a, b])?);
        members[1].push(translator.emit_family(high, width, &[a, b])?);
    }
    let members = members.concat();
    define_components(translator, instruction, &members, width);
    Ok(())
}

fn extended_instruction(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let (set, number) = (translator.id(instruction, 0)?, translator.literal(instruction, 1)?);
    let name = match translator.module.definition(set) {
        Some(crate::module::Definition::InstructionSet(at)) => {
            translator.module.instruction_sets[at as usize].as_str()
        }
        _ => return Err(translator.invalid(format!("%{} is not an instruction set", set.0))),
    };
    if name == debug_printf::SET {
        return debug_printf::translate(translator, instruction);
    }
    if name.starts_with("NonSemantic.") {
        return Ok(());
    }
    if amd::translate(translator, name, number, instruction)? {
        return Ok(());
    }
    if name != "GLSL.std.450" {
        return Err(translator.unsupported(format!("the instruction set {name} is not supported")));
    }
    if let Some(family) = family(InstructionSet::Glsl, number) {
        return componentwise(translator, family, instruction, 2);
    }
    let known = GlslStd450Op::from_u32(number);
    let done = match known {
        Some(number) => {
            linear_algebra::translate_glsl(translator, number, instruction)?
                || translate_glsl(translator, number, instruction)?
        }
        None => false,
    };
    if done {
        return Ok(());
    }
    Err(translator.unsupported(crate::module::names::ext_inst_name(name, number).into_owned()))
}

fn translate_glsl(
    translator: &mut Translator<'_>,
    number: GlslStd450Op,
    instruction: &Instruction,
) -> Result<bool> {
    use GlslStd450Op as G;
    match number {
        G::Modf | G::ModfStruct => {
            modf_or_frexp(
                translator,
                instruction,
                [&parts::ModfFraction, &crate::ops::glsl::Trunc],
                number == G::Modf,
            )?;
        }
        G::Frexp | G::FrexpStruct => {
            modf_or_frexp(
                translator,
                instruction,
                [&parts::FrexpMantissa, &parts::FrexpExponent],
                number == G::Frexp,
            )?;
        }
        G::PackSnorm4x8 => pack(translator, instruction, &parts::Snorm8, 8)?,
        G::PackUnorm4x8 => pack(translator, instruction, &parts::Unorm8, 8)?,
        G::PackSnorm2x16 => pack(translator, instruction, &parts::Snorm16, 16)?,
        G::PackUnorm2x16 => pack(translator, instruction, &parts::Unorm16, 16)?,
        G::PackHalf2x16 => pack(translator, instruction, &parts::Half, 16)?,
        G::UnpackSnorm4x8 => unpack(translator, instruction, &parts::FromSnorm8, 8)?,
        G::UnpackUnorm4x8 => unpack(translator, instruction, &parts::FromUnorm8, 8)?,
        G::UnpackSnorm2x16 => unpack(translator, instruction, &parts::FromSnorm16, 16)?,
        G::UnpackUnorm2x16 => unpack(translator, instruction, &parts::FromUnorm16, 16)?,
        G::UnpackHalf2x16 => unpack(translator, instruction, &parts::FromHalf, 16)?,
        G::PackDouble2x32 => {
            let words = translator.operand(instruction, 2)?;
            let &[low, high] = &words[..] else {
                return Err(translator.invalid("the operand must be a vector of two components"));
            };
            let first = match translator.optimizes {
                true => translator.pair(low, high)?,
                false => translator.emit_family(&observed::PackedDouble, 32, &[low, high])?,
            };
            translator.define_result(instruction, SmallVec::from_slice(&[first, first.plus(1)]));
        }
        G::UnpackDouble2x32 => {
            let words = translator.operand(instruction, 2)?;
            translator.define_result(instruction, words);
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// `Modf` and `Frexp`: the first part is the result, the second goes to a pointer or a member.
fn modf_or_frexp(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    families: [&'static OpFamily; 2],
    to_pointer: bool,
) -> Result<()> {
    let width = width(translator, instruction, 2)?;
    let operand_type = translator.type_of(translator.id(instruction, 2)?)?;
    let operand = components(translator, instruction, 2)?;
    let mut results = [Words::new(), Words::new()];
    for &component in &operand {
        for (result, family) in results.iter_mut().zip(families) {
            let kernel = family.kernel(width);
            let kernel = kernel.ok_or_else(|| {
                translator.unsupported(format!("{width}-bit {} is not supported", family.name))
            })?;
            let first = translator.emit_kernel(kernel, &[component])?;
            result.extend((0..kernel.words).map(|word| first.plus(word)));
        }
    }
    let [first, mut second] = results;
    let pointer = match to_pointer {
        true => {
            let id = translator.id(instruction, 3)?;
            Some(translator.pointer(id)?)
        }
        false => None,
    };
    let ty = match &pointer {
        Some(pointer) => pointer.pointee,
        None => {
            let ty = translator.result_type(instruction)?;
            match translator.module.ty(ty) {
                Type::Struct { members, .. } if members.len() == 2 => members[1].ty,
                _ => return Err(translator.invalid("the result must be a struct of two members")),
            }
        }
    };
    check_second_type(translator, families[0], operand_type, ty)?;
    // An exponent has 32 bits, or 16 (SPV_AMD_gpu_shader_int16).
    if std::ptr::eq(families[1], &parts::FrexpExponent)
        && let Some(kernel) = conversion::kernel(Conversion::S, 32, translator.scalar_width(ty)?)
    {
        let exponents =
            second.iter().map(|&word| translator.emit_kernel(kernel, &[word])).collect::<Result<Words>>()?;
        second = translator.expand_components(&exponents, translator.scalar_width(ty)?);
    }
    if let Some(pointer) = pointer {
        crate::ops::load_store::store(translator, &pointer, &second)?;
        translator.define_result(instruction, first);
    } else {
        let mut words = first;
        words.extend(second);
        translator.define_result(instruction, words);
    }
    Ok(())
}

/// The whole part of `Modf` is of its operand's type, the exponent of `Frexp` an integer of 32
/// bits, or of 16 with `SPV_AMD_gpu_shader_int16`.
fn check_second_type(
    translator: &Translator<'_>,
    first: &'static OpFamily,
    operand: crate::module::ty::TypeId,
    ty: crate::module::ty::TypeId,
) -> Result<()> {
    let scalar = match *translator.module.ty(ty) {
        Type::Vector { component, .. } => component,
        _ => ty,
    };
    let (fits, needed) = match std::ptr::eq(first, &parts::FrexpMantissa) {
        true => (
            matches!(translator.module.ty(scalar), Type::Int { width: 16 | 32, .. })
                && translator.component_count(ty) == translator.component_count(operand),
            "an integer of 32 bits for each component (16 with SPV_AMD_gpu_shader_int16)",
        ),
        false => (ty == operand, "the type of the operand"),
    };
    if fits {
        return Ok(());
    }
    let name = translator.module.describe_type(ty);
    Err(translator.invalid(format!("the second part of Modf or Frexp is of type {name} instead of {needed}")))
}

fn pack(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    family: &'static OpFamily,
    bits: u32,
) -> Result<()> {
    let mut sum = translator.constant(0)?;
    for (at, component) in components(translator, instruction, 2)?.into_iter().enumerate() {
        let by = translator.constant(bits * at as u32)?;
        let part = translator.emit_family(family, 32, &[component, by])?;
        sum = translator.emit_family(&bit::BitwiseOr, 32, &[sum, part])?;
    }
    translator.define_result(instruction, SmallVec::from_slice(&[sum]));
    Ok(())
}

fn unpack(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    family: &'static OpFamily,
    bits: u32,
) -> Result<()> {
    let id: Id = translator.id(instruction, 2)?;
    let word = translator.words(id)?[0];
    let mut words = Words::new();
    for at in 0..32 / bits {
        let by = translator.constant(bits * at)?;
        words.push(translator.emit_family(family, 32, &[word, by])?);
    }
    translator.define_result(instruction, words);
    Ok(())
}
